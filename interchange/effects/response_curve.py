"""The curve from the linear DN to that of the image that leaves the camera, and its bits.

    DN_out = (2^b_out - 1) / (2^b - 1) (black + (2^b - 1 - black) curve(y + y (1 - y) (c + s (1 - 2 y)))),
    y = x^γ,   x = (DN - black) / (2^b - 1 - black)

c and s are the first two terms of any smooth deviation from a line that is nothing at both ends, no published model.
Below black, where noise reaches, the curve goes on point-symmetrically.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from interchange.camera import Camera
from interchange.effects.base import Effect, Stage, carried
from interchange.image import Image
from interchange.parameter import parameter
from interchange.sensor import Response, freeze_numbers, freeze_word

STEEP = 0.8  # γ below which the slope grows over noise's width in the dark


@dataclass(frozen=True)
class ResponseCurve(Effect):
    """x^γ, bowed by c and s, then the named curve: linear, sRGB's, Rec. 709's, or a table that is linear between its
    entries."""

    stage = Stage.READOUT
    order = 60
    source = (
        "IEC 61966-2-1:1999 (sRGB); ITU-R BT.709-6, 1.2; Grossberg, Nayar: Modeling the space of camera response "
        "functions. PAMI 2004."
    )
    identified_by = "DN differ by a function of DN alone, whatever the material and the place."
    confused_with = ("exposure", "saturation", "black_level")
    separated_by = "the same scene at a quarter and at four times the exposure"
    pointwise = True
    carried_by = carried(
        gamma="sensor.gamma",
        bow="sensor.bow",
        skew="sensor.skew",
        response="sensor.response",
        lut="sensor.response_lut",
        bits_out="sensor.output_bit_depth",
    )

    gamma: float = parameter(1.0, "γ", "1", 0.1, 10, "exponent of the output over the linear signal")
    bow: float = parameter(0.0, "c", "1", -1, 1, "four times what half the range is off a straight line by")
    skew: float = parameter(
        0.0, "s", "1", -1, 1, "how much more it is bowed in the lower half than in the upper"
    )
    response: Response = Response.LINEAR
    lut: tuple[float, ...] = ()
    bits_out: int = 0  # 0 is as many as the converter has

    def __post_init__(self) -> None:
        super().__post_init__()
        freeze_word(self, "response", Response)
        freeze_numbers(self, lut=None)

    @property
    def is_there(self) -> bool:
        straight = self.gamma == 1.0 and self.bow == 0 and self.skew == 0
        return not straight or self.response is not Response.LINEAR or self.bits_out > 0

    @property
    def bends_in_the_dark(self) -> bool:
        """Whether it is so steep there that the mean of noise is another than it makes of the noise's mean."""
        return self.response in (Response.SRGB, Response.REC709) or self.gamma < STEEP

    def apply(self, image: Image, camera: Camera, rng: np.random.Generator | None) -> Image:
        bits = camera.sensor.bit_depth
        table = self.table(bits, camera.sensor.black_level)
        from interchange import kernels  # Numba comes with it

        flat = np.ascontiguousarray(image.pixels).reshape(-1)
        return replace(image, pixels=kernels.looked_up(flat, table).reshape(image.pixels.shape))

    def table(self, bits: int, black: float) -> np.ndarray:
        """(2^bits,) float32: the output DN of every linear one."""
        return _table(self, bits, self.bits_out or bits, black)

    def output(self, dn: np.ndarray, bits: int, black: float) -> np.ndarray:
        """Output DN of linear ``dn``, float64, neither rounded nor clipped but at the highest signal."""
        top = 2**bits - 1
        x = (np.asarray(dn, np.float64) - black) / (top - black)
        y = black + (top - black) * np.sign(x) * self.curve(np.minimum(np.abs(x), 1))
        return y * ((2 ** (self.bits_out or bits) - 1) / top)

    def curve(self, x: np.ndarray) -> np.ndarray:
        """Output over its highest value, of linear signals x over theirs, both in [0, 1]."""
        x = np.asarray(x, np.float64) ** self.gamma
        x = x + x * (1 - x) * (self.bow + self.skew * (1 - 2 * x))
        if self.response is Response.SRGB:
            return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)
        if self.response is Response.REC709:
            return np.where(x < 0.018, 4.5 * x, 1.099 * x**0.45 - 0.099)
        if self.response is Response.LUT:
            return np.interp(x, np.linspace(0, 1, len(self.lut)), self.lut)
        return x


@lru_cache(maxsize=8)
def _table(curve: ResponseCurve, bits: int, bits_out: int, black: float) -> np.ndarray:
    """The output DN of every linear one."""
    y = curve.output(np.arange(2**bits), bits, black)
    return np.asarray(np.clip(np.rint(y), 0, 2**bits_out - 1), np.float32)
