"""What a JPEG of 4:2:0 leaves of a mean image: brightness as it was, colour at half the resolution.

    x  ->  x̄ + (1, 1, 1) y·(x - x̄)

x̄: means over 2 x 2 px, drawn larger by a triangle, as libjpeg does; y: the weights of brightness, ITU-R BT.601. What is
rounded in its blocks is no part of the mean.
"""

import cv2
import numpy as np

LUMA = np.array([0.299, 0.587, 0.114], np.float32)  # of red, green, blue


def halved_colour(dn: np.ndarray) -> np.ndarray:
    """``dn`` (H, W, 3) as it comes out of the file again, float32; of one channel as it is."""
    h, w, channels = dn.shape
    if channels != 3:
        return dn
    even = np.pad(dn.astype(np.float32), ((0, h % 2), (0, w % 2), (0, 0)), "edge")
    tall, wide = even.shape[:2]
    small = cv2.resize(even, (wide // 2, tall // 2), interpolation=cv2.INTER_AREA)
    coarse = cv2.resize(small, (wide, tall), interpolation=cv2.INTER_LINEAR)[:h, :w]
    return np.asarray(coarse + ((dn - coarse) @ LUMA)[..., None], np.float32)
