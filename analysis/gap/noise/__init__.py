"""Effects that move no mean image: noise, fixed patterns, hot pixels, codes."""
