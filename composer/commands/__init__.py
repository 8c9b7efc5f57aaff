"""What `brightfield` can do, one file a command."""
