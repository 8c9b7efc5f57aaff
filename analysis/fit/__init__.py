"""Reflectance models fitted to measurements."""
