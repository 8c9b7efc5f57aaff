"""A page of small pictures with a caption each: what a series looks like at a glance."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image as Pillow

from composer.demo.pictures import sheet, smaller
from interchange.formats import images
from interchange.formats.atomic import written_beside

MOST = 60  # pictures on a page
WIDTH = 160  # px of each


def write_contact_sheet(
    path: Path,
    pictures: Sequence[tuple[np.ndarray, str]],
    columns: int = 0,
) -> None:
    """``pictures``: (H, W, 3) uint8 and caption; they are brought to one width and the tallest one's height."""
    shown = [_scaled(p) for p, _ in pictures]
    height = max(p.shape[0] for p in shown)
    framed = [np.pad(p, ((0, height - p.shape[0]), (0, 0), (0, 0))) for p in shown]
    columns = columns or min(10, max(1, round(np.sqrt(1.6 * len(framed)))))
    page = sheet(framed, [caption for _, caption in pictures], columns)
    beside = written_beside(path)
    Pillow.fromarray(page).save(beside)
    os.replace(beside, path)


def _scaled(picture: np.ndarray) -> np.ndarray:
    if picture.shape[1] >= WIDTH:
        return smaller(picture, WIDTH)
    factor = WIDTH / picture.shape[1]
    size = (WIDTH, round(picture.shape[0] * factor))
    return np.asarray(Pillow.fromarray(picture).resize(size, Pillow.Resampling.NEAREST))


def of_manifest(
    folder: Path, rows: Sequence[Mapping[str, Any]], varying: Sequence[str]
) -> list[tuple[np.ndarray, str]]:
    """At most ``MOST`` frames of a sweep, spread evenly, with their numbers; images as the camera gives them, brought
    to 8 bits by one factor for all, so that a darker frame looks darker."""
    chosen = [rows[k] for k in np.unique(np.linspace(0, len(rows) - 1, min(MOST, len(rows))).astype(int))]
    raw = [images.read(folder / r["file.image"]).astype(np.float64) for r in chosen]
    top = max(float(np.percentile(x, 99.5)) for x in raw) or 1.0
    pictures = []
    for x, r in zip(raw, chosen, strict=True):
        eight = np.rint(255 * np.clip(x / top, 0, 1) ** (1 / 2.2)).astype(np.uint8)
        numbers = "  ".join(f"{r[a]:.3g}" for a in varying[:3] if r.get(a) is not None)
        pictures.append(
            (np.repeat(eight, 3, axis=2) if x.shape[2] == 1 else eight, f"{r['frame']}: {numbers}")
        )
    return pictures
