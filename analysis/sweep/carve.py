"""A defect cut into a surface: its triangles refined, cut along the defect's outline, and moved by its depth.

1. faces that look along the defect's z and lie within its reach are taken out as a patch;
2. triangles of the patch near the outline or inside are halved across their longest edges until these are short enough
   (Rivara: Algorithms for refining triangular grids suitable for adaptive and multigrid techniques. 1984);
3. triangles across the outline are cut along it;
4. vertices move by the height h(x, y) along z, normals with them: n' ~ n - grad h (z . n).

Inside and outside become two meshes that meet along the outline, so that a renderer's own ids are the ground truth. New
vertices on the patch's border lie on its edges and do not move: the surface stays closed.
"""

from dataclasses import dataclass, replace

import numpy as np

from analysis.sweep.footprint import Footprint
from interchange.frames import apply
from interchange.mesh import Mesh, face_normals

FACING = 0.2  # least cosine between a face's normal and the defect's
ROUNDS = 60
MOST = 400_000  # triangles of a patch


@dataclass(frozen=True, eq=False)
class _Patch:
    """Defect's frame, m."""

    points: np.ndarray
    normals: np.ndarray
    uv: np.ndarray | None
    faces: np.ndarray

    def between(self, i: np.ndarray, j: np.ndarray, t: np.ndarray) -> "_Patch":
        """With further vertices, each at share ``t`` of the way from ``i`` to ``j``."""
        w = t[:, None]
        n = self.normals[i] * (1 - w) + self.normals[j] * w
        n /= np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-300)
        return replace(
            self,
            points=np.concatenate([self.points, self.points[i] * (1 - w) + self.points[j] * w]),
            normals=np.concatenate([self.normals, n]),
            uv=None if self.uv is None else np.concatenate([self.uv, self.uv[i] * (1 - w) + self.uv[j] * w]),
        )


def carve(mesh: Mesh, defect_from_body: np.ndarray, shape: Footprint) -> tuple[Mesh | None, Mesh | None]:
    """(the surface without the defect, the defect's surface), both in the body's frame; None for one without faces.

    ``defect_from_body`` (4, 4): z is the outward normal at the defect's middle; may scale.
    """
    chosen = _faces_within(mesh, defect_from_body, shape)
    if not chosen.any():
        return mesh, None
    linear = defect_from_body[:3, :3]
    normals = mesh.normals @ np.linalg.inv(linear)
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    patch = _Patch(
        apply(defect_from_body, mesh.vertices), normals, mesh.uv, mesh.faces[chosen].astype(np.int64)
    )
    patch = _compact(patch, patch.faces)
    patch = _refined(patch, shape)
    patch, inside = _cut(patch, shape)
    patch = _pressed(patch, shape)
    body_from_defect = np.linalg.inv(defect_from_body)
    rest = _joined(
        mesh, mesh.faces[~chosen], _mesh(_compact(patch, patch.faces[~inside]), body_from_defect, linear)
    )
    own = _mesh(_compact(patch, patch.faces[inside]), body_from_defect, linear) if inside.any() else None
    return rest, own


def _faces_within(mesh: Mesh, defect_from_body: np.ndarray, shape: Footprint) -> np.ndarray:
    """(F,) bool."""
    corners = apply(defect_from_body, mesh.vertices)[mesh.faces]
    flat = corners.reshape(-1, 3)
    n = face_normals(flat, np.arange(len(flat)).reshape(-1, 3))
    turned = np.sign(np.linalg.det(defect_from_body[:3, :3]))
    reach = np.array([*shape.reach, max(shape.reach)]) + shape.fine
    near = (corners.min(axis=1) <= reach).all(axis=1) & (corners.max(axis=1) >= -reach).all(axis=1)
    return near & (turned * n[:, 2] > FACING)


def _refined(patch: _Patch, shape: Footprint) -> _Patch:
    for _ in range(ROUNDS):
        a, b, c = (patch.points[patch.faces[:, k]] for k in range(3))
        edges = np.stack([b - a, c - b, a - c], axis=1)
        length = np.linalg.norm(edges, axis=2)
        longest, size = length.argmax(axis=1), length.max(axis=1)
        middle = (a + b + c) / 3
        level = shape.level(middle[:, 0], middle[:, 1])
        near = (np.abs(level) if shape.is_flat else level) <= shape.slope * size
        wanted = near & (size > shape.fine)
        if not wanted.any() or len(patch.faces) > MOST:
            return patch
        patch = _halved(patch, wanted, longest)
    return patch


def _halved(patch: _Patch, wanted: np.ndarray, longest: np.ndarray) -> _Patch:
    """Triangles ``wanted`` cut across their longest edges, and their neighbours so that no vertex hangs."""
    faces = patch.faces
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1)  # (F, 3, 2)
    count = len(patch.points)
    keys = ends.min(axis=2) * count + ends.max(axis=2)
    unique, edge = np.unique(keys, return_inverse=True)
    edge = edge.reshape(-1, 3)
    rows = np.arange(len(faces))
    marked = np.zeros(len(unique), bool)
    marked[edge[rows[wanted], longest[wanted]]] = True
    while True:
        touched = marked[edge].any(axis=1)
        more = edge[rows[touched], longest[touched]]
        if marked[more].all():
            break
        marked[more] = True
    i, j = np.divmod(unique[marked], count)
    grown = patch.between(i, j, np.full(len(i), 0.5))
    middle = np.full(len(unique), -1)
    middle[marked] = count + np.arange(len(i))
    turned = np.stack([np.roll(np.arange(3), -k) for k in range(3)])[longest]  # the longest edge first
    v, m = faces[rows[:, None], turned], middle[edge[rows[:, None], turned]]
    out = [v[m[:, 0] < 0]]
    cut = m[:, 0] >= 0
    v, m = v[cut], m[cut]
    # two halves, each of which has one of the other two edges: that may be cut as well
    for side, half in (
        (2, np.stack([v[:, 2], v[:, 0], m[:, 0]], axis=1)),
        (1, np.stack([v[:, 1], v[:, 2], m[:, 0]], axis=1)),
    ):
        again = m[:, side] >= 0
        p, q, r = half[again].T
        s = m[again, side]
        out += [half[~again], np.stack([p, s, r], axis=1), np.stack([s, q, r], axis=1)]
    return replace(grown, faces=np.concatenate(out))


def _cut(patch: _Patch, shape: Footprint) -> tuple[_Patch, np.ndarray]:
    """Triangles across the outline cut along it; (F,) bool, whether each is inside."""
    level = shape.level(patch.points[:, 0], patch.points[:, 1])
    below = level < 0
    state = below[patch.faces].sum(axis=1)
    mixed = patch.faces[(state == 1) | (state == 2)]
    whole = patch.faces[(state == 0) | (state == 3)]
    whole_inside = (state == 3)[(state == 0) | (state == 3)]
    if not len(mixed):
        return replace(patch, faces=whole), whole_inside
    # bring the corner that is alone on its side to the front
    alone_below = below[mixed].sum(axis=1) == 1
    lonely = np.where(alone_below, below[mixed].argmax(axis=1), (~below[mixed]).argmax(axis=1))
    turned = np.stack([np.roll(np.arange(3), -k) for k in range(3)])[lonely]
    v = mixed[np.arange(len(mixed))[:, None], turned]
    count = len(patch.points)
    pairs = np.concatenate([v[:, [0, 1]], v[:, [0, 2]]])
    keys, which = np.unique(pairs.min(axis=1) * count + pairs.max(axis=1), return_inverse=True)
    i, j = np.divmod(keys, count)
    grown = patch.between(i, j, _crossing(patch.points[i], patch.points[j], shape))
    p, q = count + which[: len(v)], count + which[len(v) :]
    tip = np.stack([v[:, 0], p, q], axis=1)
    rest = np.concatenate([np.stack([p, v[:, 1], v[:, 2]], 1), np.stack([p, v[:, 2], q], 1)])
    faces = np.concatenate([whole, tip, rest])
    return replace(grown, faces=faces), np.concatenate(
        [whole_inside, alone_below, ~alone_below, ~alone_below]
    )


def _crossing(a: np.ndarray, b: np.ndarray, shape: Footprint) -> np.ndarray:
    """Share of the way from ``a`` to ``b`` at which the outline is met, by bisection."""
    start = shape.level(a[:, 0], a[:, 1]) < 0
    low, high = np.zeros(len(a)), np.ones(len(a))
    for _ in range(40):
        t = (low + high) / 2
        x = a + t[:, None] * (b - a)
        same = (shape.level(x[:, 0], x[:, 1]) < 0) == start
        low, high = np.where(same, t, low), np.where(same, high, t)
    return (low + high) / 2


def _pressed(patch: _Patch, shape: Footprint) -> _Patch:
    if shape.is_flat:
        return patch
    x, y = patch.points[:, 0], patch.points[:, 1]
    within = shape.level(x, y) <= 0
    h = np.where(within, shape.height(x, y), 0.0)
    slope = np.where(within[:, None], shape.gradient(x, y), 0.0)
    n = patch.normals.copy()
    n[:, :2] -= slope * n[:, 2:]
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    points = patch.points.copy()
    points[:, 2] += h
    return replace(patch, points=points, normals=n)


def _compact(patch: _Patch, faces: np.ndarray) -> _Patch:
    """The vertices that ``faces`` use."""
    used, index = np.unique(faces, return_inverse=True)
    return _Patch(
        patch.points[used],
        patch.normals[used],
        None if patch.uv is None else patch.uv[used],
        index.reshape(-1, 3),
    )


def _mesh(patch: _Patch, body_from_defect: np.ndarray, linear: np.ndarray) -> Mesh:
    normals = patch.normals @ linear  # the inverse transpose of the way back
    normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    return Mesh(apply(body_from_defect, patch.points), patch.faces.astype(np.int32), normals, patch.uv)


def _joined(mesh: Mesh, faces: np.ndarray, patch: Mesh) -> Mesh | None:
    """The faces that were left alone, and those of the patch."""
    used, index = np.unique(faces, return_inverse=True)
    if not len(faces) and not len(patch.faces):
        return None
    return Mesh(
        np.concatenate([mesh.vertices[used], patch.vertices]),
        np.concatenate([index.reshape(-1, 3), patch.faces + len(used)]).astype(np.int32),
        np.concatenate([mesh.normals[used], patch.normals]),
        None if mesh.uv is None or patch.uv is None else np.concatenate([mesh.uv[used], patch.uv]),
    )
