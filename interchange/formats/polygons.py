"""Polygons to triangles: fans where every polygon is convex, ear clipping where one is not."""

import numpy as np


def triangulate(counts: np.ndarray, points: np.ndarray, indices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangles of polygons, as positions in the list of corners, and the polygon that each belongs to.

    ``counts`` (P,) corners per polygon; ``indices`` (sum,) vertex of each corner; ``points`` (V, 3).
    Returns (T, 3) corner positions and (T,) polygon numbers. Polygons of fewer than three corners give none.
    """
    counts = np.asarray(counts, np.int64)
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    fans: list[np.ndarray] = []
    owners: list[np.ndarray] = []
    for n in np.unique(counts[counts >= 3]):
        polygons = np.flatnonzero(counts == n)
        corners = starts[polygons][:, None] + np.arange(n)
        k = np.arange(1, n - 1)
        triangles = np.stack(
            [np.repeat(corners[:, :1], n - 2, axis=1), corners[:, k], corners[:, k + 1]], axis=-1
        )
        if n > 3:
            for row in np.flatnonzero(~_convex(points[indices[corners]])):
                local = ear_clip(points[indices[corners[row]]])
                triangles[row] = corners[row][local]
        fans.append(triangles.reshape(-1, 3))
        owners.append(np.repeat(polygons, n - 2))
    if not fans:
        return np.zeros((0, 3), np.int64), np.zeros(0, np.int64)
    order = np.argsort(np.concatenate(owners), kind="stable")
    return np.concatenate(fans)[order], np.concatenate(owners)[order]


def newell(polygon: np.ndarray) -> np.ndarray:
    """Area vectors (..., 3) of closed polygons (..., n, 3), by Newell's method."""
    centred = polygon - polygon.mean(axis=-2, keepdims=True)
    return 0.5 * np.cross(centred, np.roll(centred, -1, axis=-2)).sum(axis=-2)


def _convex(polygons: np.ndarray) -> np.ndarray:
    """(P,) whether each polygon (P, n, 3) turns one way at every corner, seen along its area vector."""
    edge = np.roll(polygons, -1, axis=1) - polygons
    turn = np.cross(np.roll(edge, 1, axis=1), edge)
    along = np.einsum("pij,pj->pi", turn, newell(polygons))
    size = np.linalg.norm(edge, axis=2).max(axis=1) ** 4
    return (along >= -1e-9 * size[:, None]).all(axis=1)


def ear_clip(polygon: np.ndarray) -> np.ndarray:
    """(n - 2, 3) corners of the triangles of one simple polygon (n, 3), wound as it is (Meisters 1975)."""
    normal = newell(polygon)
    axis = int(np.argmax(np.abs(normal)))
    flat = np.delete(polygon, axis, axis=1)
    if (normal[axis] < 0) != (axis == 1):
        flat = flat * [-1, 1]
    left = list(range(len(polygon)))
    triangles = []
    while len(left) > 3:
        best, found = 0, False
        for i in range(len(left)):
            a, b, c = flat[left[i - 1]], flat[left[i]], flat[left[(i + 1) % len(left)]]
            area = _cross(b - a, c - a)
            if area <= 0:
                continue
            others = flat[[j for j in left if j not in (left[i - 1], left[i], left[(i + 1) % len(left)])]]
            inside = (
                (_cross(b - a, others - a) > 0)
                & (_cross(c - b, others - b) > 0)
                & (_cross(a - c, others - c) > 0)
            )
            if not inside.any():
                best, found = i, True
                break
        if not found:
            best = 0  # a polygon that crosses itself has no ear: any triangle is as right as another
        triangles.append([left[best - 1], left[best], left[(best + 1) % len(left)]])
        del left[best]
    triangles.append(left)
    return np.array(triangles)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
