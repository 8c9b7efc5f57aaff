"""Transforms for Blender."""

import numpy as np
from mathutils import Matrix


def matrix(a_from_b: np.ndarray) -> Matrix:
    return Matrix([[float(x) for x in row] for row in a_from_b])
