"""Measured or given reflectance onto the representations of interchange.brdf, and what that leaves over."""
