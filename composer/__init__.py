"""The person's desk: command line, demo, and later the window."""
