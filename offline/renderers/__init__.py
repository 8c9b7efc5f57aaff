"""The path tracers, one file each."""
