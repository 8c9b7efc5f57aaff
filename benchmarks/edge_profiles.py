"""Edges in pictures: error functions through grey profiles across them."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import map_coordinates, spline_filter
from scipy.optimize import curve_fit
from scipy.special import erf

REACH = 5  # px to either side of an edge


@dataclass(frozen=True)
class Edges:
    """Where each edge lies off the place where it was looked for, and its rms width; NaN where none was found."""

    offset: np.ndarray  # (n,) px
    sigma: np.ndarray  # (n,) px


def across(image: np.ndarray, place: np.ndarray, normal: np.ndarray, reach: float = REACH) -> Edges:
    """Profiles through ``place`` (n, k, 2) px along ``normal`` (n, k, 2) or (n, 1, 2), a mean of k lines each."""
    s = np.arange(-reach, reach + 0.25, 0.5)
    smooth = spline_filter(image.astype(np.float64))
    at = place[..., None, :] + s[:, None] * normal[..., None, :]
    profiles = map_coordinates(smooth, [at[..., 1], at[..., 0]], prefilter=False).mean(axis=1)
    found = np.full((len(profiles), 2), np.nan)
    for k, profile in enumerate(profiles):
        height = (profile[-1] - profile[0]) / 2
        if abs(height) < 1:  # DN: no edge
            continue
        try:
            p, *_ = curve_fit(edge, s, profile, p0=(profile.mean(), height, 0.0, 1.0), maxfev=400)
        except RuntimeError:
            continue
        if abs(p[2]) < reach / 2:
            found[k] = p[2], abs(p[3])
    return Edges(*found.T)


def edge(s: np.ndarray, middle: float, height: float, place: float, sigma: float) -> np.ndarray:
    return middle + height * erf((s - place) / (np.sqrt(2) * max(abs(sigma), 1e-3)))


def rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(x))))
