"""One Lafortune lobe at every pixel of an illumination series: the features (C_z, k_d, n).

    f = k_d / pi + max(-wi.x wo.x - wi.y wo.y + C_z wi.z wo.z, 0)^n

The isotropic form with one lobe of Lensch et al. 2001 whose height lies in C_z; seen along the normal it is
k_d / pi + (C_z cos theta_i)^n. Gruna & Irgenfried 2012 tell the materials of a circuit board by it (their section 3.2).
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from analysis.fit.many import Free, ManyFits, fit_many
from interchange.brdf.lafortune import Lafortune
from interchange.problems import BrightfieldError

ONE_LOBE = Lafortune(weight=((1.0, 1.0, 1.0),), C=((-1.0, -1.0, 1.0),), n=(1.0,))
NAMES = ("C_z", "k_d", "n")


def one_lobe(x: Sequence[Any], wi: Any, wo: Any) -> Any:
    """The formula as the catalogue has it, in x = (log C_z^n, k_d, n): samples tell a lobe's height and width apart
    far better than C_z and n; and where one ring of lamps alone sees it, the valley log C_z^n + n log cos is
    straight."""
    height, k_d, n = x
    c_z = np.exp(height / n)
    return ONE_LOBE.bind([k_d] * 3 + [1.0] * 3 + [-1.0, -1.0, c_z, n], 0).f(wi, wo)


FREE = (
    Free("log C_z^n", -14.0, 10.0, tuple(np.log([0.02, 0.1, 0.5, 2.0, 10.0]))),
    Free("k_d", 0.0, np.pi, linear=True),
    Free("n", 0.05, 1e4, (1.0, 3.0, 10.0, 30.0, 120.0)),
)


def fit_lafortune_pixels(
    f: np.ndarray,
    wi: np.ndarray,
    wo: np.ndarray,
    frames: np.ndarray | None = None,
    weight: np.ndarray | None = None,
) -> ManyFits:
    """(C_z, k_d, n) of every pixel: ``ManyFits`` over H W pixels in reading order.

    ``f`` (L, H, W) reflectance in 1/sr, radiance over irradiance of the surface: for images of distant lamps, the
    image over that of a white standard times its albedo / pi. ``wi`` (L, 3), ``wo`` (3,): unit vectors to the lamps
    and the camera in the world of ``frames`` (H, W, 3, 3: each pixel's tangent, bitangent and normal as rows), without
    which the surface is flat and its normal z.
    ``weight`` (L, H, W). Raises BrightfieldError.
    """
    if f.ndim != 3 or len(f) != len(wi):
        raise BrightfieldError(
            f"A series must have shape (lights, height, width), one direction a light; got {f.shape} and "
            f"{len(wi)} directions."
        )
    count = len(f)
    y = f.reshape(count, -1).T
    fits = fit_many(
        one_lobe,
        FREE,
        y,
        wi,
        wo,
        None if frames is None else frames.reshape(-1, 3, 3),
        None if weight is None else weight.reshape(count, -1).T,
    )
    height, k_d, n = fits.x.T
    c_z = np.exp(height / n)
    # d(C_z, k_d, n) / d(log C_z^n, k_d, n)
    turn = np.zeros((len(n), 3, 3))
    turn[:, 0, 0], turn[:, 0, 2] = c_z / n, -c_z * height / n**2
    turn[:, 1, 1], turn[:, 2, 2] = 1.0, 1.0
    with np.errstate(
        invalid="ignore"
    ):  # 0 times an infinite variance is nobody's business but that parameter's
        covariance = turn @ fits.covariance @ turn.transpose(0, 2, 1)
    covariance[np.isnan(covariance)] = np.inf
    return replace(fits, names=NAMES, x=np.stack([c_z, k_d, n], axis=-1), covariance=covariance)
