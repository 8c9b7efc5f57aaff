"""Features that stay when the object is turned.

Turned about the camera's axis by a step of the lamps, a pixel's samples on a circle of lamps are shifted round:
the magnitudes of their Fourier coefficients stay. Grassi, Hahn, Puente León: Detection and classification of varnish
defects on wood surfaces. 2006, build invariants of illumination series by averages over such groups.

Tilted, an isotropic surface looks the same in its own frame: what it reflects depends nearly on the angle of the half
vector from its normal alone (Rusinkiewicz: A new change of variables for efficient BRDF representation. EGRW 1998),
so a profile over that angle stays when the normal is known.
"""

import numpy as np

from analysis.series.azimuth_features import rings_of
from analysis.series.local_frame import cosines, local
from interchange.problems import BrightfieldError
from interchange.series import Series


def rotation_invariants(series: Series, waves: int = 6) -> np.ndarray:
    """(H, W, rings · (waves + 1)): |Fourier coefficient| 0 ... ``waves`` of each circle of lamps.

    Raises BrightfieldError where the lamps of a circle are not equally many and equidistant, or are too few.
    """
    rings = rings_of(series)
    phi = np.mod(np.arctan2(series.directions[:, 1], series.directions[:, 0]), 2 * np.pi)
    y = series.per_irradiance
    out = []
    for k in range(rings.max() + 1):
        own = np.flatnonzero(rings == k)
        own = own[np.argsort(phi[own])]
        gaps = np.diff(np.concatenate([phi[own], phi[own[:1]] + 2 * np.pi]))
        if len(own) < 2 * waves or not np.allclose(gaps, 2 * np.pi / len(own), atol=np.radians(1)):
            raise BrightfieldError(
                f"Each circle of lamps must have {2 * waves} or more, equidistant; circle {k} has {len(own)}, "
                f"{np.degrees(gaps.min()):.1f} to {np.degrees(gaps.max()):.1f} degrees apart."
            )
        out.append(np.abs(np.fft.rfft(y[own], axis=0))[: waves + 1] / len(own))
    return np.moveaxis(np.concatenate(out), 0, -1)


def half_angle_profile(
    series: Series, normals: np.ndarray, edges: np.ndarray | None = None, grazing: float = np.radians(80)
) -> np.ndarray:
    """(H, W, B): mean reflectance f, 1/sr for radiance, over the lamps whose half vector lies between ``edges``
    (B + 1,) rad off the pixel's normal; 0 to 45 degrees in nine steps by default.

    NaN where no usable lamp does. ``normals`` (H, W, 3).
    """
    edges = np.radians(np.linspace(0, 45, 10)) if edges is None else np.asarray(edges)
    wi, wo = local(series, normals)
    h = wi + wo
    angle = np.arccos(np.clip(h[..., 2] / np.linalg.norm(h, axis=-1), -1, 1))
    cos = cosines(series, normals)
    good = series.usable & (cos > np.cos(grazing))
    with np.errstate(divide="ignore", invalid="ignore"):
        f = np.where(good, series.per_irradiance / cos, 0.0)
        bins = np.digitize(angle, edges) - 1
        return np.stack(
            [
                np.where(inside, f, 0.0).sum(axis=0) / inside.sum(axis=0)
                for inside in (good & (bins == k) for k in range(len(edges) - 1))
            ],
            axis=-1,
        )
