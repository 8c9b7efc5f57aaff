"""What a JPEG file says of its compression: the tables that it was quantised by, as libjpeg's quality.

ITU-T T.81 (1992), Annex K; the Independent JPEG Group's libjpeg, jcparam.c.
"""

import io
from functools import cache
from pathlib import Path

import numpy as np
from PIL import Image, JpegImagePlugin

HALVED = 2  # Pillow's number of 4:2:0


def stated(path: Path) -> tuple[int, bool] | None:
    """The quality, 1 to 100, whose table for brightness is nearest (by logarithms) to the file's, and whether colour is
    at half the resolution each way; None of what is no JPEG."""
    try:
        with Image.open(path, formats=["JPEG"]) as image:
            table = image.quantization[0]  # type: ignore[attr-defined]
            halved = image.mode != "L" and JpegImagePlugin.get_sampling(image) == HALVED
    except (OSError, KeyError, SyntaxError):
        return None
    off = np.abs(_logarithms() - np.log(np.maximum(table, 1))).sum(axis=1)
    return int(np.argmin(off)) + 1, halved


@cache
def _logarithms() -> np.ndarray:
    """(100, 64): of the tables of all qualities, in the order in which files give theirs."""
    out = []
    for quality in range(1, 101):
        file = io.BytesIO()
        Image.new("L", (8, 8)).save(file, "JPEG", quality=quality)
        with Image.open(file) as image:
            out.append(image.quantization[0])  # type: ignore[attr-defined]
    return np.log(np.array(out, float))
