"""Triangles brought within a chord tolerance of the smooth surface whose normals they carry.

A CAD kernel's triangles stand with their vertices on the surface, with the surface's own normals, but between
the vertices they can miss it by more than was asked for. Along an edge of length l that leaves the surface's
tangent planes at its ends under the angles a and b, the surface stands off by about

    s = l / 2 tan((a + b) / 4)            (exact for a circle, to third order for any curve)

and over a triangle's centroid, for a quadratic surface, by 4/9 (s1 + s2 + s3). Edges inside a face that are too
far off are split at that distance, which quarters it. Edges on a face's border stay: they are shared with the
next face, and the kernel keeps its tolerance along them.
"""

import numpy as np

from interchange.mesh import Mesh

ROUNDS = 8
SPURIOUS = 0.05  # a ratio of the two angles below this is a normal that is none, as at the tip of a cone
NEGLIGIBLE = 0.1  # of the chord tolerance: closer than this, no angle between normals matters


def refine(mesh: Mesh, chord: float, angle: float) -> Mesh:
    """Split edges until the surface stands off by at most ``chord`` m, and neighbouring normals differ by at
    most ``angle`` rad. Edges that a crease or a border holds are left as they are."""
    for _ in range(ROUNDS):
        edges, of_face, inner = _edges(mesh.faces)
        s, turn = _stand_off(mesh, edges)
        split = inner & ((np.abs(s) > chord) | ((turn > angle) & (np.abs(s) > NEGLIGIBLE * chord)))
        centre = np.abs(s[of_face].sum(axis=1)) * 4 / 9 > chord
        longest = np.where(inner[of_face], np.abs(s[of_face]), -1.0)
        pick = of_face[np.arange(len(of_face)), longest.argmax(axis=1)]
        split[pick[centre & (longest.max(axis=1) > 0)]] = True
        if not split.any():
            break
        mesh = _split(mesh, edges, of_face, split, s)
    return mesh


def deviation(mesh: Mesh) -> float:
    """Largest distance between the triangles and the smooth surface through their vertices, m."""
    edges, of_face, _ = _edges(mesh.faces)
    s, _ = _stand_off(mesh, edges)
    centre = np.abs(s[of_face].sum(axis=1)) * 4 / 9
    return float(max(np.abs(s).max(initial=0.0), centre.max(initial=0.0)))


def _edges(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Edges (E, 2); (F, 3) the edge from each corner to the next; (E,) whether exactly two triangles share it."""
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2).astype(np.int64)
    low, high = ends.min(axis=1), ends.max(axis=1)
    keys, which, count = np.unique(low * (faces.max() + 1) + high, return_inverse=True, return_counts=True)
    edges = np.stack(np.divmod(keys, faces.max() + 1), axis=1)
    return edges, which.reshape(-1, 3), count == 2


def _stand_off(mesh: Mesh, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Signed distance of the surface from the middle of each edge, along the normals; angle between these."""
    i, j = edges.T
    e = mesh.vertices[j] - mesh.vertices[i]
    length = np.linalg.norm(e, axis=1)
    e = e / np.where(length > 0, length, 1)[:, None]
    ni, nj = mesh.normals[i], mesh.normals[j]
    a = -np.arcsin(np.clip(np.sum(ni * e, axis=1), -1, 1))
    b = np.arcsin(np.clip(np.sum(nj * e, axis=1), -1, 1))
    small, large = np.minimum(np.abs(a), np.abs(b)), np.maximum(np.abs(a), np.abs(b))
    s = np.where(small > SPURIOUS * large, length / 2 * np.tan((a + b) / 4), 0.0)
    return s, np.arctan2(np.linalg.norm(np.cross(ni, nj), axis=1), np.sum(ni * nj, axis=1))


def _split(mesh: Mesh, edges: np.ndarray, of_face: np.ndarray, split: np.ndarray, s: np.ndarray) -> Mesh:
    """Put a vertex onto the surface over the middle of every marked edge, and cut the triangles there."""
    i, j = edges[split].T
    e = mesh.vertices[j] - mesh.vertices[i]
    n = mesh.normals[i] + mesh.normals[j]
    # the normal halfway of a quadratic curve: mirrored at the plane across the edge (Vlachos et al. 2001, eq. 6)
    tilt = 2 * np.sum(n * e, axis=1) / np.maximum(np.sum(e * e, axis=1), 1e-300)
    across = n - tilt[:, None] * e
    n, across = (v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-300) for v in (n, across))
    vertices = np.concatenate([mesh.vertices, mesh.vertices[i] + e / 2 + n * s[split][:, None]])
    normals = np.concatenate([mesh.normals, across])
    middle = np.full(len(edges), -1)
    middle[split] = len(mesh.vertices) + np.arange(len(i))
    m, f = middle[of_face], mesh.faces.astype(np.int64)
    marked = m >= 0
    count = marked.sum(axis=1)
    # turn each triangle so that its cases look alike: one mark on edge 0; two marks on edges 0 and 1
    turn = np.where(
        count == 1, marked.argmax(axis=1), np.where(count == 2, ((~marked).argmax(axis=1) + 1) % 3, 0)
    )
    order = (np.arange(3) + turn[:, None]) % 3
    f, m = np.take_along_axis(f, order, 1), np.take_along_axis(m, order, 1)
    (a, b, c), (ab, bc, ca) = f.T, m.T
    pieces = {
        0: [(a, b, c)],
        1: [(a, ab, c), (ab, b, c)],
        2: [(ab, b, bc), (a, ab, c), (ab, bc, c)],
        3: [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)],
    }
    faces = [np.stack(p, axis=1)[count == k] for k, all_of in pieces.items() for p in all_of]
    return Mesh(vertices, np.concatenate(faces).astype(np.int32), normals)
