"""Lamps as the shader takes them: one record for each point of a lamp from which a pass is lit.

Records are rows of vec4, see shaders/lights.glsl. ``power`` is such that the mean over a lamp's points is the lamp.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from interchange.light import Light, LightKind, latlong_direction, rect_uv
from interchange.material import Texture, evaluate_texture
from realtime import sampling

POWER = 1  # row of a record: rgb
CONE = 5
SHADOW = 7
REFERENCE = 8
MAPS = 9  # the first row of the shadow maps' matrices
DOME_POINTS = 4  # directions of a dome for each point of another lamp


@dataclass(frozen=True, eq=False)
class Sample:
    """One point of a lamp. ``place`` (3,): where its shadow is seen from, None for parallel light (then
    ``direction`` is the way that the light travels)."""

    light: Light
    mode: str
    record: np.ndarray  # (MAPS, 4)
    place: np.ndarray | None
    direction: np.ndarray


def rows(mode: str, shaped: bool, focused: bool, beam: str, faces: int) -> tuple[int, ...]:
    """The rows that the shader reads of a record with ``faces`` shadow maps; those that it finds by the face left
    out."""
    found = {0, POWER}
    found |= {"SPHERE": {2, 3, 4}, "PLANAR": {4}, "CYLINDER": {2}}.get(mode, set())
    found |= {2, 3, 4} if beam else {4} if shaped else set()
    found |= {6} if focused else set()
    if shaped and (beam or focused or faces != 1):
        found.add(CONE)
    if faces:
        found.add(SHADOW)
    if faces == 1:
        found |= {MAPS + i for i in (0, 1, 4, 5)} | ({REFERENCE} if mode == "SPHERE" else set())
        found.add(MAPS + (2 if mode == "DIRECTION" else 3))
        found |= set() if mode in ("POINT", "PLANAR") else {MAPS + 6}
    return tuple(sorted(found))


def is_extended(light: Light) -> bool:
    """Whether the lamp has more than one point (a line has, too)."""
    match light.kind:
        case LightKind.SPHERE | LightKind.DISK:
            return light.radius > 0
        case LightKind.RECT:
            return light.width > 0 or light.height > 0
        case LightKind.CYLINDER:
            return light.radius > 0 or light.length > 0
        case LightKind.DISTANT:
            return light.angle > 0
        case LightKind.DOME:
            return True


def is_shaped(light: Light) -> bool:
    return light.cone_angle < np.pi or light.cone_softness > 0 or light.focus != 0 or light.beam is not None


def beam(light: Light) -> str:
    """What the shader calls the way in which a lamp's emission depends on direction; none for a plain one."""
    return "PROJECTED" if light.projector is not None else "PROFILED" if light.profile is not None else ""


def samples(light: Light, index: int, rounds: int, origin: np.ndarray) -> list[list[Sample]]:
    """The lamp's points for each of ``rounds`` rounds. ``index`` sets its points apart from the other lamps'."""
    if not is_extended(light):
        rounds = 1
    each = DOME_POINTS if light.kind is LightKind.DOME else 1
    round_one = light.kind in (LightKind.SPHERE, LightKind.DISK, LightKind.DISTANT)
    net = (sampling.disk if round_one else sampling.square)(rounds * each)
    net = sampling.shuffled(net, index + 1)
    pose = light.world_from_light
    R, t = pose[:3, :3], pose[:3, 3] - origin
    found = [_sample(light, R, t, u) for u in net]
    return [found[i * each : (i + 1) * each] for i in range(rounds)]


def _sample(light: Light, R: np.ndarray, t: np.ndarray, u: np.ndarray) -> Sample:
    """``u`` (2,): on the unit disk for a round lamp, in the unit square for another."""
    record = np.zeros((MAPS, 4))
    record[0, :3], record[0, 3] = t, light.radius
    record[POWER, :3] = light.intensity
    record[2:5, :3] = R.T
    record[5] = (
        (1 - light.cone_softness) * light.cone_angle,
        light.cone_angle,
        light.focus,
        light.profile_angle_scale,
    )
    record[6, :3] = light.focus_tint
    place: np.ndarray | None = t
    direction = -R[:, 2]
    match light.kind:
        case LightKind.SPHERE:
            mode = "SPHERE" if light.radius > 0 else "POINT"
            record[2, 3], record[3, 3], record[4, 3] = u @ u, 1.0, np.arctan2(u[1], u[0])
        case LightKind.DISK:
            mode = "PLANAR"
            place = t + R[:, :2] @ (light.radius * u)
            record[0, :3] = place
        case LightKind.RECT:
            mode = "PLANAR"
            x, y = (u - 0.5) * (light.width, light.height)
            place = t + R[:, :2] @ [x, y]
            record[0, :3] = place
            if light.texture is not None:
                record[POWER, :3] *= _rgb(
                    light.texture, rect_uv(x, y, light.width or 1.0, light.height or 1.0)
                )
        case LightKind.CYLINDER:
            mode = "CYLINDER"
            place = t + R[:, 0] * ((u[0] - 0.5) * light.length)
            record[0, :3], record[2, 3] = place, 2 * u[1] - 1
        case LightKind.DISTANT:
            mode, place = "DIRECTION", None
            sine = np.sin(min(light.angle, np.pi) / 2) * u
            towards = np.array([*sine, np.sqrt(max(1 - sine @ sine, 1e-6))])
            record[POWER, :3] /= towards[2]
            record[0, :3] = R @ towards
            direction = -record[0, :3]
        case LightKind.DOME:
            mode, place = "DIRECTION", None
            uv, per_area = (u, 1.0) if light.texture is None else _important(light.texture, u)
            if light.texture is not None:
                ring = 2 * np.pi**2 * np.sin(np.pi * (1 - uv[1]))  # sr a unit of the map's area
                record[POWER, :3] *= _rgb(light.texture, uv) * ring / per_area
                towards = latlong_direction(uv)
            elif light.cone_angle < np.pi:
                gap = 1 - np.cos(light.cone_angle)
                cosine, around = 1 - gap * u[1], 2 * np.pi * u[0]
                sine = np.sqrt(1 - cosine * cosine)
                towards = np.array([sine * np.cos(around), sine * np.sin(around), cosine])
                record[POWER, :3] *= 2 * np.pi * gap
            else:
                towards = latlong_direction(np.array([u[0], 1 - np.arccos(1 - 2 * u[1]) / np.pi]))
                record[POWER, :3] *= 4 * np.pi
            record[POWER, :3] /= DOME_POINTS
            record[0, :3] = R @ towards
            direction = -record[0, :3]
    return Sample(light, mode, record, place, direction)


def shadow_place(sample: Sample, axis: np.ndarray) -> np.ndarray:
    """The point of a lamp with an extent in depth that the surfaces along ``axis`` (3,) are lit from."""
    assert sample.place is not None
    record, light = sample.record, sample.light
    if sample.mode == "SPHERE":
        e1, e2 = _basis(-axis)
        r = light.radius * np.sqrt(record[2, 3])
        return sample.place + r * (np.cos(record[4, 3]) * e1 + np.sin(record[4, 3]) * e2)
    if sample.mode == "CYLINDER":
        across = np.cross(record[2, :3], axis)
        length = np.linalg.norm(across)
        return (
            sample.place + (light.radius * record[2, 3] / length) * across if length > 1e-9 else sample.place
        )
    return sample.place


def _basis(n: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """shaders/common.glsl: basis."""
    s = 1.0 if n[2] >= 0 else -1.0
    a = -1 / (s + n[2])
    b = n[0] * n[1] * a
    return np.array([1 + s * n[0] ** 2 * a, s * b, -s * n[0]]), np.array([b, s + n[1] ** 2 * a, -n[1]])


def _rgb(texture: Texture, uv: np.ndarray) -> np.ndarray:
    return np.broadcast_to(evaluate_texture(texture, uv), (3,))


@lru_cache(maxsize=8)
def _cumulative(texture: Texture) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(h, w) density over the map, a quarter of it even over the sphere; its cumulative sums by row and column."""
    h = texture.pixels.shape[0]
    ring = np.sin(np.pi * (np.arange(h) + 0.5) / h)[:, None]
    light = texture.pixels.mean(axis=2).astype(np.float64)
    # bilinear interpolation carries light into the neighbours
    light = sum(
        np.roll(np.pad(light, ((1, 1), (0, 0)), "edge"), (i, j), (0, 1))[1:-1]
        for i in (-1, 0, 1)
        for j in (-1, 0, 1)
    )
    light = light * ring
    even = np.broadcast_to(ring, light.shape)
    density = 0.75 * light / max(light.sum(), 1e-300) + 0.25 * even / even.sum()
    density /= density.sum()
    rows = np.cumsum(density.sum(axis=1))
    columns = np.cumsum(density, axis=1) / density.sum(axis=1, keepdims=True)
    return density, rows, columns


def _important(texture: Texture, u: np.ndarray) -> tuple[np.ndarray, float]:
    """A spot of a dome's map, bright ones more often, and the density there per unit of the map's area."""
    density, rows, columns = _cumulative(texture)
    h, w = density.shape
    i = min(int(np.searchsorted(rows, u[1] * rows[-1])), h - 1)
    j = min(int(np.searchsorted(columns[i], u[0])), w - 1)
    row_low, column_low = rows[i - 1] if i else 0.0, columns[i, j - 1] if j else 0.0
    fy = (u[1] * rows[-1] - row_low) / max(rows[i] - row_low, 1e-300)
    fx = (u[0] - column_low) / max(columns[i, j] - column_low, 1e-300)
    st = np.array([(j + min(fx, 1.0)) / w, 1 - (i + min(fy, 1.0)) / h])
    return st, float(density[i, j] * h * w)
