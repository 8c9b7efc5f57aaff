"""Convex polytopes as lists of polygons, cut by planes: what a camera and a box have in common, seen from a lamp."""

import numpy as np

Polygons = list[np.ndarray]  # each (n, 3)

_CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
_SIDES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))


def box(bounds: np.ndarray) -> Polygons:
    """The box between ``bounds`` (2, 3)."""
    corners = bounds[0] + _CORNERS * (bounds[1] - bounds[0])
    return [corners[list(side)] for side in _SIDES]


def cut(polygons: Polygons, planes: np.ndarray) -> Polygons:
    """The part where n . x + d >= 0 for every plane (n, d) of ``planes`` (P, 4), with the cut itself closed."""
    for plane in planes:
        kept: Polygons = []
        rim: list[np.ndarray] = []
        for polygon in polygons:
            side = polygon @ plane[:3] + plane[3]
            inside = side >= 0
            if inside.all():
                kept.append(polygon)
                continue
            if not inside.any():
                continue
            points: list[np.ndarray] = []
            for i in range(len(polygon)):
                j = (i + 1) % len(polygon)
                if inside[i]:
                    points.append(polygon[i])
                if inside[i] != inside[j]:
                    t = side[i] / (side[i] - side[j])
                    points.append(polygon[i] + t * (polygon[j] - polygon[i]))
                    rim.append(points[-1])
            if len(points) >= 3:
                kept.append(np.array(points))
        if len(rim) >= 3:
            kept.append(_around(np.array(rim), plane[:3]))
        polygons = kept
    return polygons


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Of two vectors (3,); NumPy's own takes ten times as long to see that they are vectors."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def _around(points: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Points of a convex rim in the order in which they follow each other."""
    axis = np.eye(3)[np.argmin(np.abs(normal))]
    u = cross(normal, axis)
    v = cross(normal, u)
    off = points - points.mean(axis=0)
    return points[np.argsort(np.arctan2(off @ v, off @ u))]


def distance(boxes: np.ndarray, point: np.ndarray) -> np.ndarray:
    """(N,) of a point from boxes (N, 2, 3) along the axes; 0 inside."""
    off = np.maximum(np.maximum(boxes[:, 0] - point, point - boxes[:, 1]), 0)
    return np.asarray(np.linalg.norm(off, axis=1))
