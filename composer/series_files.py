"""Files of what a series tells: maps as EXR, pictures and class numbers as PNG."""

from pathlib import Path

import numpy as np

from interchange.formats import exr, images
from interchange.image import Image
from interchange.problems import BrightfieldError


def write_colors(path: Path, values: np.ndarray) -> None:
    images.write(path, np.rint(255 * np.clip(values, 0, 1)).astype(np.uint8))


def write_mask(path: Path, mask: np.ndarray) -> None:
    images.write(path, (255 * mask).astype(np.uint8))


def write_map(path: Path, values: np.ndarray) -> None:
    """(H, W) or (H, W, 3) as EXR."""
    values = np.asarray(values, np.float32)
    exr.write(path, Image(values[..., None] if values.ndim == 2 else values))


def write_picture(path: Path, values: np.ndarray) -> None:
    """(H, W) stretched between its 0.5th and 99.5th percentile, for looking at."""
    low, high = np.nanpercentile(values, [0.5, 99.5])
    shown = np.clip((values - low) / max(high - low, 1e-12), 0, 1)
    images.write(path, np.rint(255 * np.nan_to_num(shown)).astype(np.uint8))


# red, blue, green, turquoise as in the chapter's Fig. 10, then others
COLORS = np.array(
    [
        [214, 60, 50],
        [60, 90, 210],
        [70, 170, 80],
        [64, 200, 200],
        [230, 170, 50],
        [150, 80, 180],
        [120, 120, 120],
    ]
)


def write_labels(out: Path, labels: np.ndarray) -> None:
    """labels.png: class numbers from 0, 255 for none; classes.png: in colours."""
    images.write(out / "labels.png", np.where(labels < 0, 255, labels).astype(np.uint8))
    colors = np.where((labels < 0)[..., None], 0, COLORS[np.maximum(labels, 0) % len(COLORS)])
    images.write(out / "classes.png", colors.astype(np.uint8))


def read_labels(path: Path, shape: tuple[int, int]) -> np.ndarray:
    """(H, W) int of an image of class numbers; 255 is -1, no class."""
    labels = images.read(path)[..., 0].astype(np.int64)
    if labels.shape != shape:
        raise BrightfieldError(
            f"Labels must have the images' size, {shape[1]} x {shape[0]} px; got {labels.shape[1]} x "
            f"{labels.shape[0]} px. ({path})"
        )
    return np.where(labels == 255, -1, labels)
