"""A frame of a live camera: its DN, and the truth about it that no real camera can tell."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from interchange.camera import Camera
from interchange.scene import Scene
from realtime.virtual_camera.pixel_format import PixelFormat


@dataclass(frozen=True, eq=False)
class Truth:
    """What was so when frame ``number`` (1, 2, 3, ...) was taken.

    ``stamp_ns``: UTC, ns since 1970, by this machine's clock; ``seconds`` of the moving scene, at which the frame was
    due; ``time``: the scene's time code. ``scene`` and ``camera`` as they were drawn, the camera's sensor, exposure
    time and gain included; what moves during the exposure is where it is in the middle of it (of row 0's).
    ``region`` (x, y, width, height) px of the sensor that the frame shows. ``belts`` in m, ``encoders`` in pulses.
    """

    number: int
    stamp_ns: int
    seconds: float
    time: float
    scene: Scene
    camera: Camera
    region: tuple[int, int, int, int]
    joints: dict[str, float] = field(default_factory=dict)
    belts: dict[str, float] = field(default_factory=dict)
    encoders: dict[str, int] = field(default_factory=dict)
    path_px: float = 0.0  # that the image moves during the exposure, at most
    renderings: int = 1  # that the exposure was made of

    @property
    def K(self) -> np.ndarray:
        """(3, 3) of the frame: pixel (0, 0) is the first of the region."""
        K = self.camera.K.copy()
        K[0, 2] -= self.region[0]
        K[1, 2] -= self.region[1]
        return K

    def pose(self, body: str) -> np.ndarray:
        """``world_from_body`` (4, 4). KeyError where there is no such body."""
        for b in self.scene.bodies:
            if b.name == body:
                return b.world_from_body
        raise KeyError(body)

    def project(self, points: np.ndarray) -> np.ndarray:
        """World points (..., 3) -> pixels of the frame (..., 2); NaN behind the camera."""
        return self.camera.project(points) - np.array(self.region[:2])

    def record(self, bodies: bool = True) -> dict[str, Any]:
        """As JSON has it: SI units, matrices row by row. ``ids[i]`` is what the map ``object_id`` calls i."""
        told: dict[str, Any] = {
            "number": self.number,
            "stamp_ns": self.stamp_ns,
            "seconds": self.seconds,
            "time": self.time,
            "camera": self.camera.name,
            "world_from_camera": self.camera.world_from_camera.tolist(),
            "K": self.K.tolist(),
            "distortion": list(self.camera.lens.distortion),
            "projection": str(self.camera.lens.projection),
            "region": list(self.region),
            "exposure_s": self.camera.t_exp,
            "gain_dB": self.camera.sensor.gain_dB,
            "joints": self.joints,
            "belts": self.belts,
            "encoders": self.encoders,
            "path_px": self.path_px,
            "renderings": self.renderings,
            "scene": self.scene.digest,
        }
        if bodies:
            told["bodies"] = {b.name: b.world_from_body.tolist() for b in self.scene.bodies}
            told["ids"] = list(self.scene.object_names)
        return told


@dataclass(frozen=True, eq=False)
class Frame:
    """``pixels`` (H, W) or (H, W, 3) in R, G, B; uint8, or uint16 where DN have more than 8 bits; read-only.

    ``maps``: passes of the renderer that were asked for (``object_id``, ``depth``, ...), at the frame's pixels.
    """

    pixels: np.ndarray
    format: PixelFormat
    truth: Truth
    maps: dict[str, np.ndarray] = field(default_factory=dict)

    @property
    def number(self) -> int:
        return self.truth.number

    @property
    def stamp_ns(self) -> int:
        return self.truth.stamp_ns

    @property
    def bgr(self) -> np.ndarray:
        """As OpenCV has it: (H, W), or (H, W, 3) in B, G, R."""
        return self.pixels if self.pixels.ndim == 2 else self.pixels[..., ::-1]
