"""Light enters a material and leaves it some way off: what is lit bleeds into what is in shadow, inside one body.

B' = G_σ * B,    B the radiance of the material, G a Gaussian of rms σ over the surface
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from interchange.camera import Camera, Projection
from interchange.effects.base import Effect, Stage
from interchange.image import Image
from interchange.parameter import parameter
from interchange.problems import BrightfieldError

LEAST = 0.05  # px rms that a blur is seen from


@dataclass(frozen=True)
class Translucency(Effect):
    """On a rendering, with its passes ``depth``, ``material_id`` and ``object_id``: no scene can say it."""

    stage = Stage.MATERIAL
    order = 50
    source = (
        "Jensen, Marschner, Levoy, Hanrahan: A practical model for subsurface light transport. SIGGRAPH 2001."
    )
    identified_by = (
        "Shadow edges blur inside one material; edges of objects and of other materials stay sharp."
    )
    confused_with = ("light_size", "defocus", "texture")
    separated_by = "a sharp shadow edge across two materials, or a laser dot on the material"

    sigma: float = parameter(0.0, "σ", "mm", 0, 1e3, "how far light goes beneath the surface, rms")

    def on_radiance(self, image: Image, target: str = "") -> Image:
        if not self.is_there:
            return image
        missing = [p for p in ("depth", "material_id", "object_id") if p not in image.passes]
        if missing or image.camera is None:
            raise BrightfieldError(f"Translucency needs a camera and the passes depth, material_id and object_id; "
                                   f"missing: {', '.join(missing) or 'camera'}.")  # fmt: skip
        pixels = image.pixels.copy()
        for k, name in enumerate(image.material_names):
            if target in ("", name, name.rsplit("/", 1)[-1]):
                mask = image.passes["material_id"] == k
                for body in np.unique(image.passes["object_id"][mask]):
                    own = mask & (image.passes["object_id"] == body)
                    px = self.sigma_px(image.passes["depth"][own], image.camera)
                    if px > LEAST:
                        pixels[own] = spread(image.pixels, own, px)[own]
        return replace(image, pixels=pixels)

    def sigma_px(self, depth: np.ndarray, camera: Camera) -> float:
        """px that σ is long at the median of ``depth`` m."""
        near = 1.0 if camera.lens.projection is Projection.ORTHOGRAPHIC else float(np.median(depth))
        return 1e-3 * self.sigma * float(camera.K[0, 0]) / near


def spread(pixels: np.ndarray, mask: np.ndarray, sigma: float) -> np.ndarray:
    """``pixels`` (H, W, C) blurred by ``sigma`` px rms with what ``mask`` (H, W) holds alone; zero elsewhere."""
    out = np.zeros_like(pixels)
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return out
    box = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    inside = mask[box]
    weight = inside.astype(np.float32)
    held, share = (
        cv2.GaussianBlur(plane, (0, 0), sigma, borderType=cv2.BORDER_CONSTANT)
        for plane in (pixels[box] * weight[..., None], weight)
    )
    out[box][inside] = held.reshape(pixels[box].shape)[inside] / share[inside][:, None]
    return out
