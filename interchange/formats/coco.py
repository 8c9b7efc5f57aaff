"""COCO's object detection format: images, annotations with run-length masks, categories.

Lin et al.: Microsoft COCO: Common objects in context. ECCV 2014; https://cocodataset.org/#format-data.
"""

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from interchange.formats.atomic import written_beside


@dataclass(frozen=True)
class Annotated:
    """What is seen of one thing. ``box``: column, row, width, height, px; ``rle``: ``interchange.formats.rle``."""

    category: str
    box: Sequence[float]
    pixels: int
    rle: dict[str, Any]
    about: dict[str, Any]  # further keys of the annotation


@dataclass(frozen=True)
class Picture:
    number: int
    file: str  # relative to the annotations' file
    size: tuple[int, int]  # width, height
    shown: Sequence[Annotated]
    about: dict[str, Any]  # further keys of the image


def write(path: Path, pictures: Sequence[Picture], categories: Sequence[tuple[str, str]], info: str) -> None:
    """``categories``: names with their supercategory; a thing of no pixel has no annotation. Written beside and
    renamed. A crowd is none of these: ``iscrowd`` is 0."""
    ids = {name: k + 1 for k, (name, _) in enumerate(categories)}
    annotations: list[dict[str, Any]] = []
    for picture in pictures:
        for thing in picture.shown:
            if not thing.pixels:
                continue
            annotations.append(
                {
                    "id": len(annotations) + 1,
                    "image_id": picture.number,
                    "category_id": ids[thing.category],
                    "bbox": [float(x) for x in thing.box],
                    "area": float(thing.pixels),
                    "segmentation": thing.rle,
                    "iscrowd": 0,
                    **thing.about,
                }
            )
    data = {
        "info": {"description": info, "version": "1.0"},
        "licenses": [],
        "images": [
            {"id": p.number, "file_name": p.file, "width": p.size[0], "height": p.size[1], **p.about}
            for p in pictures
        ],
        "categories": [{"id": ids[n], "name": n, "supercategory": s} for n, s in categories],
        "annotations": annotations,
    }
    beside = written_beside(path)
    beside.write_text(json.dumps(data), encoding="utf-8")
    os.replace(beside, path)
