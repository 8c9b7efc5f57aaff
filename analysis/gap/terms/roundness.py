"""Whether a body is round about the vertical, so that no image tells its turns."""

import numpy as np

from interchange.mesh import Mesh

POINTS, LAYERS, SECTORS = 20_000, 6, 25  # by which it is told whether an object is round
ROUND = 0.03  # of its radius: facets, and how near to the farthest the points lie


def is_round(mesh: Mesh) -> bool:
    """Whether a turn about the vertical through the middle of its box changes its surface by facets at most: in every
    layer the farthest points lie as far in all directions."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    rng = np.random.default_rng(0)
    corners = mesh.vertices[mesh.faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    if not area.sum() > 0:
        return False
    chosen = corners[rng.choice(len(corners), POINTS, p=area / area.sum())]
    u, v = np.sort(rng.random((2, POINTS)), axis=0)
    points = u[:, None] * chosen[:, 0] + (v - u)[:, None] * chosen[:, 1] + (1 - v)[:, None] * chosen[:, 2]
    x, y = (points - (low + high) / 2)[:, :2].T
    layer = np.minimum(
        (LAYERS * (points[:, 2] - low[2]) / max(high[2] - low[2], 1e-12)).astype(int), LAYERS - 1
    )
    sector = np.minimum((SECTORS * (np.arctan2(y, x) / (2 * np.pi) + 0.5)).astype(int), SECTORS - 1)
    farthest = np.zeros((LAYERS, SECTORS))
    np.maximum.at(farthest, (layer, sector), np.hypot(x, y))
    spread = np.ptp(farthest, axis=1)
    return bool((spread < ROUND * farthest.max()).all())
