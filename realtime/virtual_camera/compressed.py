"""JPEG of a frame, made once however many readers want it."""

import threading
import weakref

import cv2
import numpy as np

from realtime.virtual_camera.frame import Frame

QUALITY = 90  # of libjpeg, where the scene file gives the camera none


class Compressor:
    """``color``: three channels for a monochrome frame too, at half the resolution of colour (4:2:0)."""

    def __init__(self, quality: int = QUALITY, color: bool = False) -> None:
        self.quality, self.color = quality, color
        self._lock = threading.Lock()
        self._made: weakref.WeakKeyDictionary[Frame, bytes] = weakref.WeakKeyDictionary()

    def __call__(self, frame: Frame) -> bytes:
        """Of the frame's upper 8 bits: a JPEG has no more."""
        with self._lock:
            if frame not in self._made:
                self._made[frame] = self._encode(frame)
            return self._made[frame]

    def _encode(self, frame: Frame) -> bytes:
        pixels = frame.bgr
        if frame.format.bits > 8:
            pixels = (pixels >> (frame.format.bits - 8)).astype(np.uint8)
        if self.color and pixels.ndim == 2:
            pixels = np.repeat(pixels[..., None], 3, axis=2)
        options = [cv2.IMWRITE_JPEG_QUALITY, self.quality]
        if self.color:
            options += [cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_420]
        _, data = cv2.imencode(".jpg", np.ascontiguousarray(pixels), options)
        return data.tobytes()
