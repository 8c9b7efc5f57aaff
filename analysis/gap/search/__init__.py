"""Where hypotheses stand: followed from the scene as written to where they come nearest to the captures."""
