"""Edge places along search lines, which circle and line gauges share."""

import cv2
import numpy as np
from scipy.ndimage import correlate1d

STEP = 0.25  # px between samples of a profile


def edge_places(
    image: np.ndarray,
    middles: np.ndarray,
    directions: np.ndarray,
    reach: float,
    sigma: float,
    contrast: float,
    width: float = 1.0,
) -> np.ndarray:
    """(n,) px along ``directions`` from ``middles`` (n, 2) to each search line's strongest edge; NaN where none is as
    steep as ``contrast`` grey levels per px.

    Profiles of the image, a mean over ``width`` px to either side, are derived by a Gaussian of ``sigma`` px; the
    place is the top of the parabola through the steepest three samples.
    """
    t = np.arange(-reach - 4 * sigma, reach + 4 * sigma + STEP / 2, STEP)
    beside = np.stack([-directions[:, 1], directions[:, 0]], axis=-1)
    profile = np.zeros((len(middles), len(t)), np.float32)
    shifts = np.linspace(-width, width, 3) if width > 0 else np.zeros(1)
    for shift in shifts:
        at = (middles + shift * beside)[:, None] + t[None, :, None] * directions[:, None]
        profile += cv2.remap(
            np.asarray(image, np.float32),
            at[..., 0].astype(np.float32),
            at[..., 1].astype(np.float32),
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=(float("nan"),) * 4,
        )
    profile /= len(shifts)
    s = np.arange(-np.ceil(4 * sigma / STEP), np.ceil(4 * sigma / STEP) + 1) * STEP
    kernel = s / sigma**2 * np.exp(-0.5 * (s / sigma) ** 2)
    kernel /= np.sum(s * kernel)  # a ramp of one grey level a px gives 1
    slope = np.abs(correlate1d(profile, kernel, axis=1, mode="nearest"))
    slope[~(np.abs(t) <= reach)[None].repeat(len(slope), 0)] = -1
    slope = np.nan_to_num(slope, nan=-1)
    best = np.argmax(slope, axis=1)
    k = np.clip(best, 1, len(t) - 2)
    rows = np.arange(len(slope))
    before, middle, after = slope[rows, k - 1], slope[rows, k], slope[rows, k + 1]
    bend = before - 2 * middle + after
    with np.errstate(divide="ignore", invalid="ignore"):
        shift = np.where((bend < 0) & (before >= 0) & (after >= 0), 0.5 * (before - after) / bend, 0.0)
    place = t[k] + STEP * np.clip(shift, -1, 1)
    return np.where(slope[rows, best] >= contrast, place, np.nan)
