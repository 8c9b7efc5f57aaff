"""A page of small pictures of a sweep, each with what made it: what a series looks like at a glance."""

import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image as Pillow
from PIL import ImageDraw

from composer.demo.pictures import sheet, smaller
from interchange.formats import images
from interchange.formats.atomic import written_beside

MOST = 60  # pictures on a page
WIDTH = 160  # px of each
LETTERS = 26  # of a caption
MARGIN = 3  # px between a defect and the frame around it
COLORS = ("#ff5a4e", "#4ea5ff", "#ffd23f", "#6ddc6d", "#ff7ae0", "#f0f0f0")


def write_contact_sheet(
    path: Path, folder: Path, rows: Sequence[Mapping[str, Any]], varying: Sequence[str]
) -> None:
    """At most ``MOST`` frames of the manifest's ``rows``, spread evenly. ``varying``: addresses of what differs.

    Images as the camera gives them, brought to 8 bits by one factor for all, so that a darker frame looks darker; a
    defect stands in a frame of its kind's colour."""
    chosen = [rows[k] for k in np.unique(np.linspace(0, len(rows) - 1, min(MOST, len(rows))).astype(int))]
    raw = [images.read(folder / r["file.image"]).astype(np.float64) for r in chosen]
    top = max(float(np.percentile(x, 99.5)) for x in raw) or 1.0
    pictures = [_framed(_shown(x, top), r) for x, r in zip(raw, chosen, strict=True)]
    height = max(p.shape[0] for p in pictures)
    pictures = [np.pad(p, ((0, height - p.shape[0]), (0, 0), (0, 0))) for p in pictures]
    columns = min(10, max(1, round(np.sqrt(1.6 * len(pictures)))))
    page = sheet(pictures, [_caption(r, varying) for r in chosen], columns)
    beside = written_beside(path)
    Pillow.fromarray(page).save(beside)
    os.replace(beside, path)


def _shown(values: np.ndarray, top: float) -> np.ndarray:
    eight = np.rint(255 * np.clip(values / top, 0, 1) ** (1 / 2.2)).astype(np.uint8)
    picture = np.repeat(eight, 3, axis=2) if eight.shape[2] == 1 else eight
    if picture.shape[1] >= WIDTH:
        return smaller(picture, WIDTH)
    size = (WIDTH, round(picture.shape[0] * WIDTH / picture.shape[1]))
    return np.asarray(Pillow.fromarray(picture).resize(size, Pillow.Resampling.NEAREST))


def _framed(picture: np.ndarray, row: Mapping[str, Any]) -> np.ndarray:
    page = Pillow.fromarray(picture)
    draw = ImageDraw.Draw(page)
    scale = WIDTH / row["width"]
    kinds = sorted({k for name in row if (k := _kind(name, "box"))})
    for name, box in row.items():
        kind = _kind(name, "box")
        if kind and box is not None and box[2]:
            x, y, w, h = (scale * v for v in box)
            corners = (x - MARGIN, y - MARGIN, x + w + MARGIN, y + h + MARGIN)
            draw.rectangle(corners, outline=COLORS[kinds.index(kind) % len(COLORS)])
    return np.asarray(page)


def _kind(name: str, prefix: str) -> str:
    match = re.fullmatch(rf"{prefix}\.defects\.(\w+)\[\d+\]", name)
    return match[1] if match else ""


def _caption(row: Mapping[str, Any], varying: Sequence[str]) -> str:
    seen = [k for name, pixels in row.items() if pixels and (k := _kind(name, "pixels"))]
    if seen:
        return f"{row['frame']}: {', '.join(k.replace('_part', '') for k in seen)}"
    told = f"{row['frame']}: " + "  ".join(_short(row[a]) for a in varying[:3] if row.get(a) is not None)
    return told if len(told) <= LETTERS else told[: LETTERS - 1] + "…"


def _short(value: float | str) -> str:
    """A number, or a name without its folders and its ending."""
    return Path(value.rpartition(":")[2]).stem if isinstance(value, str) else f"{value:.3g}"
