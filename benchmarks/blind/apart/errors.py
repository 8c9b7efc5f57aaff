"""Calibration errors of a case, within what captures.json declares. Who writes the diagnosis does not read this folder.

The interface is that of ``errors.CalibrationErrors``.
"""

from dataclasses import dataclass

import numpy as np

from benchmarks.blind.apart.budget import Budget
from benchmarks.blind.apart.light_errors import Reflectances, frames, lamps, reflectances
from benchmarks.blind.apart.registration import Registration, registration
from benchmarks.blind.apart.sensor_errors import black, flat, pixels
from benchmarks.blind.bench import Bench, Shot
from benchmarks.blind.errors import Tolerances


@dataclass(frozen=True, eq=False)
class ApartErrors:
    """By camera, or by shot as the series took them."""

    shots: dict[Shot, int]
    places: tuple[Registration, ...]
    lamps: np.ndarray
    frames: np.ndarray
    surfaces: Reflectances
    flats: tuple[np.ndarray, ...]
    pixels: tuple[np.ndarray, ...]
    blacks: tuple[np.ndarray, ...]

    def moment(self, shot: Shot) -> int:
        return self.shots[shot] if self.places[shot.eye].drift.any() else 0

    def moves(self, eye: int, moment: int) -> bool:
        return True

    def moved(self, eye: int, moment: int, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        dx, dy = self.places[eye](moment, x, y)
        return x + dx, y + dy

    def lamp(self, k: int, shot: Shot) -> np.ndarray:
        return self.lamps[self.shots[shot], k]

    def reflectance(self, bench: Bench, where: dict[str, np.ndarray]) -> np.ndarray:
        return self.surfaces(bench, where)

    def field(self, shot: Shot) -> np.ndarray:
        return self.flats[shot.eye]

    def pixel_gain(self, shot: Shot, repeat: int) -> np.ndarray:
        return self.frames[self.shots[shot], repeat] * self.pixels[shot.eye]

    def offset(self, shot: Shot, repeat: int) -> np.ndarray | float:
        return self.blacks[shot.eye][self.shots[shot], repeat][:, None, :]


def draw(bench: Bench, t: Tolerances, rng: np.random.Generator, scale: float = 1.0) -> ApartErrors:
    b = Budget(rng, scale)
    taken = np.cumsum([0, *(s.repeats for s in bench.shots)])[:-1]
    times = taken / max(taken[-1], 1)
    eyes = range(len(bench.eyes))
    return ApartErrors(
        {s: k for k, s in enumerate(bench.shots)},
        tuple(registration(b, 0.95 * t.registration_px, bench.size, times) for _ in eyes),
        lamps(b, t.light_intensity, bench.shots, len(bench.lamps), times),
        frames(b, t.light_intensity, bench.shots),
        reflectances(b, t.albedo, bench),
        tuple(flat(b, t.flat_field, bench.size) for _ in eyes),
        tuple(pixels(rng, bench.sensor.prnu, bench.size) for _ in eyes),
        tuple(black(b, t.black_level_dn, bench.shots, times, bench.size[1]) for _ in eyes),
    )
