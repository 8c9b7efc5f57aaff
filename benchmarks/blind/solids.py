"""Triangle meshes of the benchmark's scenes, mm, faces counter-clockwise from outside."""

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True, eq=False)
class Solid:
    """``vertices`` (V, 3) mm, ``faces`` (F, 3); ``normals`` (V, 3) or None for flat faces; ``uv`` (V, 2) or None."""

    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray | None = None
    uv: np.ndarray | None = None

    def moved(self, x: float = 0, y: float = 0, z: float = 0, turn: float = 0) -> "Solid":
        """Turned about z by ``turn`` degrees, then shifted."""
        c, s = np.cos(np.deg2rad(turn)), np.sin(np.deg2rad(turn))
        R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        normals = None if self.normals is None else self.normals @ R.T
        return replace(self, vertices=self.vertices @ R.T + [x, y, z], normals=normals)


def joined(*solids: Solid) -> Solid:
    """One mesh; flat ones get their faces' own normals where another is smooth."""
    smooth = any(s.normals is not None for s in solids)
    parts = [_with_normals(s) if smooth and s.normals is None else s for s in solids]
    start = np.cumsum([0, *(len(s.vertices) for s in parts)])
    return Solid(
        np.concatenate([s.vertices for s in parts]),
        np.concatenate([s.faces + k for s, k in zip(parts, start[:-1], strict=True)]),
        np.concatenate([s.normals for s in parts]) if smooth else None,
    )


def _with_normals(solid: Solid) -> Solid:
    corners = solid.vertices[solid.faces]
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    return Solid(corners.reshape(-1, 3), np.arange(3 * len(n)).reshape(-1, 3), np.repeat(n, 3, axis=0))


def sheet(x0: float, y0: float, x1: float, y1: float, z: float = 0.0) -> Solid:
    """A rectangle that faces up; uv 0 to 1."""
    v = np.array([[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]], float)
    return Solid(v, np.array([[0, 1, 2], [0, 2, 3]]), None, np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float))


def sheets(cells: list[tuple[float, float, float, float]], z: float) -> Solid:
    return joined(*(sheet(*c, z) for c in cells))


def box(w: float, d: float, h: float) -> Solid:
    """Centred on z, standing on z = 0, without a bottom."""
    x, y = w / 2, d / 2
    v = np.array([[sx * x, sy * y, z] for z in (0, h) for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
    f = [[4, 5, 6], [4, 6, 7]]
    for i in range(4):
        j = (i + 1) % 4
        f += [[i, j, j + 4], [i, j + 4, i + 4]]
    return Solid(v, np.array(f))


def cylinder(radius: float, height: float, n: int = 96, inside: bool = False) -> Solid:
    """A wall without caps; ``inside`` is that of a hole."""
    a = 2 * np.pi * np.arange(n) / n
    ring = np.stack([np.cos(a), np.sin(a), 0 * a], axis=1)
    v = np.concatenate([radius * ring, radius * ring + [0, 0, height]])
    i, j = np.arange(n), (np.arange(n) + 1) % n
    f = np.concatenate([np.stack([i, j, j + n], 1), np.stack([i, j + n, i + n], 1)])
    normals = np.concatenate([ring, ring])
    return Solid(v, f[:, ::-1] if inside else f, -normals if inside else normals)


def disk(radius: float, z: float, n: int = 96) -> Solid:
    a = 2 * np.pi * np.arange(n) / n
    rim = np.stack([radius * np.cos(a), radius * np.sin(a), 0 * a], axis=1)
    v = np.concatenate([rim, np.zeros((1, 3))]) + np.array([0, 0, z])
    f = np.stack([np.arange(n), (np.arange(n) + 1) % n, np.full(n, n)], 1)
    return Solid(v, f, np.tile([0.0, 0.0, 1.0], (n + 1, 1)))


def rod(radius: float, height: float) -> Solid:
    """A closed cylinder without its bottom."""
    return joined(cylinder(radius, height), disk(radius, height))


def ball(radius: float, n: int = 96, m: int = 48) -> Solid:
    theta = np.pi * np.arange(m + 1) / m
    phi = 2 * np.pi * np.arange(n) / n
    t, p = np.meshgrid(theta, phi, indexing="ij")
    N = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], -1).reshape(-1, 3)
    f = []
    for i in range(m):
        for j in range(n):
            a, b, c, d = (i * n + j, (i + 1) * n + j, (i + 1) * n + (j + 1) % n, i * n + (j + 1) % n)
            f += [[a, b, c]] * (i < m - 1) + [[a, c, d]] * (i > 0)
    return Solid(radius * N, np.array(f), N)


def with_hole(w: float, d: float, h: float, radius: float, depth: float, n: int = 96) -> Solid:
    """A box standing on z = 0 with a round pocket in its top, ``depth`` deep."""
    a = 2 * np.pi * np.arange(n) / n
    c, s = np.cos(a), np.sin(a)
    reach = 1 / np.maximum(np.abs(c) / (w / 2), np.abs(s) / (d / 2))
    inner = np.stack([radius * c, radius * s, 0 * a + h], 1)
    outer = np.stack([reach * c, reach * s, 0 * a + h], 1)
    corners = np.array([[w / 2, d / 2, h], [-w / 2, d / 2, h], [-w / 2, -d / 2, h], [w / 2, -d / 2, h]])
    v = np.concatenate([inner, outer, corners])
    i, j = np.arange(n), (np.arange(n) + 1) % n
    f = [np.stack([i, i + n, j + n], 1), np.stack([i, j + n, j], 1)]
    at = np.arctan2(corners[:, 1], corners[:, 0]) % (2 * np.pi)
    for k, angle in enumerate(
        at
    ):  # the triangle between the last ray before a corner and the first behind it
        before = int(np.floor(angle / (2 * np.pi) * n + 1e-9)) % n
        if not np.isclose(angle, a[before]):
            f.append(np.array([[before + n, 2 * n + k, (before + 1) % n + n]]))
    top = Solid(v, np.concatenate(f), np.tile([0.0, 0.0, 1.0], (len(v), 1)))
    sides = box(w, d, h)
    sides = Solid(sides.vertices, sides.faces[2:])
    wall = cylinder(radius, depth, n, inside=True).moved(z=h - depth)
    return joined(top, sides, wall, disk(radius, h - depth, n))
