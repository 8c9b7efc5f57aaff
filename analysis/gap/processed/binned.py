"""Large sensors are diagnosed by means over n x n of their pixels, as a sensor that bins n x n would have taken them;
those behind a mosaic of colours always, n being even: a pixel of three channels is what they are told of.

The fit takes no more than some thousand pixels of a condition anyway (analysis.gap.terms.normal_equations): means lose
nothing of what is wider than a few pixels, have 1/n of the noise, and need 1/n² of the memory and of the time. A
binning sensor has n² of each pixel's electrons and its own share of noise; of a mosaic (n/2)², as each channel is the
mean of so many of its pixels (analysis.gap.sensor.filters). What is told in its pixels, its electrons or a row's time
is told in those of the sensor's own pixels afterwards. What codes alone show is lost in means;
what a JPEG leaves in them is told of the own pixels (analysis.gap.processed.means).

EMVA Standard 1288, release 4.0: a pixel of a camera that bins is what it reads out.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from math import ceil, sqrt
from typing import Any

import numpy as np

from analysis.gap.light.reach import cropped
from analysis.gap.processed.declared import declared, of_bits
from analysis.gap.processed.encoded import is_linear
from analysis.gap.processed.matrices import encoded_above, linear_above
from analysis.gap.processed.mosaics import mosaic_of
from analysis.gap.processed.raw import raw, tells_its_pixels
from analysis.gap.processed.taken import Taken
from analysis.gap.processed.taken_as import Told, taken_for
from analysis.gap.sensor.expected import SATURATED
from analysis.gap.sensor.filters import Averaging, BehindFilters, sites
from interchange.camera import Camera, Sensor
from interchange.captures import Capture, Captures
from interchange.effects import MODELS
from interchange.formats.document import Document
from interchange.parameter import parameters
from interchange.problems import BrightfieldError
from interchange.scene import Scene
from interchange.sensor import IDENTITY, Demosaic, Mosaic

LARGEST = 800_000  # pixels of a capture that are each taken by itself
FEWEST = 16  # columns or rows that means are left in
# what a number of a sensor that bins is over that of its own pixels, as a power of how many a channel's mean is of
# along a side; what has no line: 0
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
}


@dataclass(frozen=True)
class Binning:
    """``n`` x ``n`` pixels as one; ``colours``: of a mosaic, of whose pixels each channel has a quarter. ``cameras``:
    by name, those that captures are of. ``undeclared``: by name, those whose captures were interpolated from a mosaic
    of which the scene file does not say (analysis.gap.processed.mosaics)."""

    n: int = 1
    colours: bool = False
    cameras: frozenset[str] = frozenset()
    undeclared: Mapping[str, tuple[Mosaic, Demosaic]] = field(default_factory=dict)

    @property
    def averaged(self) -> int:
        """Pixels of a channel's mean, along a side."""
        return self.n // 2 if self.colours else self.n

    def factor(self, effect: str, parameter: str, unit: str) -> float:
        """What a parameter of an effect is multiplied by where n x n pixels are one."""
        of_effect = OF_EFFECT.get(effect, {}).get(parameter)
        if of_effect is not None:
            return float(self.averaged) ** of_effect
        if (effect, parameter) == ("rolling_shutter", "line_time"):
            return float(self.n)
        return float(self.n) ** LENGTHS.get(unit, 0.0)

    def of_own_pixels(self, effect: str, values: Mapping[str, tuple[float, str]]) -> dict[str, float]:
        """{parameter: value} of an effect on a sensor's own pixels; ``values``: the same, and units, of binned ones."""
        return {k: x / self.factor(effect, k.rpartition(" ")[2], unit) for k, (x, unit) in values.items()}

    def on_scene(self, scene: Scene) -> Scene:
        """The scene with the mosaics that its file does not say, where pixels are taken to lie behind them."""
        return scene if not self.colours else _behind_mosaics(scene, self.undeclared)

    def document(self, document: Document) -> Document:
        """A scene file whose ``cameras`` bin; the stage is the file's own."""
        return document if self.n == 1 else Taken(document, self._binned)

    def _binned(self, scene: Scene) -> Scene:
        cameras = self.on_scene(scene).cameras
        return replace(
            scene, cameras=tuple(binned_camera(c, self.n) if c.name in self.cameras else c for c in cameras)
        )


def times_binned(captures: Captures, document: Document) -> int:
    """The least n by which no capture has more than ``LARGEST`` means, an even one of colour mosaics; 1 where a
    camera's pixels cannot be binned."""
    most = max(c.pixels.shape[0] * c.pixels.shape[1] for c in captures.captures)
    document = declared(captures, document).document(document)
    cameras = _cameras(captures, document, undeclared_mosaics(captures, document))
    if any(_why_not(captures, c) for c in cameras):
        return 1
    n = max(ceil(sqrt(most / LARGEST)), 1)
    return n + n % 2 if any(c.sensor.mosaic.is_bayer for c in cameras) else n


def binning_of(captures: Captures, document: Document, n: int) -> Binning:
    """Raises BrightfieldError where ``n`` x ``n`` pixels of the captures' cameras cannot be one. By ``n`` 1 each pixel
    is taken as the scene file says, whatever was interpolated."""
    undeclared = undeclared_mosaics(captures, document)
    cameras = _cameras(captures, document, undeclared if n > 1 else {})
    against = {c.name: why for c in cameras if (why := _why_not(captures, c))}
    if against and n > 1:
        name, why = next(iter(against.items()))
        raise BrightfieldError(f"Pixels of {name}, which has {why}, cannot be binned.")
    colours = sorted(c.name for c in cameras if c.sensor.mosaic.is_bayer and c.name not in against)
    names = frozenset(c.name for c in cameras)
    if not colours:
        return Binning(n, cameras=names, undeclared=undeclared)
    if len(colours) < len(cameras):
        raise BrightfieldError(
            f"Captures of colour mosaics ({', '.join(colours)}) and of other sensors must be diagnosed apart, in a "
            "captures.json each."
        )
    if n % 2:
        raise BrightfieldError(f"--bin must be even where pixels lie behind a mosaic of colours; got {n}.")
    return Binning(n, True, names, undeclared)


def undeclared_mosaics(captures: Captures, document: Document) -> dict[str, tuple[Mosaic, Demosaic]]:
    """By name the cameras whose captures were interpolated from a mosaic of which the scene file does not say; none
    where other cameras' were not, as both cannot be taken together."""
    cameras = _cameras(captures, document, {})
    found = {
        c.name: behind
        for c in cameras
        if (behind := mosaic_of([x for x in captures.captures if x.camera == c.name], c))
    }
    others = [c for c in cameras if c.name not in found and not c.sensor.mosaic.is_bayer]
    return {} if others else found


def _cameras(
    captures: Captures, document: Document, undeclared: Mapping[str, tuple[Mosaic, Demosaic]]
) -> list[Camera]:
    used = {c.camera for c in captures.captures}
    scene = _behind_mosaics(document.scene(), undeclared)
    return [c for c in scene.cameras if c.name in used]


def _behind_mosaics(scene: Scene, undeclared: Mapping[str, tuple[Mosaic, Demosaic]]) -> Scene:
    def there(camera: Camera) -> Camera:
        if camera.name not in undeclared or camera.sensor.mosaic is not Mosaic.NONE:
            return camera
        mosaic, demosaic = undeclared[camera.name]
        return replace(camera, sensor=replace(camera.sensor, mosaic=mosaic, demosaic=demosaic))

    return replace(scene, cameras=tuple(map(there, scene.cameras)))


def _why_not(captures: Captures, camera: Camera) -> str:
    """What keeps the captures' pixels from being binned; "" where nothing does."""
    if camera.lens.measured_blur:
        return "a measured blur"
    own = [c for c in captures.captures if c.camera == camera.name]
    if camera.sensor.mosaic.is_bayer and not all(tells_its_pixels(c, camera) for c in own):
        return "a mosaic of colours that is processed"
    return ""


def binned_camera(camera: Camera, n: int) -> Camera:
    """The camera with n x n pixels read out as one; columns and rows that are left over are not."""
    s = camera.sensor
    if min(s.resolution) // n < FEWEST:
        w, h = s.resolution
        raise BrightfieldError(f"--bin {n} leaves less than {FEWEST} of the {w} x {h} px of {camera.name}.")
    by = Binning(n, s.mosaic.is_bayer)
    width, height = (x // n * n for x in s.resolution)
    camera = cropped(camera, slice(0, height), slice(0, width)).resized(width // n)
    numbers = {name: getattr(s, name) * by.averaged**k for name, k in OF_SENSOR.items()}
    share, dark = s.hot_pixels
    hot = (min(share * by.averaged**2, 1.0), dark)
    # a JPEG's blocks are of the own pixels
    binned = replace(camera.sensor, **numbers, hot_pixels=hot, jpeg_quality=0)
    codes = by.averaged**2
    averaging = (
        _behind_filters(binned, n, codes) if by.colours else Averaging(**_numbers(binned), codes=codes)
    )
    camera = replace(camera, sensor=averaging)
    for model in MODELS.values():
        if not model.carried_by:
            continue
        effect = model.of(camera)
        lengths = {name: getattr(effect, name) / n for name, about in parameters(model).items()
                   if name in model.carried_by and about.unit in LENGTHS}  # fmt: skip
        if any(lengths.values()):
            camera = replace(effect, **lengths).on(camera)  # type: ignore[type-var]
    return camera


def _behind_filters(sensor: Sensor, n: int, codes: int) -> BehindFilters:
    plain = replace(sensor, mosaic=Mosaic.NONE, demosaic=Demosaic.NONE, color_correction=IDENTITY)
    return BehindFilters(**_numbers(plain), codes=codes, pattern=sensor.mosaic, across=n)


def _numbers(sensor: Sensor) -> dict[str, Any]:
    return {f.name: getattr(sensor, f.name) for f in fields(Sensor)}


def binned_captures(
    captures: Captures, document: Document, by: Binning, told: Sequence[Told] = ()
) -> Captures:
    """Means over n x n pixels, of each channel's own behind a mosaic: of light, which the DN of a camera with a curve
    are taken back to. A pixel at which one of them is saturated or masked is left out: there the mean is no linear sum
    of light.

    ``by``: as ``binning_of`` says; ``told``: what cameras' captures are otherwise than the scene says."""
    tolerances = captures.tolerances
    bits = {x.camera: x.bits for x in captures.captures}
    own = {
        c.name: taken_for(of_bits(c, bits[c.name]), told)
        for c in _cameras(captures, document, by.undeclared if by.colours else {})
    }
    return replace(
        captures,
        captures=tuple(_binned(c, own[c.camera], by) for c in captures.captures),
        tolerances=replace(tolerances, registration_px=tolerances.registration_px / by.n),
    )


def _binned(capture: Capture, camera: Camera, by: Binning) -> Capture:
    n, saturated = by.n, SATURATED * (2**camera.sensor.bits_out - 1)
    if by.colours:
        capture = raw(capture, camera)
    h, w = (x // n * n for x in capture.pixels.shape[:2])
    parts = capture.pixels[:h, :w].reshape(h // n, n, w // n, n, -1)
    whole = np.ones((h, w), bool) if capture.mask is None else capture.mask[:h, :w]
    mask = whole.reshape(h // n, n, w // n, n).all(axis=(1, 3)) & (parts.max(axis=(1, 3, 4)) < saturated)
    curved = by.averaged > 1 and not is_linear(camera.sensor)
    if curved:
        parts = _light(parts, capture, camera)
    if by.colours:
        own = [parts[:, i::2, :, j::2] for i, j in sites(camera.sensor.mosaic)]
        means = np.concatenate([x.mean(axis=(1, 3), dtype=np.float64) for x in own], axis=2)
    else:
        means = parts.mean(axis=(1, 3), dtype=np.float64)
    if curved:
        means = encoded_above(means, camera)
    computed = capture.computed or by.averaged > 1
    return replace(capture, pixels=means.astype(np.float32), mask=mask, jpeg=None, computed=computed)


def _light(dn: np.ndarray, capture: Capture, camera: Camera) -> np.ndarray:
    """DN above black before the camera's curve."""
    if not capture.has_codes:
        return linear_above(dn, camera)
    table = linear_above(np.arange(2**camera.sensor.bits_out), camera).astype(np.float32)
    return np.asarray(table[np.minimum(dn, len(table) - 1).astype(np.intp)])
