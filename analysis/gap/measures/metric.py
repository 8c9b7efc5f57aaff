"""The user's own measure of an image, on captures and on simulations before and after: a diameter, a defect score.

A function ``image -> number`` or ``(image, camera) -> number``; ``image`` (H, W, C) float32 DN, ``camera`` an
interchange.camera.Camera with the capture's exposure.
"""

import inspect
import math
import numbers
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.users_own import users_own
from interchange.camera import Camera
from interchange.problems import BrightfieldError

Measure = Callable[[np.ndarray, Camera], float]


@dataclass(frozen=True)
class Reading:
    """What one held-out capture and its simulations measure."""

    image: str
    capture: float
    as_written: float
    before: float
    after: float


@dataclass(frozen=True)
class Metric:
    """The measure ``name`` on every held-out capture; errors are simulation less capture."""

    name: str
    readings: tuple[Reading, ...]

    def error(self, which: str) -> float:
        """rms error of "as_written", "before" or "after" over the held-out captures."""
        return float(np.sqrt(np.mean([(getattr(r, which) - r.capture) ** 2 for r in self.readings])))


def load(name: str) -> Measure:
    """The function ``module:function``, the working directory being searched first.

    Raises BrightfieldError where there is none, or where it takes neither one nor two arguments.
    """
    return _with_camera(users_own(name, "A metric"), name)


def _with_camera(function: Callable[..., Any], name: str) -> Measure:
    try:
        places = [
            p
            for p in inspect.signature(function).parameters.values()
            if p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD)
        ]
        required = sum(p.default is p.empty for p in places)
    except ValueError:  # a built-in that does not tell
        places, required = [], 1
    if required > 2 or (places == [] and required == 0):
        raise BrightfieldError(f'The metric "{name}" must take an image, or an image and a camera.')
    both = required == 2 or (len(places) > 1 and places[1].name == "camera")

    def measure(image: np.ndarray, camera: Camera) -> float:
        try:
            value = function(image, camera) if both else function(image)
        except Exception as error:  # the user's own function may raise anything
            raise BrightfieldError(f'The metric "{name}" failed: {type(error).__name__}: {error}.') from None
        if isinstance(value, np.ndarray) and value.size == 1:
            value = value.item()
        if (
            isinstance(value, bool | np.bool_)
            or not isinstance(value, numbers.Real)
            or not math.isfinite(value)
        ):
            raise BrightfieldError(f'The metric "{name}" must give a finite number; got {value!r:.80}.')
        return float(value)

    return measure


def measured(
    name: str,
    measure: Measure,
    held_out: Sequence[Condition],
    as_written: Sequence[np.ndarray],
    before: Sequence[np.ndarray],
    after: Sequence[np.ndarray],
) -> Metric:
    """``measure`` on each held-out capture and on the mean DN (H, W, C) that each simulation expects of it."""
    readings = []
    for k, c in enumerate(held_out):
        top = 2**c.camera.sensor.bits_out - 1
        said = [
            measure(np.clip(images[k], 0, top).astype(np.float32), c.camera)
            for images in (as_written, before, after)
        ]
        readings += [Reading(x.image, measure(x.pixels, c.camera), *said) for x in c.captures]
    return Metric(name, tuple(readings))
