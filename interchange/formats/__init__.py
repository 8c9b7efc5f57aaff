"""How scenes, parts, images and measurements are read and written, one file a format.

This is the only package that imports ``pxr``, COLLADA or CAD kernels.
"""
