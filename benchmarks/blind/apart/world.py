"""The scene as it really stands, which is rendered so. Who writes the diagnosis does not read this folder."""

from dataclasses import replace

import cv2
import numpy as np

from benchmarks.blind.apart.budget import Budget
from benchmarks.blind.bench import Bench, Eye, Lamp, Matter, Part
from benchmarks.blind.errors import Tolerances, sheets


def disturbed(bench: Bench, t: Tolerances, rng: np.random.Generator) -> Bench:
    b = Budget(rng)
    return replace(
        bench,
        lamps=_lamps(bench.lamps, b, t.light_position_mm),
        parts=_parts(bench.parts, sheets(bench), b, t.object_pose_mm),
        matters=_matters(bench.matters, b, t.gloss),
        eyes=tuple(_eye(e, b, t.registration_px, bench.size[0]) for e in bench.eyes),
    )


def _lamps(lamps: tuple[Lamp, ...], b: Budget, tolerance: float) -> tuple[Lamp, ...]:
    """On one frame, that was measured as a whole, and each by itself."""
    p = np.array([x.position for x in lamps])
    shifted = b.normal(3) * np.ones_like(p)
    reach = float(np.abs(p).max())
    turned = np.cross(b.normal(3), p) / reach
    wider = float(b.normal()) * p / reach * 1.5
    p = p + b.mixed(tolerance, [shifted, turned, wider, b.normal(*p.shape)])
    return tuple(replace(x, position=tuple(map(float, q))) for x, q in zip(lamps, p, strict=True))


def _parts(parts: tuple[Part, ...], sheet: list[int], b: Budget, tolerance: float) -> tuple[Part, ...]:
    """Each lies a little turned and shifted, on a table that grew; what is laid again lies otherwise again. The first
    is the table, which everything is measured from; what lies in several poses is one body, and so is a ``sheet``."""
    grown = float(b.normal()) * 0.5 * tolerance / 150
    poses = max(len(p.poses) for p in parts)
    body = [_laid(np.zeros(3), 60.0, b, tolerance) for _ in range(poses)]
    out, moves = [], {0: np.eye(4)}
    for k, p in enumerate(parts):
        v = p.solid.vertices @ p.pose(0)[:3, :3].T + p.pose(0)[:3, 3]
        middle = (v.max(axis=0) + v.min(axis=0)) / 2
        if len(p.poses) > 1:
            p = replace(p, poses=tuple(T @ M for T, M in zip(body, p.poses, strict=True)))
        elif k:
            T = _laid(middle, float(np.hypot(*(v - middle).T[:2]).max()), b, tolerance)
            T[:2, 3] += grown * middle[:2]
            moves[k] = T
            p = replace(p, poses=(moves[sheet[k]] @ p.pose(0),))
        out.append(p)
    return tuple(out)


def _laid(middle: np.ndarray, reach: float, b: Budget, tolerance: float) -> np.ndarray:
    """(4, 4): shifted, and turned about its middle; ``reach`` mm from there its rim goes as far."""
    share = 0.85 * tolerance * b.shares(2)
    shift, angle = share[0] * b.normal(2), float(share[1] * b.normal()) / max(reach, 1.0)
    R = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    T = np.eye(4)
    T[:2, :2] = R
    T[:2, 3] = middle[:2] - R @ middle[:2] + shift
    return T


def _matters(matters: tuple[Matter, ...], b: Budget, tolerance: float) -> tuple[Matter, ...]:
    """One gloss meter for all; a wrong width or a wrong height gives it the same reading."""
    one = np.ones((len(matters), 2))
    e = b.mixed(tolerance, [b.normal() * one, b.normal(len(matters), 1) * one, b.normal(len(matters), 2)])
    return tuple(
        replace(
            m,
            lobes=tuple(
                (tuple(np.array(w) * np.exp(e[k, 1] / 2)), C, float(n * np.exp(e[k, 0])))
                for w, C, n in m.lobes
            ),
            roughness=float(m.roughness * np.exp(e[k, 0] / 2)),
        )
        for k, m in enumerate(matters)
    )


def _eye(eye: Eye, b: Budget, tolerance: float, width: int) -> Eye:
    """A calibration trades place against direction: the middle of the scene stays where it is, what is nearer or
    farther by a tenth goes a third of the tolerance astray."""
    back, distance = np.array(eye.rotation[2]), float(np.linalg.norm(eye.position))
    px = distance / (eye.focal * width)  # mm in the middle of the scene
    shift = 2 * tolerance * px * b.normal(3) @ np.array(eye.rotation)
    shift -= back * (back @ shift)
    position = np.array(eye.position) + shift
    aimed = position - (np.array(eye.position) - distance * back)
    aimed /= np.linalg.norm(aimed)
    R = cv2.Rodrigues(np.cross(back, aimed))[0]  # so small that sine and angle are alike
    rotation = np.array(eye.rotation) @ R.T
    return replace(
        eye, position=tuple(map(float, position)), rotation=tuple(tuple(map(float, r)) for r in rotation)
    )
