"""Red and blue are imaged larger or smaller than green, and aside of it.

    p_red = p (1 + red + red3 r²) + (red_u, red_v),   p_blue = p (1 + blue + blue3 r²) + (blue_u, blue_v)

from the principal point, r = |p|; 1 is half the image's diagonal. Green, the second channel, stays. An element that
stands aside of the lens's axis, a filter that is a wedge and a prism that splits colours move a channel as a whole.
"""

from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np

from interchange.camera import Camera
from interchange.effects.base import Effect, Stage, carried
from interchange.filtering import applied
from interchange.image import Image
from interchange.local import Function, Local
from interchange.parameter import parameter

SHIFT_ERROR = 1e-4  # px that the polynomial of the shift may miss


@dataclass(frozen=True)
class LateralChromaticAberration(Effect):
    stage = Stage.OPTICS
    order = 20
    source = (
        "Mallon, Whelan: Calibration and removal of lateral chromatic aberration in images. "
        "Pattern Recognition Letters 28(1), 2007."
    )
    identified_by = "Red and blue edges shift apart along the radius, the more the farther from the axis."
    confused_with = ("lens_distortion", "axial_chromatic_aberration")
    separated_by = "black and white edges in the image's corners"
    carried_by = carried(
        red="lens.lateral_chromatic_aberration.0",
        blue="lens.lateral_chromatic_aberration.1",
        red3="lens.lateral_chromatic_aberration.2",
        blue3="lens.lateral_chromatic_aberration.3",
        red_u="lens.lateral_chromatic_aberration.4",
        red_v="lens.lateral_chromatic_aberration.5",
        blue_u="lens.lateral_chromatic_aberration.6",
        blue_v="lens.lateral_chromatic_aberration.7",
    )

    red: float = parameter(0.0, "c_R", "1", -0.05, 0.05, "red's magnification over green's, less 1")
    blue: float = parameter(0.0, "c_B", "1", -0.05, 0.05, "blue's magnification over green's, less 1")
    red3: float = parameter(0.0, "d_R", "1", -0.05, 0.05, "what is added to red's at the image corner")
    blue3: float = parameter(0.0, "d_B", "1", -0.05, 0.05, "what is added to blue's at the image corner")
    red_u: float = parameter(0.0, "u_R", "1", -0.05, 0.05, "how far red lies to the right of green")
    red_v: float = parameter(0.0, "v_R", "1", -0.05, 0.05, "how far red lies below green")
    blue_u: float = parameter(0.0, "u_B", "1", -0.05, 0.05, "how far blue lies to the right of green")
    blue_v: float = parameter(0.0, "v_B", "1", -0.05, 0.05, "how far blue lies below green")

    def apply(self, image: Image, camera: Camera, rng: np.random.Generator | None) -> Image:
        step = self.local(image, camera)
        return replace(image, pixels=applied(image.pixels, [step])) if step else image

    def shifts(self, camera: Camera) -> np.ndarray:
        """(H, W, 3, 2) px, columns and rows: how far what each channel shows at a pixel was moved."""
        width, height = camera.sensor.resolution
        K, unit = camera.K, float(np.hypot(width / 2, height / 2))
        column, row = np.meshgrid(np.arange(width) - K[0, 2], np.arange(height) - K[1, 2])
        out = np.zeros((height, width, 3, 2))
        for channel, c, d, u, v in (
            (0, self.red, self.red3, self.red_u, self.red_v),
            (2, self.blue, self.blue3, self.blue_u, self.blue_v),
        ):
            there = np.stack([column / unit - u, row / unit - v], axis=-1)
            r = np.hypot(there[..., 0], there[..., 1])
            farthest = float(r.max())
            table = np.linspace(0, farthest, 512)
            factor = np.interp(r, table, source(c, d, table))[..., None]
            out[..., channel, :] = unit * (there * (1 - factor) + [u, v])
        return out

    def local(self, image: Image, camera: Camera) -> Local | None:
        """By Lagrange's cubic through 4 x 4 pixels; the shift is a polynomial of r² within ``SHIFT_ERROR``."""
        if image.pixels.shape[2] != 3:
            return Local(0, 0, (None,))
        width, height = camera.sensor.resolution
        K, unit = camera.K, float(np.hypot(width / 2, height / 2))
        centre = np.array([K[0, 2], K[1, 2]])
        ends = np.array([width - 1, height - 1])
        functions: list[Function | None] = [None, None, None]
        reach = 0
        for channel, c, d, u, v in (
            (0, self.red, self.red3, self.red_u, self.red_v),
            (2, self.blue, self.blue3, self.blue_u, self.blue_v),
        ):
            if c or d or u or v:
                aside = unit * np.array([u, v])
                middle = centre + aside
                per_r2, shift = _shift(c, d, float(np.hypot(*np.maximum(middle, ends - middle))), unit)
                functions[channel] = partial(_magnified, middle, per_r2, unit, aside)
                reach = max(reach, int(np.ceil(shift + np.hypot(*aside))) + 3)
        return Local(reach, reach, tuple(functions))


def _magnified(
    centre: np.ndarray,
    per_r2: np.ndarray,
    unit: float,
    aside: np.ndarray,
    plane: np.ndarray,
    low: int,
    height: int,
    out: np.ndarray,
    start: int,
    pad: int,
) -> None:
    from interchange import plane_kernels  # Numba comes with it

    plane_kernels.magnified(plane, low, height, out, start, centre, per_r2, unit, aside, pad)


def source(c: float, d: float, there: np.ndarray) -> np.ndarray:
    """r over ``there``, of the light in the image of green that arrives at ``there`` = r (1 + c + d r²), by Newton."""
    r = there / (1 + c)
    for _ in range(4 if d else 0):
        r -= (r * (1 + c + d * r * r) - there) / (1 + c + 3 * d * r * r)
    return np.where(there > 0, r / np.where(there > 0, there, 1), 1 / (1 + c))


@lru_cache(maxsize=16)
def _shift(c: float, d: float, farthest: float, unit: float) -> tuple[np.ndarray, float]:
    """Coefficients of source(r) - 1 in powers of r², and the largest shift, px, out to ``farthest`` px."""
    q = (farthest / unit) ** 2 * (1 - np.cos(np.linspace(0, np.pi, 65))) / 2  # Chebyshev's places
    want = source(c, d, np.sqrt(q)) - 1
    for degree in range(0, 16):
        powers = np.vander(q / q.max(), degree + 1, increasing=True)
        fitted = np.linalg.lstsq(powers, want, rcond=None)[0]
        missed = np.abs(powers @ fitted - want) * np.sqrt(q) * unit
        if missed.max() < SHIFT_ERROR:
            break
    return fitted / q.max() ** np.arange(len(fitted)), float((np.abs(want) * np.sqrt(q) * unit).max())
