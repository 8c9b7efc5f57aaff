"""How a device's parts are placed, and how its power is shared out among them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from interchange.light import Light
from interchange.power import emitted_power, intensity_from_power
from interchange.problems import BrightfieldError

Color = tuple[float, float, float]
WHITE = (1.0, 1.0, 1.0)
HERE = np.eye(4)


def aimed(place: np.ndarray, target: np.ndarray) -> np.ndarray:
    """``world_from_light`` (4, 4) of a lamp at ``place`` (3,) that shines along -z at ``target`` (3,)."""
    pose = np.eye(4)
    z = np.asarray(place, np.float64) - target
    z = z / np.linalg.norm(z)
    helper = np.eye(3)[1 if abs(z[1]) < 0.9 else 0]
    x = np.cross(helper, z)
    x /= np.linalg.norm(x)
    pose[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    pose[:3, 3] = place
    return pose


def circle(count: int, radius: float) -> np.ndarray:
    """(count, 3) evenly on a circle in z = 0, the first at +x."""
    phi = 2 * np.pi * np.arange(count) / count
    return radius * np.stack([np.cos(phi), np.sin(phi), 0 * phi], axis=-1)


def share_power(lights: Sequence[Light], watts: float, color: Color = WHITE) -> tuple[Light, ...]:
    """The lamps with intensities such that each has the same part of ``watts``, and together they have all of it."""
    each = watts / len(lights)
    return tuple(replace(x, intensity=intensity_from_power(x, each, color)) for x in lights)


def total_power(lights: Sequence[Light]) -> np.ndarray:
    """(3,) W of all lamps together."""
    return np.sum([emitted_power(light) for light in lights], axis=0)


def require(what: str, value: float, low: float, high: float = np.inf, unit: str = "m") -> None:
    """Raise BrightfieldError unless ``value`` lies above ``low`` and not above ``high``."""
    if not low < value <= high:
        limit = f"above {low:g}" + (f", at most {high:g}" if np.isfinite(high) else "")
        raise BrightfieldError(f"{what} must be {limit} {unit}; got {value:g} {unit}.")
