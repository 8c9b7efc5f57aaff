"""Noise that the read-out of a row or of a column has as a whole, other in every frame.

    e' = e + r(v) + c(u),    r ~ N(0, σ_row²), c ~ N(0, σ_col²)

one number a row and one a column: banding. What stays from frame to frame is ``fixed_pattern``'s.
"""

from dataclasses import dataclass, replace

import numpy as np

from interchange.camera import Camera
from interchange.effects.base import Effect, Stage, carried
from interchange.image import Image
from interchange.parameter import parameter


@dataclass(frozen=True)
class LineNoise(Effect):
    stage = Stage.SENSOR
    order = 42
    source = (
        "EMVA Standard 1288, release 4.0 Linear, 2021, section 4 (of rows and columns), here of one frame."
    )
    identified_by = "Whole rows or columns are off together, others in every repeat of one scene."
    confused_with = ("fixed_pattern", "sensor_noise")
    separated_by = "eight repeats or more with the lens covered"
    carried_by = carried(row="sensor.row_noise", column="sensor.column_noise")

    row: float = parameter(0.0, "σ_row", "e-", 0, 1e6, "temporal noise that a row has in common, rms")
    column: float = parameter(0.0, "σ_col", "e-", 0, 1e6, "temporal noise that a column has in common, rms")

    def apply(self, image: Image, camera: Camera, rng: np.random.Generator | None) -> Image:
        if rng is None:
            return image
        height, width, channels = image.pixels.shape
        rows, columns = self.lines(height, width * channels, rng)
        return replace(image, pixels=image.pixels + rows[:, None, None] + columns.reshape(1, width, channels))

    def lines(self, height: int, width: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """(height,) and (width,) float32 e-, one draw."""
        rows, columns = rng.standard_normal(height, np.float32), rng.standard_normal(width, np.float32)
        return rows * np.float32(self.row), columns * np.float32(self.column)
