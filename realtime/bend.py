"""How far a lens bends straight lines: how long an edge may be that is drawn straight through it.

Between vertices a rasteriser draws straight lines and interpolates as a pinhole does. Within a face whose edges run
over rays from d to d + Δ, that is off by at most max |D²F[Δ, Δ]| / 6 px, F from rays to pixels: the error of linear
interpolation over an equilateral triangle (Waldron: The error in linear interpolation at the vertices of a simplex.
SIAM J. Numer. Anal. 1998); the edges themselves are off by 3/4 of it. An edge of length e, no nearer than D, has
|Δ| <= (1 + r²) e / D along the radius r = |d| and sqrt(1 + r²) e / D across it. With B(r) the greatest |D²F| of such
steps for e = D, edges may thus be as long as

    e <= D sqrt(6 tolerance / B(r))

and faces with longer ones are split (realtime.through).
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from interchange.camera import Camera, Projection
from interchange.distortion import LensModel, distort, tilted
from realtime.lens import Lensmap

RINGS = 32  # field angles at which B is tabulated
WIDER = 1.25  # radius up to which the model is followed, over that of the sensor's corners
LEAST_SLOPE = 0.05  # of its image height by field angle, up to where a lens is followed


@dataclass(frozen=True, eq=False)
class Bend:
    """A lens as the vertex shader needs it. ``field``: radius up to which the model is followed, and the slope by which
    it is continued from there; ``reach`` (RINGS + 1,): edge length over distance for an error of 1 px at field angles
    of 0 to ``widest`` rad (radii, and lengths in m, if telecentric), the least up to there."""

    model: LensModel
    radial: tuple[float, ...]  # k1 k2 p1 p2 k3 k4 k5 k6 of OpenCV's model, or a fisheye's
    prism: tuple[float, ...]
    tilt: tuple[float, ...]  # (3, 3), column by column; () for none
    field: tuple[float, float]
    widest: float
    reach: np.ndarray
    telecentric: bool

    @property
    def defines(self) -> dict[str, object]:
        """Of shaders/distort.glsl."""
        return {
            "THROUGH": True,
            "FISHEYE": self.model is LensModel.FISHEYE,
            "PRISM": any(self.prism),
            "TILTED": bool(self.tilt),
        }

    def reached(self, angle: np.ndarray) -> np.ndarray:
        """``reach`` for everything within a field angle (radius if telecentric)."""
        ring = np.ceil(np.clip(np.asarray(angle) / self.widest, 0, 1) * RINGS).astype(int)
        return np.asarray(self.reach[ring])


def bend(camera: Camera, rays: Lensmap) -> Bend | None:
    """Of a camera whose lens distorts. None where the lens folds within the sensor, so that it can't be followed."""
    return _bend(
        camera.lens.distortion,
        camera.lens.model,
        (camera.K[0, 0], camera.K[1, 1]),
        rays.widest,
        camera.lens.projection is Projection.ORTHOGRAPHIC,
    )


@lru_cache(maxsize=8)
def _bend(
    d: tuple[float, ...], model: LensModel, focal: tuple[float, float], corner: float, telecentric: bool
) -> Bend | None:
    radii, phi = np.linspace(0, WIDER * corner, 129)[1:, None], np.linspace(0, 2 * np.pi, 49)[:-1]
    e_r, e_t = np.stack([np.cos(phi), np.sin(phi)]), np.stack([-np.sin(phi), np.cos(phi)])
    at = np.stack([radii * np.cos(phi), radii * np.sin(phi)])  # (2, radii, phi)

    def F(p: np.ndarray) -> np.ndarray:
        return np.stack(distort(p[0], p[1], d, model)) * np.array(focal)[:, None, None]

    h = 1e-4 * corner
    with np.errstate(all="ignore"):
        here = F(at)
        along = (F(at + h * e_r[:, None]) - F(at - h * e_r[:, None])) / (2 * h)
        across = (F(at + h * e_t[:, None]) - F(at - h * e_t[:, None])) / (2 * h)
        turn = along[0] * across[1] - along[1] * across[0]
        slope = (along * e_r[:, None]).sum(axis=0) * (1.0 if telecentric else 1 + radii**2)
        rising = slope > LEAST_SLOPE * min(focal)
        good = (np.isfinite(turn) & (turn > 0) & rising).all(axis=1)
    last = len(radii) if good.all() else int(np.argmin(good))
    if last == 0 or radii[last - 1] < corner:
        return None
    r = radii[:last]
    stretch = (np.ones_like(r), np.ones_like(r)) if telecentric else (1 + r * r, np.sqrt(1 + r * r))
    most = np.zeros(last)
    for alpha in np.linspace(0, np.pi, 13)[:-1]:
        u = stretch[0] * np.cos(alpha) * e_r[:, None] + stretch[1] * np.sin(alpha) * e_t[:, None]
        size = np.sqrt((u * u).sum(axis=0))
        bent = (F(at[:, :last] + h * u / size) + F(at[:, :last] - h * u / size) - 2 * here[:, :last]) / h**2
        most = np.maximum(most, (np.hypot(*bent) * size**2).max(axis=1))
    angles = np.concatenate([[0], radii[:last, 0] if telecentric else np.arctan(radii[:last, 0])])
    up_to = np.maximum.accumulate(np.concatenate([most[:1], most]))
    rings = np.interp(np.arange(RINGS + 1) / RINGS * angles[-1], angles, up_to)
    tilt = (*d, *(0.0,) * 14)[12:14] if model is LensModel.OPENCV else (0.0, 0.0)
    return Bend(
        model,
        (*d, *(0.0,) * 8)[:8],
        (*d, *(0.0,) * 12)[8:12] if model is LensModel.OPENCV else (0.0,) * 4,
        tuple(tilted(*tilt).T.ravel()) if any(tilt) else (),
        (float(r[-1, 0]), 1.0),
        float(angles[-1]),
        np.sqrt(6 / np.maximum(rings, 1e-12)),
        telecentric,
    )
