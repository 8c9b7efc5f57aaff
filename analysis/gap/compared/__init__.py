"""Captures put together, and each condition of theirs as the model stands."""
