"""The shared language: what a scene is, what it means, how it is written."""
