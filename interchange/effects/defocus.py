"""What is out of focus: a thin lens draws a point at depth z as a disc; or a given blur of the whole image.

    c = v² |z - z_f| / (N z_f z)     diameter on the sensor, v the principal distance (both renderers' thin lens)

and rms ``blur`` px of a Gaussian, alike everywhere. Where it adds depth of field, the aberrations of ``field_blur``
are of the same rays: their diameters add to c with its sign, positive behind the focus, before anything is squared.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from interchange.camera import Camera, Projection
from interchange.effects.base import Effect, Stage, carried
from interchange.filtering import applied, convolve, disc, gaussian
from interchange.image import Image
from interchange.parameter import parameter
from interchange.problems import BrightfieldError

STEP = 0.5  # px between the diameters of two layers
MOST_LAYERS = 48


@dataclass(frozen=True)
class Defocus(Effect):
    """Depth of field is the renderer's where it drew it (``image.camera`` has an f-number); it is added here to an
    image of a pinhole, from its pass ``depth``."""

    stage = Stage.OPTICS
    order = 40
    source = "Potmesil, Chakravarty: A lens and aperture camera model for synthetic image generation. SIGGRAPH 1981."
    identified_by = (
        "All edges blur, of objects as of shadows, the more the farther from the distance in focus."
    )
    confused_with = ("motion_blur", "light_size", "translucency", "diffraction")
    separated_by = "edges at a second distance, in two orientations"
    achromatic = True
    carried_by = carried(blur="lens.blur", f_stop="lens.f_stop", focus_distance="lens.focus_distance")

    blur: float = parameter(0.0, "σ", "px", 0, 100, "blur of the whole image, Gaussian, rms")
    f_stop: float = parameter(0.0, "N", "1", 0, 1e3, "f-number; 0 is a pinhole")
    focus_distance: float = parameter(0.0, "z_f", "m", 0, 1e6, "distance in focus; 0 is not set")

    @property
    def is_there(self) -> bool:
        return self.blur > 0 or (self.f_stop > 0 and self.focus_distance > 0)

    def apply(self, image: Image, camera: Camera, rng: np.random.Generator | None) -> Image:
        pixels = image.pixels
        if self.adds_depth_of_field(image):
            if (depth := image.passes.get("depth")) is None:
                raise BrightfieldError(
                    f"Defocus at f/{self.f_stop:g} of an image that was rendered without it needs its pass depth."
                )
            pixels = _by_depth(pixels, self.confusion(depth, camera), partial(_out_of_focus, camera))
        if self.blur > 0:
            pixels = convolve(pixels, gaussian(self.blur))
        return replace(image, pixels=pixels)

    def kernels(self, image: Image, camera: Camera) -> list[np.ndarray] | None:
        return (
            None if self.adds_depth_of_field(image) else [gaussian(self.blur)] if self.blur else [disc(0.0)]
        )

    def adds_depth_of_field(self, image: Image) -> bool:
        """Whether there is a depth of field, which the image's renderer has not drawn."""
        drawn = (
            image.camera is not None and image.camera.lens.f_stop > 0 and image.camera.lens.focus_distance > 0
        )
        return self.f_stop > 0 and self.focus_distance > 0 and not drawn

    def confusion(self, depth: np.ndarray, camera: Camera) -> np.ndarray:
        """Diameter of the disc, px, of points at ``depth`` m along the axis; negative in front of the focus."""
        if camera.lens.projection is not Projection.PERSPECTIVE:
            raise BrightfieldError("Defocus by depth needs a perspective lens; this one is telecentric.")
        v, z_f = camera.lens.focal_length, self.focus_distance
        pitch = float(np.mean(camera.sensor.pixel_pitch))
        with np.errstate(divide="ignore"):
            return (1 - z_f / np.asarray(depth, np.float64)) * v**2 / (self.f_stop * z_f * pitch)


def _out_of_focus(camera: Camera, pixels: np.ndarray, diameter: float) -> np.ndarray:
    """An image of one depth; ``diameter`` px, negative in front of the focus."""
    from interchange.effects.field_blur import FieldBlur  # which asks defocus whether it is to act by itself

    field = FieldBlur.of(camera)
    if not field.is_there:
        return convolve(pixels, disc(abs(diameter)))
    bent = replace(field, axis=float(np.clip(field.axis + diameter, -100, 100)))
    return applied(pixels, [bent.over_field(camera)])


def _by_depth(
    pixels: np.ndarray, confusion: np.ndarray, blurred: Callable[[np.ndarray, float], np.ndarray]
) -> np.ndarray:
    """Layers of like diameter, each blurred with its own cover, laid over each other from the farthest on.

    Each pixel is shared between the two layers next to it, so that a slope stays one surface. What a layer hides is
    not known and is taken from what surrounds it.
    """
    confusion = np.maximum(confusion, -max(pixels.shape))
    nearest, farthest = float(confusion.min()), float(confusion.max())
    count = int(np.clip(np.ceil((farthest - nearest) / STEP), 1, MOST_LAYERS)) + 1
    levels = _levels(nearest, farthest, count)
    at = np.interp(confusion, levels, np.arange(count)).astype(np.float32)
    total = np.zeros((*pixels.shape[:2], pixels.shape[2] + 1), np.float32)
    for k in range(count - 1, -1, -1):
        share = np.maximum(1 - np.abs(at - k), 0)
        if not share.any():
            continue
        layer = np.concatenate([pixels * share[..., None], share[..., None]], axis=-1)
        layer = blurred(layer, round(float(levels[k]), 2))
        total *= 1 - np.clip(layer[..., -1:], 0, 1)
        total += layer
    return total[..., :-1] / np.maximum(total[..., -1:], 1e-6)


def _levels(nearest: float, farthest: float, count: int) -> np.ndarray:
    """Rising diameters that include both ends, and 0 where it lies between them."""
    levels = np.linspace(nearest, farthest, count)
    if count > 2 and nearest < 0 < farthest:
        levels[1 + int(np.argmin(np.abs(levels[1:-1])))] = 0.0
    return levels
