"""A triangle mesh as every renderer gets it: shared vertices where the surface is smooth, split where it is not."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np


@dataclass(frozen=True, eq=False)
class Mesh:
    """Body frame, metres. Meshes compare by identity: an unchanged one is the same object, so renderers keep it.

    ``vertices`` (V, 3); ``faces`` (F, 3) int32, counter-clockwise from outside; ``normals`` (V, 3) unit;
    ``uv`` (V, 2), v up, or None. A vertex on a hard edge or a texture seam stands there once a side.
    """

    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray
    uv: np.ndarray | None = None

    @cached_property
    def tangents(self) -> np.ndarray:
        """(V, 3) unit, at right angles to the normals: along increasing u, or, without uv (or where uv is
        degenerate), the body's x axis laid onto the surface (its y axis where the normal is along x)."""
        t = np.zeros_like(self.normals)
        if self.uv is not None and len(self.faces):
            p, uv = self.vertices[self.faces], self.uv[self.faces]
            e1, e2 = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
            d1, d2 = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
            det = d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0]
            along_u = (e1 * d2[:, 1:] - e2 * d1[:, 1:]) * np.sign(det)[:, None]
            for k in range(3):
                np.add.at(t, self.faces[:, k], along_u)
            t -= self.normals * np.sum(t * self.normals, axis=1, keepdims=True)
        length = np.linalg.norm(t, axis=1)
        scale = np.linalg.norm(np.ptp(self.vertices, axis=0)) if len(self.vertices) else 1.0
        bare = length <= 1e-12 * max(scale, 1e-30)
        t = np.where(bare[:, None], laid(self.normals), t)
        return t / np.linalg.norm(t, axis=1, keepdims=True)

    @property
    def bounds(self) -> np.ndarray:
        """(2, 3): lowest and highest coordinates."""
        return np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)])


@dataclass(frozen=True, eq=False)
class Grained(Mesh):
    """With tangents along another way: the body's x axis turned by ``angle`` rad about its z axis and laid onto the
    surface; with uv, turned by it about the normals, to the left."""

    angle: float = 0.0

    @cached_property
    def tangents(self) -> np.ndarray:
        if self.uv is None:
            t = laid(self.normals, self.angle)
            return t / np.linalg.norm(t, axis=1, keepdims=True)
        straight = Mesh(self.vertices, self.faces, self.normals, self.uv).tangents
        return np.cos(self.angle) * straight + np.sin(self.angle) * np.cross(self.normals, straight)


def laid(normals: np.ndarray, angle: float = 0.0) -> np.ndarray:
    """(V, 3), not unit: the x axis turned by ``angle`` rad about the z axis, at right angles to ``normals``; where they
    are along it, the y axis turned so."""
    c, s = np.cos(angle), np.sin(angle)
    x, y = np.array([[c, s, 0.0]]), np.array([[-s, c, 0.0]])
    axis = np.where(np.abs(normals @ x[0])[:, None] < 0.9, x, y)
    return np.asarray(axis - normals * np.sum(axis * normals, axis=1, keepdims=True))


def face_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(F, 3) unit normals; z for a face without area."""
    p = vertices[faces]
    n = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    length = np.linalg.norm(n, axis=1, keepdims=True)
    return np.where(length > 0, n / np.where(length > 0, length, 1), [0.0, 0.0, 1.0])


def smooth_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(V, 3) unit normals, the mean of the adjoining faces' weighted by their angles (Thürmer, Wüthrich 1998)."""
    total = np.zeros_like(vertices)
    n = face_normals(vertices, faces)
    for k in range(3):
        a = vertices[faces[:, (k + 1) % 3]] - vertices[faces[:, k]]
        b = vertices[faces[:, (k + 2) % 3]] - vertices[faces[:, k]]
        across = np.linalg.norm(np.cross(a, b), axis=1)
        np.add.at(total, faces[:, k], n * np.arctan2(across, np.sum(a * b, axis=1))[:, None])
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.where(length > 0, total / np.where(length > 0, length, 1), [0.0, 0.0, 1.0])


def from_corners(
    vertices: np.ndarray, faces: np.ndarray, normals: np.ndarray | None = None, uv: np.ndarray | None = None
) -> Mesh:
    """A mesh from per-corner attributes: ``normals`` (F, 3, 3), ``uv`` (F, 3, 2); corners that agree are merged.

    Without normals the faces are flat.
    """
    faces = np.asarray(faces, np.int64)
    if normals is None:
        normals = np.repeat(face_normals(vertices, faces)[:, None], 3, axis=1)
    parts = [faces.reshape(-1, 1).astype(np.float64), np.round(normals.reshape(-1, 3), 7) + 0.0]
    if uv is not None:
        parts.append(np.round(uv.reshape(-1, 2), 9) + 0.0)
    rows = np.ascontiguousarray(np.concatenate(parts, axis=1))
    keys = rows.view(np.dtype((np.void, rows.dtype.itemsize * rows.shape[1]))).ravel()
    _, first, inverse = np.unique(keys, return_index=True, return_inverse=True)
    corner = faces.reshape(-1)[first]
    flat = normals.reshape(-1, 3)[first]
    length = np.linalg.norm(flat, axis=1, keepdims=True)
    flat = np.where(length > 0, flat / np.where(length > 0, length, 1), [0.0, 0.0, 1.0])
    return Mesh(
        vertices=np.asarray(vertices, np.float64)[corner],
        faces=inverse.reshape(-1, 3).astype(np.int32),
        normals=flat,
        uv=None if uv is None else uv.reshape(-1, 2)[first],
    )
