"""A second way of drawing calibration errors, and second forms of causes.

Who writes the diagnosis does not read this folder.
"""
