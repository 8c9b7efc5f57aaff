"""Image series over declared parameters: a plan, its samples, the frames that show them, and what made each of them."""
