"""A few numbers of how a pixel's brightness changes while the lamp goes round it.

    r(φ) = a_0 + a_1 cos(φ - φ_1) + a_2 cos 2(φ - φ_2) + rest,       by least squares over all lamps

a_1 is there where a facet is tilted, to the azimuth φ_1; a_2 where a structure has a direction (brushed metal, a
scratch); the rest's peak is a highlight. A matte facet tilted by β has a_1 / a_0 = tan θ tan β, a_2 = 0.

After Lindner, Puente León: Model-based segmentation of surfaces using illumination series. IEEE Trans. Instrumentation
and Measurement 2007, who cluster features of the signal over φ pixel by pixel; which features, is ours. Lamps of one
polar angle θ are a circle; each has its own a_0.
"""

import numpy as np

from interchange.problems import BrightfieldError
from interchange.series import Series

NAMES = (
    "level",
    "first over level",
    "second over level",
    "highlight over level",
    "width of the highlight, rad",
)


def rings_of(series: Series, tolerance: float = np.radians(3)) -> np.ndarray:
    """(L,) number of the circle of equal polar angle that each lamp is on, from the axis outwards."""
    theta = np.arccos(np.clip(series.directions[:, 2], -1, 1))
    order = np.argsort(theta, kind="stable")
    steps = np.diff(theta[order]) > tolerance
    rings = np.empty(len(theta), np.int64)
    rings[order] = np.concatenate([[0], np.cumsum(steps)])
    return rings


def waves(series: Series) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Level a_0, mean of the circles (H, W); first wave (H, W, 2), cos and sin part; second wave alike; rest (L, H, W).

    Raises BrightfieldError for fewer than five lamps, or lamps whose azimuths do not tell the waves apart.
    """
    rings = rings_of(series)
    phi = np.arctan2(series.directions[:, 1], series.directions[:, 0])
    count = int(rings.max()) + 1
    design = np.zeros((len(series), count + 4))
    design[np.arange(len(series)), rings] = 1.0
    for k, wave in enumerate((np.cos(phi), np.sin(phi), np.cos(2 * phi), np.sin(2 * phi))):
        design[:, count + k] = wave
    if len(series) < 5 or np.linalg.matrix_rank(design) < design.shape[1]:
        raise BrightfieldError(
            "Features of the azimuth need five lamps or more around the object; the azimuths of these "
            f"{len(series)} do not tell a first and a second wave apart."
        )
    y = np.where(series.usable, series.per_irradiance, np.nan).reshape(len(series), -1)
    if np.isnan(y).any():  # a sample that is saturated is at least as bright as the brightest other
        y = np.where(np.isnan(y), np.nanmax(y, axis=0), y)
    found = np.linalg.lstsq(design, y, rcond=None)[0]
    rest = (y - design @ found).reshape(len(series), *series.shape)
    shape = series.shape
    level = found[:count].mean(axis=0).reshape(shape)
    first, second = (np.moveaxis(found[count + k : count + k + 2].reshape(2, *shape), 0, -1) for k in (0, 2))
    return level, first, second, rest


def azimuth_features(series: Series) -> np.ndarray:
    """(H, W, 5) ``NAMES``; none changes when the object is turned on the spot by a step of the lamps."""
    level, first, second, rest = waves(series)
    floor = np.maximum(level, 1e-6 * float(np.abs(level).max()) + 1e-30)
    top = rest.max(axis=0)
    # the directions' spread around their centroid, weighted by what shines out
    weight = np.maximum(rest - 0.5 * top, 0.0).reshape(len(series), -1)
    total = np.maximum(weight.sum(axis=0), 1e-30)
    length = np.linalg.norm(series.directions.T @ weight, axis=0) / total
    width = np.sqrt(np.maximum(2 * (1 - length), 0.0)).reshape(series.shape)
    amplitudes = [np.linalg.norm(w, axis=-1) / floor for w in (first, second)]
    return np.stack([level, *amplitudes, top / floor, width], axis=-1)
