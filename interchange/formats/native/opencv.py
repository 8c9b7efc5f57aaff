"""OpenCV's image decoders: LZW and tiled TIFF by libtiff, Radiance HDR."""

import cv2
import numpy as np


def decode(path: str, data: bytes) -> np.ndarray:
    """The samples (h, w, C) of an image file's bytes, RGB or RGBA; empty where they cannot be decoded."""
    array = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if array is None:
        return np.zeros(0)
    array = array[..., None] if array.ndim == 2 else array
    return np.ascontiguousarray(array[..., [2, 1, 0, 3][: array.shape[2]]] if array.shape[2] > 2 else array)
