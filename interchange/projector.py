"""A projector: a camera that emits. What its lens would image onto a pixel, it lights with that pixel's value.

    I(ω) = intensity · image(pixel),     pixel = K · distort(x / z, y / z)

The image gives radiant intensity, W/sr, by direction: no cos⁴ is in it (a real projector's fall-off belongs into the
image). A plane across the axis at distance h then has E = I cos³ θ / h², and a pixel's power is I times its solid
angle, cos³ θ / (f_x f_y) near the axis of an undistorted lens. Light comes from one point: everything is in focus.
"""

from dataclasses import dataclass

import numpy as np

from interchange.camera import Camera, Projection
from interchange.distortion import LensModel, distort, tilted, undistort
from interchange.material import Texture, Wrap, evaluate_texture
from interchange.problems import BrightfieldError

BORDER = 64  # points along each side of the image at which its field is measured


@dataclass(frozen=True, eq=False)
class Projector:
    """``image``: values over the pixels, bilinear between their centres, dark outside; its top row is seen on top by
    whoever stands behind the projector with +y of the light's frame up. ``K`` (3, 3) px and ``distortion`` as a
    camera's, whose pixel (0, 0) is the centre of the top-left one. Compared by identity.
    """

    image: Texture
    K: np.ndarray
    distortion: tuple[float, ...] = ()
    model: LensModel = LensModel.OPENCV

    @property
    def resolution(self) -> tuple[int, int]:
        """Width and height, px."""
        height, width = self.image.pixels.shape[:2]
        return width, height

    def pixels(self, direction: np.ndarray) -> np.ndarray:
        """Pixels (..., 2) that light ``direction`` (..., 3) of the light's frame, which shines along -z; NaN behind."""
        x, y, z = direction[..., 0], -direction[..., 1], -direction[..., 2]
        ahead = np.where(z > 1e-9, z, np.nan)
        u, v = distort(x / ahead, y / ahead, self.distortion, self.model)
        return np.stack([self.K[0, 0] * u + self.K[0, 2], self.K[1, 1] * v + self.K[1, 2]], axis=-1)

    def directions(self, pixels: np.ndarray) -> np.ndarray:
        """Unit directions (..., 3) of the light's frame that ``pixels`` (..., 2) light; NaN where there is none."""
        K = self.K
        u, v = (pixels[..., 0] - K[0, 2]) / K[0, 0], (pixels[..., 1] - K[1, 2]) / K[1, 1]
        x, y = undistort(u, v, self.distortion, self.model)
        d = np.stack([x, -y, -np.ones_like(x)], axis=-1)
        return d / np.linalg.norm(d, axis=-1, keepdims=True)

    def evaluate(self, direction: np.ndarray) -> np.ndarray:
        """The image's value (..., 3) in ``direction`` (..., 3)."""
        width, height = self.resolution
        p = self.pixels(direction)
        inside = np.isfinite(p).all(axis=-1)
        p = np.where(inside[..., None], p, -2.0)
        uv = np.stack([(p[..., 0] + 0.5) / width, 1 - (p[..., 1] + 0.5) / height], axis=-1)
        return np.broadcast_to(evaluate_texture(self.image, uv), (*uv.shape[:-1], 3)) * inside[..., None]

    def border(self) -> np.ndarray:
        """(N, 3) directions of the image's outer border, half a pixel beyond it; those that the lens has."""
        width, height = self.resolution
        t = np.linspace(0, 1, BORDER)
        x, y = -1 + t * (width + 1), -1 + t * (height + 1)
        sides = [(x, 0 * x - 1), (x, 0 * x + height), (0 * y - 1, y), (0 * y + width, y)]
        d = self.directions(np.concatenate([np.stack(s, axis=-1) for s in sides]))
        return d[np.isfinite(d).all(axis=-1)]

    def field(self) -> float:
        """Radians from the axis to the farthest corner of the image: beyond it the lens model has no meaning, and may
        fold back."""
        d = self.border()
        if not len(d):
            return np.pi / 2
        return float(np.arccos(np.clip(np.min(-d[:, 2]), -1, 1)))

    def numbers(self) -> np.ndarray:
        """(28,) for shaders: fx fy cx cy, twelve of the distortion, the tilt (3 x 3), fisheye?, width, height."""
        d = np.zeros(14)
        d[: len(self.distortion)] = self.distortion
        H = tilted(*d[12:]) if self.model is LensModel.OPENCV else np.eye(3)
        K = self.K
        width, height = self.resolution
        head = [K[0, 0], K[1, 1], K[0, 2], K[1, 2], *d[:12], *H.ravel()]
        return np.array([*head, float(self.model is LensModel.FISHEYE), float(width), float(height)])


def of_camera(camera: Camera, image: np.ndarray, file: str = "") -> Projector:
    """The projector with a camera's lens that shows ``image`` (h, w, 1 or 3), linear, of the sensor's resolution.

    Raises BrightfieldError where the two do not fit, or the camera is telecentric.
    """
    pixels = np.asarray(image, np.float32)
    width, height = camera.sensor.resolution
    if pixels.ndim != 3 or pixels.shape[:2] != (height, width) or pixels.shape[2] not in (1, 3):
        raise BrightfieldError(
            f"A projector's image must have its {width} x {height} px and 1 or 3 channels; got {pixels.shape}."
        )
    if camera.lens.projection is not Projection.PERSPECTIVE:
        raise BrightfieldError(f"A projector must be perspective; got {camera.lens.projection}.")
    texture = Texture(pixels, (Wrap.BLACK, Wrap.BLACK), file)
    return Projector(texture, camera.K, camera.lens.distortion, camera.lens.model)
