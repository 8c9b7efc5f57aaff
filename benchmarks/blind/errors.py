"""Calibration errors that every case has, nulls too, within what captures.json declares.

``CalibrationErrors`` is what the truth asks of either way of drawing them; ``Errors`` is the first way.
"""

from dataclasses import asdict, dataclass, replace
from typing import Protocol

import cv2
import numpy as np

from benchmarks.blind.bench import Bench, Eye, Part, Shot


@dataclass(frozen=True)
class Tolerances:
    """As captures.json says them, one standard deviation each."""

    registration_px: float = 0.05
    light_intensity: float = 0.005
    light_position_mm: float = 0.4
    flat_field: float = 0.003
    black_level_dn: float = 1.0
    albedo: float = 0.005
    gloss: float = 0.02
    object_pose_mm: float = 0.05

    def as_dict(self) -> dict[str, float]:
        return asdict(self)


SHARE = 0.7  # of a declared deviation that is drawn: the scene's own errors and a case's come together


def drawn(rng: np.random.Generator, deviation: float, shape: object = None) -> np.ndarray:
    """Normal, cut at two deviations."""
    return deviation * np.clip(rng.standard_normal(shape), -2, 2)  # type: ignore[call-overload]


def disturbed(bench: Bench, t: Tolerances, rng: np.random.Generator) -> Bench:
    """The scene as it really stands: lamps, cameras, parts and gloss a little off their places, rendered so."""
    sheet = sheets(bench)
    lamps = tuple(
        replace(x, position=tuple(np.array(x.position) + drawn(rng, SHARE * t.light_position_mm, 3)))
        for x in bench.lamps
    )
    parts = []
    together = drawn(rng, SHARE * t.object_pose_mm, 2)
    moves: list[np.ndarray] = []
    for k, part in enumerate(bench.parts):
        moves.append(drawn(rng, SHARE * t.object_pose_mm, 2))
        poses = []
        for pose in part.poses:
            moved = pose.copy()
            if len(part.poses) > 1:  # the parts of one body go together
                moved[:2, 3] += together
            elif k:  # the first is the table, which everything is measured from
                moved[:2, 3] += moves[sheet[k]]
            poses.append(moved)
        parts.append(replace(part, poses=tuple(poses)))
    matters = tuple(
        replace(
            m,
            lobes=tuple((w, C, float(n * np.exp(drawn(rng, SHARE * t.gloss)))) for w, C, n in m.lobes),
            roughness=float(m.roughness * np.exp(drawn(rng, SHARE * t.gloss / 2))),
        )
        for m in bench.matters
    )
    eyes = tuple(_disturbed_eye(e, bench.size[0], t, rng) for e in bench.eyes)
    return replace(bench, lamps=lamps, parts=tuple(parts), matters=matters, eyes=eyes)


def sheets(bench: Bench) -> list[int]:
    """Of each part the first one that it shares a sheet with, itself where it is alone: flat parts whose corners
    coincide are one print, and no error opens gaps in it."""
    found: list[int] = []
    for k, part in enumerate(bench.parts):
        own = _corners(part)
        found.append(next((found[i] for i in range(k) if own & _corners(bench.parts[i])), k))
    return found


def _corners(part: Part) -> set[tuple[float, ...]]:
    """Of a flat part that never moves, in µm; none of any other."""
    points = part.solid.vertices
    if len(part.poses) > 1 or np.ptp(points[:, 2]) > 1e-6:
        return set()
    there = points @ part.poses[0][:3, :3].T + part.poses[0][:3, 3]
    return {tuple(p) for p in np.round(1e3 * there, 3)}


def _disturbed_eye(eye: Eye, width: int, t: Tolerances, rng: np.random.Generator) -> Eye:
    one_px = 1 / (eye.focal * width)  # rad
    turn = drawn(rng, 0.5 * SHARE * t.registration_px * one_px, 3)
    shift = drawn(rng, 0.02, 3)  # mm: 0.02 px at this distance
    return turned_eye(eye, turn, shift)


def turned_eye(eye: Eye, turn: np.ndarray, shift: np.ndarray) -> Eye:
    """Turned about its own axes by ``turn`` rad and moved by ``shift`` mm along them."""
    R = np.array(eye.rotation)  # rows right, up, back
    rotation = cv2.Rodrigues(np.asarray(turn, float))[0] @ R
    position = np.array(eye.position) + shift @ R
    return replace(eye, position=tuple(position), rotation=tuple(tuple(map(float, r)) for r in rotation))


class CalibrationErrors(Protocol):
    """Of one case. ``moment``: images of one camera at one moment lie alike on its sensor."""

    def moment(self, shot: Shot) -> int: ...

    def moves(self, eye: int, moment: int) -> bool: ...

    def moved(
        self, eye: int, moment: int, x: np.ndarray, y: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]: ...  # px from the middle: where the scene's image is looked up

    def lamp(self, k: int, shot: Shot) -> np.ndarray: ...  # (3,) gain

    def reflectance(self, bench: Bench, where: dict[str, np.ndarray]) -> np.ndarray: ...  # (h, w, 3) gain

    def field(self, shot: Shot) -> np.ndarray: ...  # gain over the sensor

    def pixel_gain(self, shot: Shot, repeat: int) -> np.ndarray: ...  # (h, w, 3)

    def offset(self, shot: Shot, repeat: int) -> np.ndarray | float: ...  # DN


@dataclass(frozen=True, eq=False)
class Errors:
    """Of one case. ``registration`` {eye: (2, 3) affine px}, ``flat`` {eye: (h, w)}, ``lamps`` (n,),
    ``albedo`` {matter: (3,)}, ``black`` DN {eye}, ``pixels`` {eye: (h, w, 3)} gain of each pixel."""

    registration: dict[int, np.ndarray]
    flat: dict[int, np.ndarray]
    lamps: np.ndarray
    albedo: dict[str, np.ndarray]
    black: dict[int, float]
    pixels: dict[int, np.ndarray]

    def moment(self, shot: Shot) -> int:
        return 0

    def moves(self, eye: int, moment: int) -> bool:
        return bool(self.registration[eye].any())

    def moved(self, eye: int, moment: int, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        affine = self.registration[eye]
        return (
            x + affine[0, 0] * x + affine[0, 1] * y + affine[0, 2],
            y + affine[1, 0] * x + affine[1, 1] * y + affine[1, 2],
        )

    def lamp(self, k: int, shot: Shot) -> np.ndarray:
        return self.lamps[k] * np.ones(3)

    def reflectance(self, bench: Bench, where: dict[str, np.ndarray]) -> np.ndarray:
        gain = np.ones((len(bench.parts) + 1, 3), np.float32)
        for k, part in enumerate(bench.parts):
            if part.matter in self.albedo:
                gain[k] = self.albedo[part.matter]
        return gain[where["part"]]  # -1 is the last: nothing there

    def field(self, shot: Shot) -> np.ndarray:
        return self.flat[shot.eye][..., None]

    def pixel_gain(self, shot: Shot, repeat: int) -> np.ndarray:
        return self.pixels[shot.eye]

    def offset(self, shot: Shot, repeat: int) -> np.ndarray | float:
        return self.black[shot.eye]


def draw(bench: Bench, t: Tolerances, rng: np.random.Generator, scale: float = 1.0) -> Errors:
    """``scale`` above 1: more than is declared."""
    w, h = bench.size
    k = SHARE * scale
    registration, flat, black, pixels = {}, {}, {}, {}
    for e in range(len(bench.eyes)):
        affine = np.zeros((2, 3))
        affine[:, 2] = drawn(rng, 0.8 * k * t.registration_px, 2)
        affine[:, :2] = drawn(rng, 0.5 * k * t.registration_px / (w / 2), (2, 2))
        registration[e] = affine
        flat[e] = 1 + k * t.flat_field * smooth_field(rng, (h, w))
        black[e] = float(drawn(rng, k * t.black_level_dn))
        pixels[e] = 1 + bench.sensor.prnu * rng.standard_normal((h, w, 3))
    lamps = 1 + drawn(rng, k * t.light_intensity, len(bench.lamps))
    albedo = {
        m.name: 1 + drawn(rng, 0.8 * k * t.albedo) + drawn(rng, 0.5 * k * t.albedo, 3) for m in bench.matters
    }
    return Errors(registration, flat, lamps, albedo, black, pixels)


def smooth_field(rng: np.random.Generator, shape: tuple[int, int], order: int = 3) -> np.ndarray:
    """(h, w) of mean 0 and rms 1: a polynomial of low order."""
    y, x = np.meshgrid(*(np.linspace(-1, 1, n) for n in shape), indexing="ij")
    out = sum(
        rng.standard_normal() * x**i * y**j for i in range(order + 1) for j in range(order + 1 - i) if i + j
    )
    out = np.asarray(out) - np.mean(out)
    return out / out.std()
