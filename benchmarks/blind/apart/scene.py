"""Forms that change what is rendered. Who writes the diagnosis does not read this folder."""

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np

from benchmarks.blind.bench import Bench, Matter, Part
from benchmarks.blind.cause import Cause
from benchmarks.blind.errors import turned_eye
from benchmarks.blind.scene_changes import of_lamps, of_matter, of_part


def frame(bench: Bench, c: Cause) -> Bench:
    """The frame that carries all lamps stands a mm off."""
    d = c.amplitude * np.array(c.shape["direction"])
    return of_lamps(bench, "", position=lambda x: tuple(np.array(x.position) + d))


def one_wide(bench: Bench, c: Cause) -> Bench:
    """One lamp has a diffuser that the others have not: a mm more of radius."""
    return of_lamps(bench, c.place, radius=lambda x: x.radius + c.amplitude)


def peak(bench: Bench, c: Cause) -> Bench:
    """A wider or narrower highlight that is as bright at its middle."""
    k = float(np.exp(c.shape["sign"] * c.amplitude))

    def change(m: Matter) -> Matter:
        lobes = tuple((w, C, float(k * n)) for w, C, n in m.lobes)
        return replace(m, lobes=lobes, roughness=float(np.clip(m.roughness * k**-0.25, 0.05, 1)))

    return of_matter(bench, c.place, change)


def tipped(bench: Bench, c: Cause) -> Bench:
    """A chip under one side of a part: a / 60 rad about a line in the table, upwards."""
    body = next(p for p in bench.parts if p.name == c.place)
    axis = np.array([np.cos(c.shape["angle"]), np.sin(c.shape["angle"]), 0.0])
    R = cv2.Rodrigues(c.amplitude / 60 * axis)[0]
    v = body.solid.vertices @ body.pose(0)[:3, :3].T + body.pose(0)[:3, 3]
    across = np.cross(axis, [0.0, 0.0, 1.0])  # R lowers what lies this way, and raises the other side
    foot = v[np.argmax(v @ across)] * [1, 1, 0] + [0, 0, v[:, 2].min()]

    def change(M: np.ndarray) -> np.ndarray:
        out = M.copy()
        out[:3, :3] = R @ M[:3, :3]
        out[:3, 3] = R @ (M[:3, 3] - foot) + foot
        return out

    return of_part(bench, c.place, change)


def swollen(bench: Bench, c: Cause) -> Bench:
    """A part is larger or smaller than drawn in every direction, by the share a, and stands where it stood."""

    def one(p: Part) -> Part:
        if p.name != c.place:
            return p
        v = p.solid.vertices
        foot = np.array([*(v[:, :2].max(axis=0) + v[:, :2].min(axis=0)) / 2, v[:, 2].min()])
        grown = foot + (v - foot) * (1 + c.shape["sign"] * c.amplitude)
        return replace(p, solid=replace(p.solid, vertices=grown))

    return replace(bench, parts=tuple(one(p) for p in bench.parts))


def sagged(bench: Bench, c: Cause) -> Bench:
    """A camera turned by a mrad about a clamp behind and above it, so that it moves as well."""
    k = min(c.shape["eye"], len(bench.eyes) - 1)
    turn = 1e-3 * c.amplitude * np.array(c.shape["turn"])
    arm = np.array(c.shape["arm"])  # mm, from the clamp to the camera, in the camera's frame
    eye = turned_eye(bench.eyes[k], turn, np.cross(arm, turn))  # turned_eye turns the axes
    return replace(bench, eyes=tuple(eye if i == k else e for i, e in enumerate(bench.eyes)))


RENDERED: dict[str, Callable[[Bench, Cause], Bench]] = {
    f"apart {f.__name__}": f for f in (frame, one_wide, peak, tipped, swollen, sagged)
}
