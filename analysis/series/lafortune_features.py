"""Three numbers a pixel that tell materials apart: (C_z, k_d, n) of one Lafortune lobe.

    r_x(w) / (E cos θ) = k_d / π + max(-wi.x wo.x - wi.y wo.y + C_z wi.z wo.z, 0)^n

Gruna, Irgenfried: Reflectance modeling in machine vision. 2012, section 3.2.4: the surface is flat, its normal z. With
``normals`` the features do not depend on how a surface is turned (their section 3.2.4, first paragraph).
"""

from dataclasses import dataclass

import numpy as np

from analysis.fit.lafortune_pixels import fit_lafortune_pixels
from analysis.fit.many import ManyFits
from analysis.series.local_frame import cosines, frames_of
from interchange.image import Quantity
from interchange.problems import BrightfieldError
from interchange.series import Series

GRAZING = np.radians(85.0)


@dataclass(frozen=True, eq=False)
class LafortuneFeatures:
    """``c_z``, ``k_d``, ``n`` (H, W); NaN where a pixel has too few samples. ``fits``: with covariances."""

    c_z: np.ndarray
    k_d: np.ndarray
    n: np.ndarray
    fits: ManyFits

    @property
    def features(self) -> np.ndarray:
        """(H, W, 3): C_z, k_d, n, as in the chapter."""
        return np.stack([self.c_z, self.k_d, self.n], axis=-1)

    @property
    def additive(self) -> np.ndarray:
        """(H, W, 3): k_d; the albedo of matte part and lobe, seen head-on, k_d + 2π C_z^n / (n + 2); the lobe's
        height C_z^n, 1/sr.

        The same three numbers, told so that a pixel on the edge of two materials lies between them, and that a lobe
        that is hardly there does not count by its width.
        """
        with np.errstate(over="ignore"):
            height = np.minimum(np.exp(self.n * np.log(np.maximum(self.c_z, 1e-30))), 1e3)
        return np.stack([self.k_d, self.k_d + 2 * np.pi * height / (self.n + 2), height], axis=-1)


def lafortune_features(
    series: Series, normals: np.ndarray | None = None, grazing: float = GRAZING
) -> LafortuneFeatures:
    """Fit every pixel's grey reflectance function. ``normals`` (H, W, 3), without which all are z.

    Lamps beyond ``grazing`` rad off the normal and samples that are not usable are left out. Samples weigh as equal
    errors of radiance have it. Raises BrightfieldError where the lamps are near (their directions differ by pixel)
    and the camera is not far, or fewer than four lamps stand above the surface.
    """
    if series.wi.ndim != 2 or series.wo.ndim != 1:
        raise BrightfieldError(
            "The fit of a pixel's lobe must have distant lamps and a telecentric camera, with one direction for all "
            "pixels; take Series.directions and the middle's wo where they differ little (far_off)."
        )
    cos = cosines(series, normals)
    good = series.usable & (cos > np.cos(grazing))
    if not (good.sum(axis=0) >= 4).any():
        raise BrightfieldError(
            "A lobe needs four lamps or more above the surface, not saturated; no pixel has as many."
        )
    with np.errstate(divide="ignore", invalid="ignore"):
        f = np.where(good, series.per_irradiance / cos, 0.0)
    if (
        series.quantity is not Quantity.RADIANCE
    ):  # of an unknown unit: k_d is told in one in which f is 0.1 in the mean
        f = f * (0.1 / max(float(np.mean(f[good])), 1e-30))
    weight = np.where(good, cos**2, 0.0)
    frames = None if normals is None else frames_of(normals)
    fits = fit_lafortune_pixels(f, series.wi.astype(np.float64), series.wo, frames, weight)
    c_z, k_d, n = (fits.x[:, k].reshape(series.shape) for k in range(3))
    return LafortuneFeatures(c_z, k_d, n, fits)
