"""The reflectance function of a pixel, r_x(φ, θ): how bright it is under each lamp.

Gruna, Irgenfried: Reflectance modeling in machine vision. 2012, Eq. 5 and Fig. 8.
"""

from dataclasses import dataclass

import numpy as np

from analysis.series.azimuth_features import rings_of
from interchange.problems import BrightfieldError
from interchange.series import Series


@dataclass(frozen=True, eq=False)
class ReflectanceFunction:
    """``phi``, ``theta`` (L,) rad; ``values`` (L,), NaN where not usable; over irradiance: f cos θ_i for radiance."""

    phi: np.ndarray
    theta: np.ndarray
    values: np.ndarray


def reflectance_function(series: Series, row: int, column: int) -> ReflectanceFunction:
    """That of one pixel. Raises BrightfieldError outside the image."""
    height, width = series.shape
    if not (0 <= row < height and 0 <= column < width):
        raise BrightfieldError(
            f"A pixel must lie in {height} rows and {width} columns; got row {row}, column {column}."
        )
    w = series.wi if series.wi.ndim == 2 else series.wi[:, row, column]
    values = np.where(series.usable[:, row, column], series.per_irradiance[:, row, column], np.nan)
    phi = np.mod(np.arctan2(w[:, 1], w[:, 0]), 2 * np.pi)
    return ReflectanceFunction(phi, np.arccos(np.clip(w[:, 2], -1, 1)), values)


def on_grid(series: Series) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """``theta`` (R,), ``phi`` (A,) rad and the series' lamps (R, A), where they stand on R circles of A azimuths.

    Raises BrightfieldError where they do not.
    """
    rings = rings_of(series)
    phi = np.mod(np.arctan2(series.directions[:, 1], series.directions[:, 0]) + 1e-6, 2 * np.pi) - 1e-6
    rows = [np.flatnonzero(rings == k) for k in range(rings.max() + 1)]
    rows = [r[np.argsort(phi[r])] for r in rows]
    same = len({len(r) for r in rows}) == 1 and all(
        np.allclose(phi[r], phi[rows[0]], atol=0.02) for r in rows
    )
    if not same:
        raise BrightfieldError("The lamps must stand on circles with the same azimuths to form a grid.")
    lamps = np.stack(rows)
    theta = np.arccos(np.clip(series.directions[lamps][..., 2], -1, 1)).mean(axis=1)
    return theta, phi[lamps[0]], lamps
