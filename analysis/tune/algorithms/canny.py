"""Canny's edges, at whole pixels: local maxima of |∇(G_σ * I)| that a chain above ``low`` joins to one above ``high``.

``low`` = ``low_share`` · ``high``, so that it is never above.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import cv2
import numpy as np

from analysis.tune.algorithms.base import GREY, Algorithm
from analysis.tune.found import Edges
from interchange.parameter import parameter

SCALE = 64.0  # cv2.Canny takes 16 bit gradients: 255 per px becomes 16320


@dataclass(frozen=True)
class Canny(Algorithm):
    finds: ClassVar[type] = Edges
    source: ClassVar[str] = (
        "Canny: A computational approach to edge detection. PAMI 1986. OpenCV's cv2.Canny."
    )

    sigma: float = parameter(1.0, "σ", "px", 0.3, 4, "blur before the gradient, rms")
    high: float = parameter(20.0, "t_h", f"{GREY}/px", 0.3, 100, "gradient that begins an edge")
    low_share: float = parameter(0.4, "t_l / t_h", "1", 0.05, 1, "gradient that continues an edge, over high")

    def run(self, image: np.ndarray, near: Any = None) -> Edges:
        gx, gy = gradient(image, self.sigma)
        row, column = np.nonzero(canny_map(gx, gy, self.low_share * self.high, self.high))
        return Edges(np.stack([column, row], axis=-1).astype(np.float64))


def gradient(image: np.ndarray, sigma: float) -> tuple[np.ndarray, np.ndarray]:
    """Central differences along columns and rows, grey levels per px, of the image blurred by ``sigma`` px."""
    smooth = cv2.GaussianBlur(np.asarray(image, np.float32), (0, 0), sigma, borderType=cv2.BORDER_REPLICATE)
    kernel = np.array([-0.5, 0, 0.5], np.float32)
    one = np.ones(1, np.float32)
    gx = cv2.sepFilter2D(smooth, cv2.CV_32F, kernel, one, borderType=cv2.BORDER_REPLICATE)
    gy = cv2.sepFilter2D(smooth, cv2.CV_32F, one, kernel, borderType=cv2.BORDER_REPLICATE)
    return gx, gy


def canny_map(gx: np.ndarray, gy: np.ndarray, low: float, high: float) -> np.ndarray:
    """(H, W) uint8, not 0 on edges; nothing within 2 px of the border."""
    short = [np.rint(np.clip(SCALE * g, -32767, 32767)).astype(np.int16) for g in (gx, gy)]
    found = cv2.Canny(short[0], short[1], SCALE * low, SCALE * high, L2gradient=True)
    found[:2], found[-2:], found[:, :2], found[:, -2:] = 0, 0, 0, 0
    return found
