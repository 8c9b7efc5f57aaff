"""Pattern and line projectors as lamps, and the patterns that they show.

A projector is a camera that emits (``interchange.projector``): build the camera that has its lens and its panel's
resolution, and give it an image.
"""

from dataclasses import replace

import numpy as np

from interchange.camera import Camera
from interchange.effects.defocus import Defocus
from interchange.filtering import convolve, disc
from interchange.frames import camera_from_gl
from interchange.lamps.placing import WHITE, Color, require
from interchange.light import Light, LightKind
from interchange.power import intensity_from_power
from interchange.problems import BrightfieldError
from interchange.projector import of_camera


def projector(
    camera: Camera,
    image: np.ndarray,
    intensity: float | None = None,
    power: float | None = None,
    color: Color = WHITE,
    file: str = "",
    name: str = "/projector",
) -> Light:
    """The lamp that stands where ``camera`` stands and lights what it sees with ``image`` (h, w, 1 or 3), linear.

    ``intensity``: W/sr where the image is 1; or ``power``: W of all of it (``power.intensity_from_power``). ``file``:
    where the image is kept, for USD. Raises BrightfieldError unless one of the two is given.
    """
    if (intensity is None) == (power is None):
        raise BrightfieldError(f"A projector must have an intensity or a power, one of them. ({name})")
    shown = of_camera(camera, image, file)
    light = Light(
        name,
        LightKind.SPHERE,
        WHITE,
        camera.world_from_camera @ camera_from_gl,
        cone_angle=min(shown.field() + 1e-6, np.pi / 2),
        projector=shown,
    )
    if power is not None:
        return replace(light, intensity=intensity_from_power(light, power, color))
    r, g, b = float(intensity or 0.0) * np.asarray(color)
    return replace(light, intensity=(float(r), float(g), float(b)))


def defocused(image: np.ndarray, camera: Camera, distance: float) -> np.ndarray:
    """``image`` (h, w, C) as it lies on a surface at ``distance`` m along the axis of a projector whose lens has
    ``camera.lens``'s aperture and focus: each pixel is a disc of Defocus.confusion's diameter (thin lens).

    Give it to ``projector``. Both renderers emit from one point, so other distances have the same blur in pixels; light
    that leaves the panel's field is lost. Raises BrightfieldError without an f-number and a focus.
    """
    lens = camera.lens
    if lens.f_stop <= 0 or lens.focus_distance <= 0:
        raise BrightfieldError("A projector's blur needs an f-number and a distance in focus.")
    require("A surface's distance", distance, 0, unit="m")
    defocus = Defocus(f_stop=lens.f_stop, focus_distance=lens.focus_distance)
    kernel = disc(float(abs(defocus.confusion(np.array(distance), camera))))
    half = len(kernel) // 2
    dark = np.pad(np.asarray(image, np.float32), ((half, half), (half, half), (0, 0)))
    return convolve(dark, kernel)[half : half + len(image), half : half + image.shape[1]]


def stripes(
    resolution: tuple[int, int], period: float, phase: float = 0.0, vertical: bool = True
) -> np.ndarray:
    """(h, w, 1) fringes (1 + cos(2π (column / period) + phase)) / 2, as phase-shift profilometry shows them."""
    width, height = resolution
    require("A fringe's period", period, 0, unit="px")
    at = np.arange(width if vertical else height)
    row = (1 + np.cos(2 * np.pi * at / period + phase)) / 2
    image = np.broadcast_to(row[None, :] if vertical else row[:, None], (height, width))
    return np.asarray(image[..., None], np.float32)


def gray_code(resolution: tuple[int, int], vertical: bool = True) -> tuple[np.ndarray, ...]:
    """(h, w, 1) each: the bits of the columns' (rows') Gray code, most significant first."""
    width, height = resolution
    at = np.arange(width if vertical else height)
    code = at ^ (at >> 1)
    found = []
    for bit in range(int(len(at) - 1).bit_length() - 1, -1, -1):
        row = ((code >> bit) & 1).astype(np.float32)
        image = np.broadcast_to(row[None, :] if vertical else row[:, None], (height, width))
        found.append(np.ascontiguousarray(image[..., None]))
    return tuple(found)


def laser_line(
    resolution: tuple[int, int], width: float, at: float | None = None, vertical: bool = True
) -> np.ndarray:
    """(h, w, 1) one line, Gaussian across with ``width`` px between the places of e⁻² of the peak (1), at pixel
    ``at``; in the middle where it is not given."""
    columns, rows = resolution
    require("A laser line's width", width, 0, unit="px")
    count = columns if vertical else rows
    middle = (count - 1) / 2 if at is None else at
    row = np.exp(-2 * ((np.arange(count) - middle) / (width / 2)) ** 2)
    image = np.broadcast_to(row[None, :] if vertical else row[:, None], (rows, columns))
    return np.asarray(image[..., None], np.float32)
