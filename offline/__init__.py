"""Scene to image, right."""
