"""Whether a mesh is a closed surface with its faces turned outward, so that its back faces are always hidden."""

import numpy as np


def is_closed(vertices: np.ndarray, faces: np.ndarray) -> bool:
    """True if every edge is shared by two faces that run through it in opposite senses, and every connected part
    encloses a positive volume (a cavity, turned inward, makes the answer False)."""
    if not len(faces):
        return False
    # a seam's two sides differ by rounding
    scale = 1e-6 * max(float(np.ptp(vertices)), 1e-30)
    x, y, z = np.round((vertices - vertices.min(axis=0)) / scale).astype(np.int64).T  # 20 bits each
    _, place = np.unique((x << 42) | (y << 21) | z, return_inverse=True)
    f = place.reshape(-1)[faces].astype(np.int64)
    f = f[(f[:, 0] != f[:, 1]) & (f[:, 1] != f[:, 2]) & (f[:, 2] != f[:, 0])]  # poles of spheres and the like
    if not len(f):
        return False
    count = int(f.max()) + 1
    a, b = f.ravel(), np.roll(f, -1, axis=1).ravel()
    forth, back = np.sort(a * count + b), np.sort(b * count + a)
    if not np.array_equal(forth, back) or (np.diff(forth) == 0).any():
        return False
    from scipy.sparse import coo_matrix  # a third of a second to import
    from scipy.sparse.csgraph import connected_components

    graph = coo_matrix((np.ones(len(a), np.int8), (a, b)), shape=(count, count))
    _, part = connected_components(graph, directed=False)
    at = np.zeros((count, 3))
    at[place.reshape(-1)] = vertices
    p = at[f] - at[f].mean(axis=(0, 1))
    volume = np.einsum("ij,ij->i", p[:, 0], np.cross(p[:, 1], p[:, 2])) / 6
    return bool((np.bincount(part[f[:, 0]], volume)[np.unique(part[f[:, 0]])] > 0).all())
