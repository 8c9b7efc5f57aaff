"""Whether the camera or the object moved between the images of a series.

The lamp changes what an image looks like, not where its edges are. Shifts are found by phase correlation (Kuglin,
Hines: The phase correlation image alignment method. 1975; upsampled as Guizar-Sicairos et al. 2008) of the images'
edge strengths, against images under the lamps next to its own: those look most alike.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter

from interchange.problems import BrightfieldError
from interchange.series import Series

SIGNIFICANT = 8.0  # a peak in standard deviations of the correlation; of noise the highest of 1e6 is below 6
MOST = 512  # px: of a large image its middle tells as much
AGREE = 1.0  # px within which most neighbours must tell the same


@dataclass(frozen=True, eq=False)
class Registration:
    """``shift`` (L, 2) px (row, column) by which each image lies off its neighbours, NaN where they cannot tell."""

    shift: np.ndarray

    def moved(self, limit: float) -> np.ndarray:
        """(L,) bool: further off than ``limit`` px."""
        return np.nan_to_num(np.hypot(*self.shift.T)) > limit


def registration(series: Series, neighbours: int = 4, sigma: float = 1.0) -> Registration:
    """The shift of every image against the median of what its ``neighbours`` tell."""
    middle_part = tuple(slice(max(0, (n - MOST) // 2), max(0, (n - MOST) // 2) + MOST) for n in series.shape)
    edges = np.stack([_edges(np.nan_to_num(g[middle_part]), sigma) for g in series.grey])
    shape = edges.shape[1], edges.shape[2]
    dark = edges.reshape(len(series), -1).std(axis=1) == 0
    window = np.outer(np.hanning(shape[0]), np.hanning(shape[1]))
    spectra = np.fft.rfft2((edges - edges.mean(axis=(1, 2), keepdims=True)) * window)
    closeness = series.directions @ series.directions.T
    np.fill_diagonal(closeness, -np.inf)
    shift = np.full((len(series), 2), np.nan)
    for k in range(len(series)):
        if dark[k]:
            continue
        near = [j for j in np.argsort(-closeness[k], kind="stable")[:neighbours] if not dark[j]]
        told = np.array([_shift(spectra[j], spectra[k], shape) for j in near]).reshape(-1, 2)
        told = told[np.isfinite(told).all(axis=1)]
        middle = np.median(told, axis=0) if len(told) else np.full(2, np.nan)
        if (np.abs(told - middle).max(axis=1) < AGREE).sum() > len(near) / 2:
            shift[k] = middle
    return Registration(shift)


def check_registered(series: Series, limit: float = 1.5) -> None:
    """Raise BrightfieldError that names the images which moved by more than ``limit`` px against their neighbours."""
    if len(series) < 3:
        return
    found = registration(series)
    moved = found.moved(limit)
    if not moved.any():
        return
    worst = np.flatnonzero(moved)
    told = ", ".join(
        f"{series.names[k]} ({found.shift[k, 1]:+.1f}, {found.shift[k, 0]:+.1f} px)" for k in worst[:5]
    )
    more = " …" if len(worst) > 5 else ""
    raise BrightfieldError(
        f"All images of a series must be of one view; {len(worst)} of {len(series)} moved against those under the "
        f"lamps next to theirs (right, down): {told}{more}. Align them or leave them out; --skip-registration takes "
        "them as they are."
    )


def _edges(image: np.ndarray, sigma: float) -> np.ndarray:
    """Edge strength over the local brightness, so that no highlight outweighs the rest."""
    smooth = gaussian_filter(image, sigma)
    down, right = np.gradient(smooth)
    level = gaussian_filter(np.abs(image), 8 * sigma) + 1e-3 * float(np.abs(image).max()) + 1e-30
    return np.asarray(np.hypot(down, right) / level)


def _shift(a: np.ndarray, b: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """(2,) px: how far b lies off a, by the peak of their cross-correlation with flattened spectra; NaN where it does
    not stand out."""
    cross = np.conj(a) * b
    peak = np.fft.irfft2(cross / np.sqrt(np.abs(cross) + 1e-30), shape)  # half flattened: noise weighs less
    where = np.unravel_index(int(np.argmax(peak)), shape)
    if peak[where] < SIGNIFICANT * peak.std():
        return np.full(2, np.nan)
    out = []
    for axis, at in enumerate(where):
        size = shape[axis]
        line = np.moveaxis(peak, axis, 0)[(np.arange(at - 1, at + 2)) % size]
        low, middle, high = line[:, where[1 - axis]]
        curve = low - 2 * middle + high
        part = 0.5 * (low - high) / curve if curve < 0 else 0.0
        out.append((at + part + size / 2) % size - size / 2)
    return np.array(out)
