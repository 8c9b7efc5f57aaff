"""GLSL sources, read by ``realtime.programs``."""
