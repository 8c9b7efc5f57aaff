"""Where the rays of a distorting lens lie in a wide pinhole view.

For images, bodies are drawn through the lens (realtime.through), which gives the rays alone a place here. Passes of the
pixels' centres, and scenes that can't be drawn so, are looked up in a wide view: straight edges stay straight only
without distortion, so the bodies are drawn without it, over all that the lens
sees and finer than the sensor, and each image sample looks up the texel that its own ray meets, where the facet's
plane is intersected exactly. The rays are exact at the pixels' corners and bilinear between.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from interchange.camera import Camera, Projection
from interchange.distortion import LensModel, undistort
from interchange.problems import BrightfieldError

FINENESS = 2.0  # texels a pixel where the lens magnifies most
LARGEST = 16384  # texels a side


@dataclass(frozen=True, eq=False)
class Lensmap:
    """``d`` (H + 1, W + 1, 2) float32: the rays of the pixels' corners (X / Z, Y / Z), NaN where the lens sees
    nothing. The wide view that holds them: ``focal``, ``centre`` (2,) and ``size``, texels."""

    d: np.ndarray
    focal: np.ndarray
    centre: np.ndarray
    size: tuple[int, int]

    @cached_property
    def widest(self) -> float:
        """The greatest |d| that is seen."""
        return float(np.sqrt(np.nanmax((self.d.astype(np.float64) ** 2).sum(axis=-1))))

    @cached_property
    def blind(self) -> bool:
        """Whether the lens sees nothing at some pixel's corner."""
        return not bool(np.isfinite(self.d).all())


def lensmap(camera: Camera) -> Lensmap | None:
    """The map of a camera, None without distortion."""
    if not camera.lens.distorts:
        return None
    telecentric = camera.lens.projection is Projection.ORTHOGRAPHIC
    return _lensmap(
        camera.lens.distortion,
        camera.lens.model,
        tuple(camera.K[[0, 1, 0, 1], [0, 1, 2, 2]]),
        camera.sensor.resolution,
        telecentric,
    )


@lru_cache(maxsize=8)
def _lensmap(
    distortion: tuple[float, ...],
    model: LensModel,
    k: tuple[float, ...],
    resolution: tuple[int, int],
    telecentric: bool,
) -> Lensmap:
    (fx, fy, cx, cy), (width, height) = k, resolution
    column, row = np.meshgrid(np.arange(width + 1) - 0.5, np.arange(height + 1) - 0.5)
    with np.errstate(all="ignore"):
        d = np.stack(undistort((column - cx) / fx, (row - cy) / fy, distortion, model), axis=-1)
    seen = np.isfinite(d).all(axis=-1)
    if not seen.any():
        raise BrightfieldError(
            f"A lens must see something; distortion {distortion} maps nothing onto the sensor."
        )
    low, high = d[seen].min(axis=0), d[seen].max(axis=0)
    # the smallest step of d over one pixel is where the lens magnifies most
    steps = [np.abs(np.diff(d[..., i], axis=1 - i)) for i in (0, 1)]
    finest = np.array([np.nanpercentile(s, 1) for s in steps])
    focal = FINENESS / finest
    size = np.ceil((high - low) * focal).astype(int) + 4
    if size.max() > LARGEST or size.prod() > 2**27:
        raise BrightfieldError(
            f"The rasteriser draws a distorting lens through a wide pinhole view, which would need {size[0]} x "
            f"{size[1]} texels for distortion {distortion}; at most {LARGEST} a side."
        )
    return Lensmap(d.astype(np.float32), focal, 2 - low * focal, (int(size[0]), int(size[1])))
