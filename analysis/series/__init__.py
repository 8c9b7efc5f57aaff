"""Illumination series: many images of one view, each lit from another direction, and what they tell of a surface."""
