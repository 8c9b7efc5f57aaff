"""Heights from normals: the surface whose slopes are nearest to those measured.

    minimise  sum (z_x - p)² + (z_y - q)²,   p = -n.x / n.z, q = -n.y / n.z:     a Poisson equation, by cosine transform

Simchony, Chellappa, Shao: Direct analytical methods for solving Poisson equations in computer vision problems. PAMI
1990 (natural boundary). Slopes lie between pixels, as means of their neighbours', so that a plane and a paraboloid
come back exactly.
"""

import numpy as np
from scipy.fft import dctn, idctn

from interchange.problems import BrightfieldError


def heights(normals: np.ndarray, pitch: float, steepest: float = np.radians(80)) -> np.ndarray:
    """(H, W) m, mean 0, seen from above by a telecentric camera with x right and y up: ``normals`` (H, W, 3).

    ``pitch``: m a pixel. Slopes beyond ``steepest`` rad are cut to it; a pixel without a normal is taken as flat.
    Raises BrightfieldError for images of fewer than 2 px a side.
    """
    if min(normals.shape[:2]) < 2:
        raise BrightfieldError("Heights need images of 2 x 2 px or more.")
    n = np.where(np.isfinite(normals).all(axis=-1, keepdims=True), normals, [0.0, 0.0, 1.0])
    z = np.maximum(n[..., 2], np.cos(steepest))
    right, down = -n[..., 0] / z * pitch, n[..., 1] / z * pitch  # a step of one pixel
    height, width = z.shape
    divergence = np.zeros((height, width))
    between = (right[:, 1:] + right[:, :-1]) / 2
    divergence[:, :-1] += between
    divergence[:, 1:] -= between
    between = (down[1:] + down[:-1]) / 2
    divergence[:-1] += between
    divergence[1:] -= between
    rows = 2 * np.cos(np.pi * np.arange(height) / height) - 2
    columns = 2 * np.cos(np.pi * np.arange(width) / width) - 2
    laplace = rows[:, None] + columns
    laplace[0, 0] = 1.0
    spectrum = dctn(divergence, norm="ortho") / laplace
    spectrum[0, 0] = 0.0
    return np.asarray(idctn(spectrum, norm="ortho"))
