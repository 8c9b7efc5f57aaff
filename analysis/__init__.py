"""Images to knowledge."""
