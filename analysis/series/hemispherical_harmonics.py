"""Reflectance functions as hemispherical harmonics, and materials told apart in them by a support vector machine.

    r(θ, φ) = sum_lm c_lm H_lm(θ, φ),    H_lm = sqrt(2) Y_lm(2 cos θ - 1, φ):    orthonormal over the hemisphere

Basis: Gautron et al.: A novel hemispherical basis for accurate and efficient rendering. EGSR 2004. Wang, Gunawardane,
Scher, Davis: Material classification using BRDF slices. CVPR 2009, turn each pixel's samples into its own frame by
photometric stereo, fit the series and train a multi-class support vector machine on the coefficients.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import gammaln, lpmv

from analysis.series.local_frame import local
from interchange.problems import BrightfieldError
from interchange.series import Series

RIDGE = 1e-6  # of the mean diagonal: settles what few lamps leave open


def basis(w: np.ndarray, degree: int) -> np.ndarray:
    """(..., (degree + 1)²): H_lm at unit vectors ``w`` (..., 3) above the surface, in the order l, m = -l ... l."""
    cos = np.clip(2 * np.clip(w[..., 2], 0, 1) - 1, -1, 1)
    phi = np.arctan2(w[..., 1], w[..., 0])
    out = []
    for n in range(degree + 1):
        for m in range(-n, n + 1):
            k = abs(m)
            scale = np.sqrt((2 * n + 1) / (2 * np.pi) * np.exp(gammaln(n - k + 1) - gammaln(n + k + 1)))
            wave = 1.0 if m == 0 else np.sqrt(2) * (np.cos(k * phi) if m > 0 else np.sin(k * phi))
            out.append(scale * lpmv(k, n, cos) * wave)
    return np.stack(np.broadcast_arrays(*out), axis=-1)


def harmonic_features(series: Series, normals: np.ndarray | None = None, degree: int = 3) -> np.ndarray:
    """(H, W, (degree + 1)²) coefficients of each pixel's grey reflectance function by least squares.

    ``normals`` (H, W, 3) turn the lamps into each pixel's own frame; without them all normals are z. Lamps below a
    pixel's surface and samples that are not usable are left out; NaN where half as many as coefficients remain.
    Raises BrightfieldError where there are fewer lamps than coefficients.
    """
    count = (degree + 1) ** 2
    if len(series) < count:
        raise BrightfieldError(
            f"Harmonics of degree {degree} need {count} lamps or more; got {len(series)}. Take a lower degree."
        )
    y = np.where(series.usable, series.per_irradiance, 0.0).reshape(len(series), -1).astype(np.float64)
    weight = series.usable.reshape(len(series), -1).astype(np.float64)
    if normals is None and series.wi.ndim == 2:
        design = basis(series.wi, degree)
        weight *= (series.wi[:, 2] > 0)[:, None]
        if (weight == weight[:, :1]).all():  # one design for all pixels
            rows = weight[:, 0] > 0
            system = design[rows].T @ design[rows]
            out = np.linalg.solve(_ridged(system), design[rows].T @ y[rows]).T
            return np.ascontiguousarray(out).reshape(*series.shape, count)
        outer = (design[:, :, None] * design[:, None, :]).reshape(len(design), -1)
        system = (weight.T @ outer).reshape(-1, count, count)
        right = (weight * y).T @ design
    else:
        flat = np.broadcast_to([0.0, 0.0, 1.0], (*series.shape, 3)) if normals is None else normals
        wi, _ = local(series, flat)
        wi = wi.reshape(len(series), -1, 3)
        weight *= wi[..., 2] > 0
        system = np.empty((wi.shape[1], count, count))
        right = np.empty((wi.shape[1], count))
        for start in range(0, wi.shape[1], 4096):
            part = slice(start, start + 4096)
            H = basis(np.nan_to_num(wi[:, part]), degree)
            system[part] = np.einsum("ln,lni,lnj->nij", weight[:, part], H, H, optimize=True)
            right[part] = np.einsum("ln,lni->ni", weight[:, part] * y[:, part], H)
    out = np.full((len(right), count), np.nan)
    good = weight.sum(axis=0) >= count / 2
    out[good] = np.linalg.solve(_ridged(system[good]), right[good][..., None])[..., 0]
    return out.reshape(*series.shape, count)


def _ridged(system: np.ndarray) -> np.ndarray:
    size = system.shape[-1]
    level = np.trace(system, axis1=-2, axis2=-1)[..., None, None] / size
    return np.asarray(system + RIDGE * level * np.eye(size))


@dataclass(frozen=True, eq=False)
class Classified:
    """``labels`` (H, W), -1 where a feature is missing; ``accuracy``: mean and standard deviation over folds of the
    training pixels."""

    labels: np.ndarray
    accuracy: tuple[float, float]
    machine: Any


def classify(
    features: np.ndarray, labels: np.ndarray, most: int = 2000, folds: int = 5, seed: int = 0
) -> Classified:
    """Train a support vector machine (Gaussian kernel, standardised features) on the pixels that have a label, and
    label all.

    ``features`` (H, W, F); ``labels`` (H, W) int, below 0 where none is known. At most ``most`` pixels a class, drawn
    by ``seed``, are trained on. Raises BrightfieldError for fewer than two classes of ``folds`` pixels.
    """
    from sklearn.model_selection import cross_val_score
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler
    from sklearn.svm import SVC

    x, y = features.reshape(-1, features.shape[-1]), np.ravel(labels)
    there = np.isfinite(x).all(axis=1)
    rng = np.random.default_rng(seed)
    chosen = []
    for k in np.unique(y[y >= 0]):
        own = np.flatnonzero((y == k) & there)
        if len(own) >= folds:
            chosen.append(rng.permutation(own)[:most])
    if len(chosen) < 2:
        raise BrightfieldError(f"A classifier needs two classes or more of {folds} labelled pixels each.")
    train = np.concatenate(chosen)
    machine = make_pipeline(StandardScaler(), SVC(C=10.0, class_weight="balanced"))
    scores = cross_val_score(machine, x[train], y[train], cv=folds)
    machine.fit(x[train], y[train])
    out = np.full(len(y), -1)
    out[there] = machine.predict(x[there])
    return Classified(out.reshape(features.shape[:2]), (float(scores.mean()), float(scores.std())), machine)
