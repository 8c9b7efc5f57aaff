"""Algorithms of machine vision, run over a series of known truth, scored, tuned, and verified on real images."""
