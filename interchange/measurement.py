"""What an instrument gave: axes that were set, values that were read off, one row a reading."""

from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from interchange.brdf.base import Brdf
from interchange.problems import Problem


class Kind(StrEnum):
    BRDF = "BRDF"
    SPECTRUM = "spectrum"
    TABLE = "table"


@dataclass(frozen=True, eq=False)
class Column:
    name: str
    unit: str  # "" where the file does not say
    values: np.ndarray  # (N,) float64; NaN where the file has none


@dataclass(frozen=True, eq=False)
class Measurement:
    """``axes``: what was set (N rows each); ``values``: what was read off; ``labels``: columns of words.

    A BRDF has the axes theta_i, phi_i (light) and theta_s, phi_s (camera), rad, from the normal and around it, or
    the half and difference angles theta_h, theta_d, phi_d, rad; and one column in 1/sr a wavelength or channel.
    ``sigma``: one standard deviation of each column of values, or none; ``use`` (N,) False where a reading says of
    itself that it is none. ``model``: the BRDF that the file itself tabulates, where it does. A spectrum has the
    axis wavelength in nm.
    """

    kind: Kind
    axes: tuple[Column, ...]
    values: tuple[Column, ...]
    labels: dict[str, tuple[str, ...]] = field(default_factory=dict)
    wavelength_nm: np.ndarray | None = None  # (K,) one a column of values
    comments: tuple[str, ...] = ()
    notes: tuple[Problem, ...] = ()
    file: str = ""
    sigma: tuple[Column, ...] = ()
    use: np.ndarray | None = None
    model: Brdf | None = None

    @property
    def rows(self) -> int:
        """Number of readings."""
        return len((*self.axes, *self.values)[0].values) if self.axes or self.values else self._words

    @property
    def _words(self) -> int:
        return len(next(iter(self.labels.values()), ()))


def directions(brdf: Measurement) -> tuple[np.ndarray, np.ndarray]:
    """``wi``, ``wo`` (N, 3): unit vectors to the light and to the camera in the shading frame.

    Of half and difference angles the half vector stands at azimuth 0; a direction may lie below the surface.
    """
    angles = [a.values for a in brdf.axes]
    if brdf.axes[0].name == "theta_h":
        return from_half_difference(*angles)
    theta_i, phi_i, theta_s, phi_s = angles
    return unit_vectors(theta_i, phi_i), unit_vectors(theta_s, phi_s)


def unit_vectors(theta: np.ndarray, phi: np.ndarray) -> np.ndarray:
    """(..., 3) of polar angles from the normal and azimuths from the tangent, rad."""
    return np.stack(
        [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta) + 0 * phi], axis=-1
    )


def from_half_difference(
    theta_h: np.ndarray, theta_d: np.ndarray, phi_d: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """``wi``, ``wo`` (..., 3) of half and difference angles in rad, the half vector at azimuth 0. Rusinkiewicz 1998."""
    x, y, z = np.moveaxis(unit_vectors(theta_d, phi_d), -1, 0)
    c, s = np.cos(theta_h), np.sin(theta_h)
    return (
        np.stack([c * x + s * z, y, c * z - s * x], axis=-1),
        np.stack([s * z - c * x, -y, c * z + s * x], axis=-1),
    )
