"""Scene to image, now."""
