"""Triangles as files give them, made into surfaces: welded, checked, with normals that know a crease.

A format without normals (STL, most OFF and PLY files) has facets alone. Vertices at one place become one,
faces that meet at less than the crease angle share a smooth normal there, others keep a hard edge. Normals
are means of the faces' weighted by their angles at the vertex (Thürmer, Wüthrich 1998), over the fan of faces
that are joined by smooth edges.
"""

import numpy as np

from interchange.mesh import Mesh, face_normals, from_corners
from interchange.problems import FileError, Problem, Severity, Where

CREASE_DEG = 30.0
WELD = 1e-6  # of the size: float32 rounding, and zeros that came out as 1e-17


class Findings:
    """The problems of one file, collected; ``stop`` raises those that are errors, all at once."""

    def __init__(self, path: str) -> None:
        self.path = path
        self.problems: list[Problem] = []

    def error(self, message: str, place: str = "") -> None:
        self.problems.append(Problem(message, Where(self.path, place)))

    def loss(self, message: str, place: str = "") -> None:
        self.problems.append(Problem(message, Where(self.path, place), Severity.LOSS))

    def note(self, message: str, place: str = "") -> None:
        self.problems.append(Problem(message, Where(self.path, place), Severity.NOTE))

    def stop(self) -> None:
        if wrong := [p for p in self.problems if p.severity is Severity.ERROR]:
            raise FileError(wrong)


def check(points: np.ndarray, faces: np.ndarray, find: Findings, place: str = "") -> bool:
    """Whether there are faces, all of them on vertices that exist and are finite. Errors go to ``find``."""
    found = len(find.problems)
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(bad):
        more = f" ({len(bad)} vertices are not)" if len(bad) > 1 else ""
        find.error(f"Every vertex must be finite; vertex {bad[0]} is {points[bad[0]].tolist()}{more}.", place)
    if faces.size and (faces.min() < 0 or faces.max() >= len(points)):
        row = int(np.flatnonzero(((faces < 0) | (faces >= len(points))).any(axis=1))[0])
        find.error(
            f"Faces must index the {len(points)} vertices from 0 on; face {row} has {faces[row].tolist()}.",
            place,
        )
    if not faces.size:
        find.error("A mesh must have faces; this one has none.", place)
    return len(find.problems) == found


def weld(points: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices closer than ``WELD`` times the largest side of the box around them become one; unused ones go.

    Returns the vertices and the faces (F, 3) on them, in their order.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    corners = points[faces.ravel()] + 0.0  # no -0
    order = np.lexsort(corners.T)
    ordered = corners[order]
    new = np.concatenate([[True], (ordered[1:] != ordered[:-1]).any(axis=1)])
    which = np.empty(len(order), np.int64)
    which[order] = np.cumsum(new) - 1
    distinct = ordered[new]
    size = float(np.ptp(distinct, axis=0).max())
    near = cKDTree(distinct).query_pairs(WELD * size, output_type="ndarray")
    if len(near):
        links = coo_matrix((np.ones(len(near), np.int8), near.T), shape=(len(distinct),) * 2)
        _, group = connected_components(links, directed=False)
        _, first, group = np.unique(group, return_index=True, return_inverse=True)
        distinct, which = distinct[first], group[which]
    return distinct, which.reshape(-1, 3)


def crease_mesh(
    points: np.ndarray, faces: np.ndarray, uv: np.ndarray | None = None, crease_deg: float = CREASE_DEG
) -> Mesh:
    """A mesh with smooth normals, hard at edges where the faces' normals differ by more than ``crease_deg``.

    ``uv`` (F, 3, 2) at the corners, or None. Edges of one face, of more than two, or between faces of
    opposite winding are hard.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    n = face_normals(points, faces)
    first, second, opposed = _edge_pairs(faces)
    f, g = first // 3, second // 3
    smooth = opposed & (np.sum(n[f] * n[g], axis=1) >= np.cos(np.radians(crease_deg)))
    first, second = first[smooth], second[smooth]

    # the half-edge from corner c of one face starts where its twin in the other face ends
    rows = np.concatenate([first, _next(first)])
    columns = np.concatenate([_next(second), second])
    links = coo_matrix((np.ones(len(rows), np.int8), (rows, columns)), shape=(faces.size, faces.size))
    count, fan = connected_components(links, directed=False)
    total = np.zeros((count, 3))
    for k in range(3):
        a = points[faces[:, (k + 1) % 3]] - points[faces[:, k]]
        b = points[faces[:, (k + 2) % 3]] - points[faces[:, k]]
        angle = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.sum(a * b, axis=1))
        np.add.at(total, fan[k::3], n * angle[:, None])
    one = np.empty(count, np.int64)
    one[fan] = np.arange(faces.size)  # a corner of each fan
    length = np.linalg.norm(total, axis=1, keepdims=True)
    normals = np.where(length > 1e-12, total / np.maximum(length, 1e-300), n[one // 3])
    if uv is not None:
        return from_corners(points, faces, normals[fan].reshape(-1, 3, 3), uv)
    return Mesh(points[faces.ravel()[one]], fan.reshape(-1, 3).astype(np.int32), normals)


def _next(corner: np.ndarray) -> np.ndarray:
    return corner - corner % 3 + (corner % 3 + 1) % 3


def _edge_pairs(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Half-edges (3 face + corner) that share an edge of exactly two faces, and whether they run in opposite
    directions, as those of equally wound faces do."""
    order, starts, counts = _edges(faces)
    two = starts[counts == 2]
    first, second = order[two], order[two + 1]
    return first, second, faces.ravel()[first] != faces.ravel()[second]


def _edges(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Half-edges, those of one edge side by side; where each edge begins, and how many it has."""
    start, end = faces.ravel().astype(np.int64), np.roll(faces, -1, axis=1).ravel().astype(np.int64)
    keys = np.minimum(start, end) * (faces.max() + 1) + np.maximum(start, end)
    order = np.argsort(keys, kind="stable")
    _, starts, counts = np.unique(keys[order], return_index=True, return_counts=True)
    return order, starts, counts


def describe(points: np.ndarray, faces: np.ndarray, find: Findings, place: str = "") -> None:
    """Notes on a welded surface that encloses no volume, or whose faces disagree on what is outside."""
    _, _, counts = _edges(faces)
    _, _, opposed = _edge_pairs(faces)
    if several := int((counts > 2).sum()):
        find.note(f"{several} edges belong to more than two faces.", place)
    if single := int((counts == 1).sum()):
        find.note(f"The surface is open: {single} edges belong to one face.", place)
    if wrong := int((~opposed).sum()):
        find.note(f"At {wrong} edges neighbouring faces are wound in opposite senses.", place)
    if (counts == 2).all() and opposed.all():
        p = points[faces] - points.mean(axis=0)
        if np.einsum("fi,fi->", p[:, 0], np.cross(p[:, 1], p[:, 2])) < 0:
            find.note("The surface is inside out: its faces are wound clockwise seen from outside.", place)


def with_area(points: np.ndarray, faces: np.ndarray, find: Findings, place: str = "") -> np.ndarray:
    """(F,) which triangles have an area; the others are noted."""
    p = points[faces]
    area = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1) > 0
    if not area.all():
        find.note(f"{(~area).sum()} of {len(faces)} triangles have no area and are left out.", place)
    return area


def unit_normals(points: np.ndarray, faces: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """(V, 3) of length one; the face's own normal where the file's has no length."""
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    bad = ~(np.isfinite(length) & (length > 0))[:, 0]
    if bad.any():
        instead = np.tile([0.0, 0.0, 1.0], (len(points), 1))
        instead[faces.ravel()] = np.repeat(face_normals(points, faces), 3, axis=0)
        normals, length = np.where(bad[:, None], instead, normals), np.where(bad[:, None], 1.0, length)
    return np.asarray(normals / length)
