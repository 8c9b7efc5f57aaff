"""The edges of CAD parts: where two faces meet at an angle, a surface ends, materials meet, and silhouettes.

Triangles are welded by the places of their corners, so parts that touch share an edge. A smooth edge is an outline
where one of its faces faces the camera and the other does not.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from interchange.frames import apply
from interchange.mesh import face_normals
from interchange.scene import Body

WELD = 1e-6  # of the parts' size: corners nearer than that are one


@dataclass(frozen=True, eq=False)
class Wireframe:
    """``ends`` (n, 2, 3) world, m; ``normals`` (n, 2, 3) of the two faces, equal on a border; ``sharp`` (n,) bool: an
    edge from everywhere, else an outline at most; ``line`` (n,) int: edges of one straight line have one number."""

    ends: np.ndarray
    normals: np.ndarray
    sharp: np.ndarray
    line: np.ndarray


def wireframe(bodies: Sequence[Body], angle: float = np.radians(30)) -> Wireframe:
    """``angle``, rad: faces that meet at less are one smooth surface. Bodies without faces add nothing."""
    bodies = [b for b in bodies if len(b.mesh.faces)]
    if not bodies:
        none = np.zeros((0, 2, 3))
        return Wireframe(none, none, np.zeros(0, bool), np.zeros(0, int))
    corners = np.concatenate([apply(b.world_from_body, b.mesh.vertices[b.mesh.faces]) for b in bodies])
    materials = {m: k for k, m in enumerate(dict.fromkeys((b.name, b.material.name) for b in bodies))}
    kind = np.concatenate([np.full(len(b.mesh.faces), materials[b.name, b.material.name]) for b in bodies])
    turned = np.concatenate(
        [np.full(len(b.mesh.faces), np.sign(np.linalg.det(b.world_from_body[:3, :3]))) for b in bodies]
    )
    flat = corners.reshape(-1, 3)
    size = float(np.ptp(flat, axis=0).max())
    _, first, vertex = np.unique(
        np.rint((flat - flat.min(0)) / max(size * WELD, 1e-12)).astype(np.int64),
        axis=0,
        return_index=True,
        return_inverse=True,
    )
    place = flat[first]
    faces = vertex.reshape(-1, 3)
    whole = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    faces, kind, turned = faces[whole], kind[whole], turned[whole]
    normals = face_normals(place, faces) * turned[:, None]
    pairs = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    owner = np.tile(np.arange(len(faces)), 3)
    edges, group, count = np.unique(pairs, axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(group, kind="stable")
    starts = np.concatenate([[0], np.cumsum(count)[:-1]])
    one = owner[order[starts]]
    other = owner[order[starts + np.minimum(count - 1, 1)]]
    cosine = np.sum(normals[one] * normals[other], axis=1)
    sharp = (count != 2) | (cosine < np.cos(angle)) | (kind[one] != kind[other])
    flatly = ~sharp & (cosine > 1 - 1e-9)  # inside of a plane
    keep = ~flatly
    ends = place[edges[keep]]
    return Wireframe(
        ends,
        np.stack([normals[one], normals[other]], axis=1)[keep],
        sharp[keep],
        _lines(ends, size),
    )


def _lines(ends: np.ndarray, size: float) -> np.ndarray:
    """Numbers of the straight lines on which the edges lie, by rounded Plücker coordinates."""
    d = ends[:, 1] - ends[:, 0]
    d = d / np.maximum(np.linalg.norm(d, axis=1, keepdims=True), 1e-30)
    lead = np.argmax(np.abs(np.round(d, 4)), axis=1)
    d = d * np.sign(d[np.arange(len(d)), lead])[:, None]
    middle = ends.mean(axis=(0, 1)) if len(ends) else np.zeros(3)
    moment = np.cross(ends[:, 0] - middle, d) / max(size, 1e-30)
    keys = np.concatenate([np.rint(d * 1e3), np.rint(moment * 1e4)], axis=1).astype(np.int64)
    return np.unique(keys, axis=0, return_inverse=True)[1].reshape(-1) if len(keys) else np.zeros(0, int)


def outline(frame: Wireframe, eye: np.ndarray, axis: np.ndarray | None = None) -> np.ndarray:
    """(n,) bool: the edges that are there from ``eye``, or along ``axis`` for a telecentric camera."""
    toward = eye - frame.ends.mean(axis=1) if axis is None else np.broadcast_to(-axis, frame.ends[:, 0].shape)
    side = np.sum(frame.normals * toward[:, None], axis=2) > 0
    return frame.sharp | (side[:, 0] != side[:, 1])


class Wires:
    """Wireframes of the frames of a series, worked out anew only where parts moved against one another."""

    def __init__(self, angle: float) -> None:
        self.angle = angle
        self._known: dict[tuple[int, ...], list[tuple[list[np.ndarray], Wireframe, Sequence[Body]]]] = {}

    def of(self, bodies: Sequence[Body]) -> Wireframe:
        poses = [b.world_from_body for b in bodies]
        known = self._known.setdefault(tuple(id(b.mesh) for b in bodies), [])
        for before, frame, _ in known:
            moves = [new @ np.linalg.inv(old) for new, old in zip(poses, before, strict=True)]
            if _one_rigid(moves):
                return _moved(frame, moves[0]) if moves else frame
        known.append((poses, wireframe(bodies, self.angle), bodies))  # the bodies, so that ids stay theirs
        return known[-1][1]


def _one_rigid(moves: Sequence[np.ndarray]) -> bool:
    if not moves:
        return True
    R = moves[0][:3, :3]
    return bool(np.allclose(R.T @ R, np.eye(3), atol=1e-9)) and all(
        np.allclose(m, moves[0], rtol=0, atol=1e-9) for m in moves
    )


def _moved(frame: Wireframe, by: np.ndarray) -> Wireframe:
    return Wireframe(apply(by, frame.ends), frame.normals @ by[:3, :3].T, frame.sharp, frame.line)
