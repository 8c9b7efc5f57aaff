"""What was found, written into the scene."""
