"""The gap between captures and simulation: where it is, what causes it, and how far it shrinks."""
