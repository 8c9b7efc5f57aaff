"""Pictures for people, from radiance: side by side, differences in false colour, contact sheets."""

from collections.abc import Sequence

import numpy as np
from PIL import Image as Pillow
from PIL import ImageDraw, ImageFont

from interchange.formats.images import to_display

GAP, BAR = 8, 26  # px between pictures; px of the caption under each
INK, PAPER = (235, 235, 235), (24, 26, 30)


def exposure_for(radiance: np.ndarray) -> float:
    """1 over the 99th percentile of the brightest channel: one exposure for all pictures of a sheet."""
    return float(1 / max(np.percentile(radiance.max(axis=-1), 99), 1e-12))


def difference(a: np.ndarray, b: np.ndarray, full_scale: float) -> np.ndarray:
    """(H, W, 3) uint8 of a - b, mean of the channels: blue below, black at 0, red and yellow above.

    ``full_scale``: the difference (in the unit of a and b) that gets the brightest colour.
    """
    x = np.clip((a - b).mean(axis=-1) / full_scale, -1, 1)
    up, down = np.clip(x, 0, 1), np.clip(-x, 0, 1)
    rgb = np.stack(
        [np.minimum(1, 2 * up), np.maximum(0, 2 * up - 1) + 0.6 * down, np.minimum(1, 2 * down)], -1
    )
    return np.rint(255 * rgb).astype(np.uint8)


def shown(radiance: np.ndarray, exposure: float) -> np.ndarray:
    return to_display(radiance, exposure)


def sheet(pictures: Sequence[np.ndarray], captions: Sequence[str], columns: int) -> np.ndarray:
    """Pictures of one size in rows of ``columns``, a caption under each: (H, W, 3) uint8."""
    height, width = pictures[0].shape[:2]
    rows = -(-len(pictures) // columns)
    page = Pillow.new("RGB", (GAP + columns * (width + GAP), GAP + rows * (height + BAR + GAP)), PAPER)
    draw = ImageDraw.Draw(page)
    font = ImageFont.load_default(14)
    for k, (picture, caption) in enumerate(zip(pictures, captions, strict=True)):
        x, y = GAP + (k % columns) * (width + GAP), GAP + (k // columns) * (height + BAR + GAP)
        page.paste(Pillow.fromarray(picture), (x, y))
        draw.text((x + 2, y + height + 5), caption, INK, font)
    return np.asarray(page)


def smaller(picture: np.ndarray, width: int) -> np.ndarray:
    height = round(picture.shape[0] * width / picture.shape[1])
    return np.asarray(Pillow.fromarray(picture).resize((width, height), Pillow.Resampling.BOX))
