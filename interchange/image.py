"""An image whose numbers have a unit, with the passes that say what each pixel shows.

Passes (all optional, at the image's resolution, sampled at pixel centres unless said):

| name | array | meaning |
|---|---|---|
| ``depth`` | (H, W) float32 | m along the camera's axis; inf where nothing is hit |
| ``position`` | (H, W, 3) float32 | world, m; NaN where nothing is hit |
| ``normal`` | (H, W, 3) float32 | world, unit, shading normal, on the side that is seen; NaN likewise |
| ``object_id`` | (H, W) int32 | index into ``object_names``; -1 where nothing is hit |
| ``material_id`` | (H, W) int32 | index into ``material_names``; -1 likewise |
| ``motion`` | (H, W, 2) float32 | px that the surface point moves (column, row) until the next frame |
| ``direct`` | (H, W, 3) float32 | radiance by light straight from lamps (and emission), pixel mean |
| ``indirect`` | (H, W, 3) float32 | radiance by light that met other surfaces first, pixel mean |
| ``lit:NAME`` | (H, W) float32 | share of lamp NAME that is seen: 0 in shadow, 1 lit; 0 facing away |
| ``light:NAME`` | (H, W, 3) float32 | radiance by lamp NAME alone, pixel mean |
"""

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np

from interchange.camera import Camera
from interchange.problems import BrightfieldError


class Quantity(StrEnum):
    RADIANCE = "radiance"  # W m⁻² sr⁻¹ a channel
    IRRADIANCE = "irradiance"  # W m⁻² on the sensor
    ELECTRONS = "electrons"  # e-
    DN = "DN"

    @property
    def unit(self) -> str:
        return {"radiance": "W/(m^2 sr)", "irradiance": "W/m^2", "electrons": "e-", "DN": "DN"}[self.value]


PASSES = (
    "depth",
    "position",
    "normal",
    "object_id",
    "material_id",
    "motion",
    "direct",
    "indirect",
    "lit",
    "light",
)


@dataclass(frozen=True, eq=False)
class Image:
    pixels: np.ndarray  # (H, W, C) float32
    quantity: Quantity = Quantity.RADIANCE
    camera: Camera | None = None
    made_by: dict[str, Any] = field(default_factory=dict)  # renderer, settings, scene digest, seed, time
    passes: dict[str, np.ndarray] = field(default_factory=dict)
    object_names: tuple[str, ...] = ()
    material_names: tuple[str, ...] = ()
    first_row: int = 0  # where the pixels begin in the camera's image, for a band of its rows


def check_passes(names: tuple[str, ...] | list[str]) -> tuple[str, ...]:
    """The asked-for passes, or one error that names the unknown ones. ``all`` stands for every pass but ``light``."""
    if "all" in names:
        names = [*(p for p in PASSES if p != "light"), *(n for n in names if n != "all")]
    unknown = [n for n in names if n not in PASSES]
    if unknown:
        raise BrightfieldError(f"Unknown pass {', '.join(unknown)}; there are {', '.join(PASSES)} and all.")
    return tuple(dict.fromkeys(names))


def same_quantity(a: Image, b: Image) -> None:
    """Raise unless two images may be compared number by number."""
    if a.quantity is not b.quantity or a.pixels.shape != b.pixels.shape:
        raise BrightfieldError(
            f"Images compare only with the same quantity and size; got {a.quantity} {a.pixels.shape} "
            f"and {b.quantity} {b.pixels.shape}."
        )
