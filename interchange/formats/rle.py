"""Masks as COCO's run lengths: column by column, the first run is of zeros."""

from typing import Any

import numpy as np


def encode(mask: np.ndarray) -> dict[str, Any]:
    """(H, W) bool -> ``{"size": [H, W], "counts": [zeros, ones, zeros, ...]}``, COCO's uncompressed form."""
    flat = np.concatenate([[False], np.asarray(mask, bool).ravel(order="F")])
    changes = np.flatnonzero(flat[1:] != flat[:-1])
    counts = np.diff(np.concatenate([[0], changes, [flat.size - 1]]))
    return {"size": [int(n) for n in mask.shape], "counts": [int(n) for n in counts]}


def decode(rle: dict[str, Any]) -> np.ndarray:
    """The inverse: (H, W) bool. Raises ValueError where the runs do not fill the size."""
    height, width = rle["size"]
    counts = np.asarray(rle["counts"], np.int64)
    if counts.sum() != height * width or (counts < 0).any():
        raise ValueError(f"runs must add up to {height * width} pixels; got {counts.sum()}")
    flat = np.repeat(np.arange(len(counts)) % 2 == 1, counts)
    return flat.reshape((height, width), order="F")
