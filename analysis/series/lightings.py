"""The lamps of an illumination series, one step after the other: the reflector device, a dome, a ring, distant light.

A step is what the renderer draws (one or more ``Light``) and what the analysis is told: from where it comes and how
strong it is where it meets the object.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from interchange.lamps.placing import aimed
from interchange.lamps.reflector import ReflectorDevice
from interchange.light import Light, LightKind
from interchange.problems import BrightfieldError


@dataclass(frozen=True, eq=False)
class Lighting:
    """One step. ``direction`` (3,): unit, world, to a distant lamp; or ``position`` (3,) m of a near one.

    ``strength``: irradiance of a surface that faces a distant lamp, W/m²; intensity of a near one, W/sr.
    """

    lights: tuple[Light, ...]
    strength: float
    direction: np.ndarray | None = None
    position: np.ndarray | None = None

    def __post_init__(self) -> None:
        if (self.direction is None) == (self.position is None):
            raise BrightfieldError("A lighting must have a direction or a position, and not both.")


def hemisphere(polar: Sequence[float] | np.ndarray, azimuths: int) -> np.ndarray:
    """(polar · azimuths, 2) φ and θ, rad: ``azimuths`` equidistant directions on every circle of ``polar`` rad."""
    phi = 2 * np.pi * np.arange(azimuths) / azimuths
    return np.stack([np.tile(phi, len(polar)), np.repeat(np.asarray(polar, float), azimuths)], axis=-1)


def unit(angles: np.ndarray) -> np.ndarray:
    """(..., 3) unit vectors of (..., 2) φ and θ, rad, θ from z."""
    phi, theta = np.moveaxis(np.asarray(angles, np.float64), -1, 0)
    sine = np.sin(theta)
    return np.stack([sine * np.cos(phi), sine * np.sin(phi), np.cos(theta)], axis=-1)


def reflector(device: ReflectorDevice, azimuths: int = 24, polar: int = 6, rings: int = 0) -> list[Lighting]:
    """The parabolic reflector's spot stepped round its axis: 24 x 6 directions by default.

    ``rings`` 0 draws a spot as one lamp, 1 as seven, each mirrored at its own place; 0 spreads the spot's light a
    little, so that the middle gets 2 % less, which ``strength`` knows.
    """
    lobe = device.lobe()
    # of a lamp that is aimed as a whole, its rim misses the focus: the mean of the lobe's fall-off over its disk
    share = (np.arange(64) + 0.5) / 64
    radius = device.spot_radius / np.sqrt(1 + 3 * rings * (rings + 1)) * np.sqrt(share)
    return [
        Lighting(
            device.lights(phi, theta, rings, lobe=lobe),
            float(device.irradiance(theta, radius).mean()),
            direction=device.direction(phi, theta),
        )
        for phi, theta in device.steps(azimuths, polar)
    ]


def distant(angles: np.ndarray, irradiance: float = np.pi) -> list[Lighting]:
    """Light from far away, one direction (φ, θ) a step, without extent: the ideal of the device."""
    steps = []
    for k, w in enumerate(unit(angles)):
        lamp = Light(f"/lamp{k}", LightKind.DISTANT, (irradiance,) * 3, aimed(w, np.zeros(3)))
        steps.append(Lighting((lamp,), irradiance, direction=w))
    return steps


def dome(
    angles: np.ndarray,
    radius: float,
    intensity: float = 1.0,
    lamp_radius: float = 2.5e-3,
    at: np.ndarray | None = None,
) -> list[Lighting]:
    """Small round lamps ``radius`` m from ``at`` (3,), default the origin, in the directions (φ, θ), one on at a step:
    a dome of LEDs, or, with one θ, a ring."""
    middle = np.zeros(3) if at is None else np.asarray(at, np.float64)
    steps = []
    for k, w in enumerate(unit(angles)):
        place = middle + radius * w
        lamp = Light(
            f"/lamp{k}", LightKind.SPHERE, (intensity,) * 3, aimed(place, middle), radius=lamp_radius
        )
        steps.append(Lighting((lamp,), intensity, position=place))
    return steps
