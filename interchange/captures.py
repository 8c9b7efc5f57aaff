"""Captures: what a real camera gave, and what of the scene each image shows. ``captures.json`` of the file contract."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from interchange.parameter import freeze, parameter
from interchange.problems import Where


@dataclass(frozen=True)
class Tolerances:
    """One standard deviation of what the scene file claims, from how it was calibrated."""

    registration_px: float = parameter(0.05, "σ_px", "px", 0, 100, "where a surface point is imaged")
    light_intensity: float = parameter(0.005, "σ_I", "1", 0, 10, "intensity of a lamp, relative")
    light_position_mm: float = parameter(0.5, "σ_p", "mm", 0, 1e4, "position of a lamp, an axis")
    flat_field: float = parameter(0.003, "σ_F", "1", 0, 10, "smooth unevenness fixed to the image, relative")
    black_level_dn: float = parameter(1.0, "σ_0", "DN", 0, 65535, "black level")
    albedo: float = parameter(0.005, "σ_ρ", "1", 0, 10, "reflectance of a material, relative")
    gloss: float = parameter(0.02, "σ_g", "1", 0, 10, "width of a highlight, relative")
    object_pose_mm: float = parameter(0.05, "σ_o", "mm", 0, 1e4, "position of an object, an axis")

    def __post_init__(self) -> None:
        freeze(self)


@dataclass(frozen=True, eq=False)
class Capture:
    """``pixels`` (H, W, 1) or (H, W, 3) float32, DN; ``mask`` (H, W) bool, False leaves a pixel out.

    ``time``: time code of the scene; ``exposure`` s; ``gain_dB`` None is the camera's own; ``bits`` of the file,
    0 for floats. ``jpeg``: libjpeg's quality, and whether colour is at half the resolution, of a JPEG file.
    ``computed``: pixels are no longer the file's own numbers.
    """

    image: str
    camera: str
    time: float
    exposure: float
    pixels: np.ndarray
    gain_dB: float | None = None
    mask: np.ndarray | None = None
    bits: int = 16
    jpeg: tuple[int, bool] | None = None
    computed: bool = False
    where: Where = field(default=Where(), compare=False)

    @property
    def has_codes(self) -> bool:
        """Whether pixels are integers that a file had."""
        return self.bits > 0 and not self.computed


@dataclass(frozen=True, eq=False)
class Captures:
    """``holdout``: images that nothing may be fitted to; empty leaves the choice to whoever fits."""

    file: Path
    scene: Path
    captures: tuple[Capture, ...]
    holdout: tuple[str, ...] = ()
    tolerances: Tolerances = field(default_factory=Tolerances)
