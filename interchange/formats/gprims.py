"""USD's geometric primitives as meshes: boxes, and surfaces that a profile sweeps round an axis."""

import numpy as np
from pxr import Usd, UsdGeom

from interchange.mesh import Mesh, from_corners

SEGMENTS = 96  # round an axis: a radius differs from its chord's middle by 5e-4

AXES = {
    "X": np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]),
    "Y": np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]]),
    "Z": np.eye(3),
}


def read_gprim(prim: Usd.Prim, time: Usd.TimeCode) -> Mesh | None:
    """The mesh of a Cube, Sphere, Cylinder, Cone, Capsule or Plane in the prim's units; None for other types."""

    def get(name: str) -> float:
        return float(prim.GetAttribute(name).Get(time))

    axis = str(prim.GetAttribute("axis").Get(time)) if prim.GetAttribute("axis") else "Z"
    if prim.IsA(UsdGeom.Cube):
        return box(get("size"))
    if prim.IsA(UsdGeom.Plane):
        return turned(plane(get("width"), get("length")), axis)
    if prim.IsA(UsdGeom.Sphere):
        return sphere(get("radius"))
    if prim.IsA(UsdGeom.Cylinder):
        r, h = get("radius"), get("height") / 2
        return turned(revolve([line((0, -h), (r, -h)), line((r, -h), (r, h)), line((r, h), (0, h))]), axis)
    if prim.IsA(UsdGeom.Cone):
        r, h = get("radius"), get("height") / 2
        return turned(revolve([line((0, -h), (r, -h)), line((r, -h), (0, h))]), axis)
    if prim.IsA(UsdGeom.Capsule):
        r, h = get("radius"), get("height") / 2
        pieces = [arc(r, -h, -np.pi / 2, 0.0), line((r, -h), (r, h)), arc(r, h, 0.0, np.pi / 2)]
        return turned(revolve(pieces), axis)
    return None


Profile = tuple[np.ndarray, np.ndarray]  # (K, 2) points (r, z) and (K, 2) outward normals


def line(a: tuple[float, float], b: tuple[float, float]) -> Profile:
    d = np.subtract(b, a)
    n = np.array([d[1], -d[0]]) / (np.hypot(*d) or 1.0)
    return np.array([a, b], np.float64), np.array([n, n])


def arc(radius: float, z: float, start: float, end: float, segments: int = SEGMENTS) -> Profile:
    """Of a circle of so many ``segments``; angles rad from r towards z."""
    t = np.linspace(start, end, max(2, round(segments / 2 * (end - start) / np.pi) + 1))
    n = np.stack([np.cos(t), np.sin(t)], axis=1)
    points = radius * n + [0, z]
    points[np.abs(points[:, 0]) < 1e-12 * max(radius, 1e-30), 0] = 0.0
    return points, n


def sphere(radius: float, segments: int = SEGMENTS) -> Mesh:
    """About the origin, its poles on z; ``segments`` round the equator."""
    return revolve([arc(radius, 0.0, -np.pi / 2, np.pi / 2, segments)], segments)


def revolve(pieces: list[Profile], segments: int = SEGMENTS) -> Mesh:
    """The surface that pieces of a profile sweep round z; each piece is smooth in itself, hard towards the next."""
    phi = np.linspace(0, 2 * np.pi, segments + 1)
    vertices: list[np.ndarray] = []
    normals: list[np.ndarray] = []
    uvs: list[np.ndarray] = []
    faces: list[np.ndarray] = []
    base = 0
    total = sum(np.linalg.norm(np.diff(p, axis=0), axis=1).sum() for p, _ in pieces) or 1.0
    done = 0.0
    for points, normal in pieces:
        along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        k, s = len(points), segments + 1
        cos, sin = np.cos(phi)[None], np.sin(phi)[None]
        for values, target in ((points, vertices), (normal, normals)):
            r, z = values[:, :1], values[:, 1:]
            target.append(np.stack([r * cos, r * sin, z + 0 * cos], axis=-1).reshape(-1, 3))
        u, v = np.broadcast_arrays(phi[None] / (2 * np.pi), ((done + along) / total)[:, None])
        uvs.append(np.stack([u, v], axis=-1).reshape(-1, 2))
        i, j = np.meshgrid(np.arange(k - 1), np.arange(s - 1), indexing="ij")
        a = base + i * s + j
        if_low, if_high = points[:-1, 0] > 0, points[1:, 0] > 0  # no triangles without area at the poles
        faces.append(np.stack([a, a + 1, a + s + 1], axis=-1)[if_low].reshape(-1, 3))
        faces.append(np.stack([a, a + s + 1, a + s], axis=-1)[if_high].reshape(-1, 3))
        base, done = base + k * s, done + along[-1]
    return Mesh(
        np.concatenate(vertices),
        np.concatenate(faces).astype(np.int32),
        np.concatenate(normals),
        np.concatenate(uvs),
    )


def box(size: float) -> Mesh:
    corner = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * size / 2
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    square = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    uv = np.concatenate([np.repeat(square[None, [0, 1, 2]], 6, 0), np.repeat(square[None, [0, 2, 3]], 6, 0)])
    return from_corners(corner, faces, uv=uv)


def plane(width: float, length: float) -> Mesh:
    x, y = width / 2, length / 2
    vertices = np.array([[-x, -y, 0], [x, -y, 0], [x, y, 0], [-x, y, 0]], np.float64)
    uv = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    return Mesh(vertices, np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.tile([0.0, 0, 1], (4, 1)), uv)


def turned(mesh: Mesh, axis: str) -> Mesh:
    """A mesh about z brought to another axis (cyclic, so that nothing is mirrored)."""
    m = AXES[axis]
    return mesh if axis == "Z" else Mesh(mesh.vertices @ m.T, mesh.faces, mesh.normals @ m.T, mesh.uv)
