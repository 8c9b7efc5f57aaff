"""The demonstration: a CAD part becomes an inspection scene, shown by both renderers side by side."""
