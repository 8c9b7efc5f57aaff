"""Large sensors are diagnosed by means over n x n of their pixels, as a sensor that bins n x n would have taken them.

The fit takes no more than some thousand pixels of a condition anyway (analysis.gap.normal_equations): means lose
nothing of what is wider than a few pixels, have 1/n of the noise, and need 1/n² of the memory and of the time. A
binning sensor has n² of each pixel's electrons and its own share of noise; what is told in its pixels, its electrons or
a row's time is told in those of the sensor's own pixels afterwards. What codes alone show (quantisation, JPEG) is lost.

EMVA Standard 1288, release 4.0: a pixel of a camera that bins is what it reads out.
"""

from collections.abc import Mapping
from dataclasses import replace
from math import ceil, sqrt

import numpy as np

from analysis.gap.expected import SATURATED
from analysis.gap.reach import cropped
from interchange.camera import Camera
from interchange.captures import Capture, Captures
from interchange.effects import MODELS
from interchange.formats.document import Document
from interchange.parameter import parameters
from interchange.problems import BrightfieldError
from interchange.scene import Scene

LARGEST = 800_000  # pixels of a capture that are each taken by itself
FEWEST = 16  # columns or rows that means are left in
# what a number of a sensor that bins n x n is over that of its own pixels, as a power of n; what has no line: 0
OF_SENSOR = {
    "responsivity": 2, "full_well": 2, "dark_current": 2, "read_noise": 1, "dsnu": 1, "prnu": -1,
    "row_noise": 1.5, "column_noise": 1.5, "dsnu_row": 1.5, "dsnu_column": 1.5, "prnu_row": -0.5, "prnu_column": -0.5,
}  # fmt: skip
LENGTHS = {"px": -1.0, "px/s": -1.0, "px^2": -2.0}
OF_EFFECT: dict[str, dict[str, float]] = {
    "black_level": {"dark_current": 2},
    "sensor_noise": {"K": -2, "read_noise": 1, "dark_current": 2},
    "fixed_pattern": {n: OF_SENSOR[n] for n in OF_SENSOR if n.startswith(("prnu", "dsnu"))},
    "saturation": {"full_well": 2},
    "line_noise": {"row": 1.5, "column": 1.5},
    "hot_pixels": {"share": 2},
    "rolling_shutter": {"line_time": 1},
}


def times_binned(captures: Captures, document: Document) -> int:
    """The least n by which no capture has more than ``LARGEST`` means; 1 where a camera's pixels cannot be binned."""
    most = max(c.pixels.shape[0] * c.pixels.shape[1] for c in captures.captures)
    cameras = {c.camera for c in captures.captures}
    if not all(_can_be_binned(c) for c in document.scene().cameras if c.name in cameras):
        return 1
    return max(ceil(sqrt(most / LARGEST)), 1)


def _can_be_binned(camera: Camera) -> bool:
    return not camera.sensor.mosaic.is_bayer and not camera.lens.measured_blur


def power(effect: str, parameter: str, unit: str) -> float:
    """Of n, that a parameter of an effect is multiplied by where n x n pixels are one."""
    return OF_EFFECT.get(effect, {}).get(parameter, LENGTHS.get(unit, 0.0))


def of_own_pixels(effect: str, values: Mapping[str, tuple[float, str]], n: int) -> dict[str, float]:
    """{parameter: value} of an effect on a sensor's own pixels; ``values``: the same, and units, of n x n as one."""
    own = {k: x * float(n) ** -power(effect, k.rpartition(" ")[2], unit) for k, (x, unit) in values.items()}
    if effect == "sensor_noise" and {"K", "read_noise"} <= set(own):
        own["read_noise"] = sqrt(own["read_noise"] ** 2 + n**2 * rounding(n) / own["K"] ** 2)
    return own


def rounding(n: int) -> float:
    """DN² by which a code's rounding, which the sensor's model has, exceeds that of a mean of n x n codes."""
    return (1 - n**-2) / 12


def binned_camera(camera: Camera, n: int) -> Camera:
    """The camera with n x n pixels read out as one; columns and rows that are left over are not."""
    s = camera.sensor
    if not _can_be_binned(camera):
        what = "a mosaic of colours" if s.mosaic.is_bayer else "a measured blur"
        raise BrightfieldError(f"Pixels of {camera.name}, which has {what}, cannot be binned.")
    if min(s.resolution) // n < FEWEST:
        w, h = s.resolution
        raise BrightfieldError(f"--bin {n} leaves less than {FEWEST} of the {w} x {h} px of {camera.name}.")
    width, height = (x // n * n for x in s.resolution)
    camera = cropped(camera, slice(0, height), slice(0, width)).resized(width // n)
    numbers = {name: getattr(s, name) * n**k for name, k in OF_SENSOR.items()}
    share, dark = s.hot_pixels
    binned = replace(camera.sensor, **numbers, hot_pixels=(min(share * n**2, 1.0), dark))
    read = (binned.K * binned.read_noise) ** 2 - rounding(n)
    binned = replace(binned, read_noise=sqrt(max(read, 0.0)) / binned.K)
    camera = replace(camera, sensor=binned)
    for model in MODELS.values():
        if not model.carried_by:
            continue
        effect = model.of(camera)
        lengths = {name: getattr(effect, name) / n for name, about in parameters(model).items()
                   if name in model.carried_by and about.unit in LENGTHS}  # fmt: skip
        if any(lengths.values()):
            camera = replace(effect, **lengths).on(camera)  # type: ignore[type-var]
    return camera


def binned_scene(scene: Scene, n: int) -> Scene:
    """The scene with its cameras binned, as far as their pixels can be."""
    cameras = tuple(binned_camera(c, n) if _can_be_binned(c) else c for c in scene.cameras)
    return replace(scene, cameras=cameras)


def binned_captures(captures: Captures, document: Document, n: int) -> Captures:
    """Means over n x n pixels. A pixel at which one of them is saturated or masked is left out: there the mean is no
    linear sum of light.

    Raises BrightfieldError where a camera's pixels cannot be binned."""
    tolerances = captures.tolerances
    used = {c.camera for c in captures.captures}
    cameras = [binned_camera(c, n) for c in document.scene().cameras if c.name in used]
    top = {c.name: 2**c.sensor.bits_out - 1 for c in cameras}
    return replace(
        captures,
        captures=tuple(_binned(c, n, SATURATED * top[c.camera]) for c in captures.captures),
        tolerances=replace(tolerances, registration_px=tolerances.registration_px / n),
    )


def _binned(capture: Capture, n: int, saturated: float) -> Capture:
    h, w = (x // n * n for x in capture.pixels.shape[:2])
    parts = capture.pixels[:h, :w].reshape(h // n, n, w // n, n, -1)
    whole = np.ones((h, w), bool) if capture.mask is None else capture.mask[:h, :w]
    mask = whole.reshape(h // n, n, w // n, n).all(axis=(1, 3)) & (parts.max(axis=(1, 3, 4)) < saturated)
    means = parts.mean(axis=(1, 3), dtype=np.float64).astype(np.float32)
    return replace(capture, pixels=means, mask=mask, bits=0)


class BinnedDocument(Document):
    """A scene file whose cameras bin n x n pixels; the stage is the file's own."""

    def __init__(self, document: Document, n: int) -> None:
        super().__init__(document.stage, document.path, document.problems)
        self.own, self.n = document, n

    def scene(self, time: float | None = None) -> Scene:
        return binned_scene(self.own.scene(time), self.n)


def binned_document(document: Document, n: int) -> Document:
    return document if n == 1 else BinnedDocument(document, n)
