"""A frame of a series: its image in grey levels, what it truly shows, and what was varied to make it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from analysis.tune.algorithms.template_match import Pattern
from analysis.tune.truth import Truth
from interchange.camera import Camera
from interchange.problems import BrightfieldError


@dataclass(frozen=True, eq=False)
class Frame:
    """``image`` (H, W) float32, grey levels of 8 bits; ``usable`` (H, W) bool or None for all of it; ``variation``:
    what was varied, by name; ``weight``: how often there is such a frame, over how often it is in the series."""

    name: str
    image: np.ndarray
    camera: Camera
    truth: Truth
    variation: Mapping[str, float] = field(default_factory=dict)
    usable: np.ndarray | None = None
    weight: float = 1.0


def grey_levels(pixels: np.ndarray, bits: int) -> np.ndarray:
    """(H, W) float32 in [0, 255] of DN (H, W, C) with ``bits``."""
    return (np.asarray(pixels, np.float32).mean(axis=2) * np.float32(255 / (2**bits - 1))).astype(np.float32)


def with_what_varies(frames: Sequence[Frame]) -> list[Frame]:
    """The frames with those variations alone that differ between them; ``time`` only where nothing else does."""
    names = [n for n in frames[0].variation if all(n in f.variation for f in frames)] if frames else []
    values = {n: np.array([f.variation[n] for f in frames]) for n in names}
    differ = [n for n, v in values.items() if np.ptp(v) > 1e-6 * max(float(np.abs(v).max()), 1e-12)]
    if set(differ) - {"time"}:
        differ = [n for n in differ if n != "time"]
    return [replace(f, variation={n: f.variation[n] for n in differ}) for f in frames]


def pattern_of(frame: Frame, name: str) -> tuple[Pattern, np.ndarray]:
    """The template of a pattern, cut from a frame at its whole pixels and looked for where it is; and the pattern's
    middle less the template's (2,), px. Raises BrightfieldError where it is not seen as a whole."""
    square = frame.truth.patterns[name]
    h, w = frame.image.shape
    side = round(square.side) if np.isfinite(square.side) else 0
    column, row = (round(v - (side - 1) / 2) if np.isfinite(v) else -1 for v in square.middle)
    if side < 4 or column < 0 or row < 0 or column + side > w or row + side > h:
        x, y = square.middle
        raise BrightfieldError(
            f'The pattern "{name}" must be seen as a whole and be 4 px wide or more in {frame.name}; it is {side} px '
            f"wide at ({x:.0f}, {y:.0f})."
        )
    middle = (column + (side - 1) / 2, row + (side - 1) / 2)
    pixels = frame.image[row : row + side, column : column + side]
    return Pattern(pixels, square.middle), np.asarray(square.middle) - middle
