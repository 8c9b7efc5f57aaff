"""An illumination series: images of one camera that stands still, each under one lamp of another direction.

    S = {g(x, w_l), l = 0 ... L-1},     r_x(w_l) = g(x, w_l)      the reflectance function of pixel x

Gruna, Irgenfried: Reflectance modeling in machine vision. 2012, Eq. 3 to 5. World frame, as everywhere.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from interchange.camera import Camera
from interchange.image import Quantity
from interchange.problems import BrightfieldError

Z = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Series:
    """``images`` (L, H, W, C) float32, linear, 0 where no light is; C = 1 or 3.

    ``wi``: unit vectors to the lamps, (L, 3), or (L, H, W, 3) where they are near. ``irradiance`` of a surface that
    faces the lamp, (L,) or (L, H, W), W/m² or any other unit common to all. ``wo``: unit vectors to the camera, (3,)
    or (H, W, 3). ``positions`` (L, 3) m of near lamps, None for distant ones. ``valid`` (L, H, W), False where a
    sample is saturated or masked; None is valid throughout. ``names`` of the images, for messages.
    Raises BrightfieldError where these do not fit each other.
    """

    images: np.ndarray
    wi: np.ndarray
    irradiance: np.ndarray = field(default_factory=lambda: np.ones(0))  # empty: 1 of all
    wo: np.ndarray = field(default_factory=lambda: Z)
    positions: np.ndarray | None = None
    valid: np.ndarray | None = None
    quantity: Quantity = Quantity.RADIANCE
    camera: Camera | None = None
    names: tuple[str, ...] = ()
    made_by: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        images = np.asarray(self.images, np.float32)
        if images.ndim != 4 or images.shape[0] == 0 or images.shape[3] not in (1, 3):
            raise BrightfieldError(
                f"A series must have images of shape (lamps, rows, columns, 1 or 3); got {images.shape}."
            )
        count, height, width, _ = images.shape
        wi = np.asarray(self.wi)
        wo = np.asarray(self.wo, np.float64)
        irradiance = np.asarray(self.irradiance, np.float64)
        irradiance = irradiance if irradiance.size else np.ones(count)
        shapes = {
            "wi": (wi.shape, [(count, 3), (count, height, width, 3)]),
            "wo": (wo.shape, [(3,), (height, width, 3)]),
            "irradiance": (irradiance.shape, [(count,), (count, height, width)]),
        }
        if self.positions is not None:
            shapes["positions"] = (np.shape(self.positions), [(count, 3)])
        if self.valid is not None:
            shapes["valid"] = (np.shape(self.valid), [(count, height, width)])
        for name, (got, known) in shapes.items():
            if got not in known:
                raise BrightfieldError(
                    f"A series of {count} images of {width} x {height} px must have {name} of shape "
                    f"{' or '.join(map(str, known))}; got {got}."
                )
        for name, w in (("wi", wi), ("wo", wo)):
            length = np.linalg.norm(w, axis=-1)
            if not np.allclose(length, 1, atol=1e-3):  # NaN is not close either
                worst = length.flat[int(np.argmax(np.abs(np.nan_to_num(length, nan=np.inf) - 1)))]
                raise BrightfieldError(f"A series' {name} must be unit vectors; one has length {worst:g}.")
        if not (np.isfinite(irradiance).all() and (irradiance > 0).all()):
            raise BrightfieldError("Every lamp of a series must give a finite irradiance above 0.")
        for name, value in (("images", images), ("wi", wi), ("wo", wo), ("irradiance", irradiance)):
            object.__setattr__(self, name, value)
        if not self.names:
            object.__setattr__(self, "names", tuple(f"image {k}" for k in range(count)))
        if len(self.names) != count:
            raise BrightfieldError(
                f"A series must have a name an image; got {len(self.names)} for {count} images."
            )

    def __len__(self) -> int:
        return len(self.images)

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""
        return self.images.shape[1], self.images.shape[2]

    @property
    def grey(self) -> np.ndarray:
        """(L, H, W) float32: the mean of the channels."""
        return self.images[..., 0] if self.images.shape[3] == 1 else self.images.mean(axis=-1)

    @property
    def usable(self) -> np.ndarray:
        """(L, H, W) bool: valid and a number."""
        finite = np.isfinite(self.grey)
        return finite if self.valid is None else finite & np.asarray(self.valid, bool)

    @property
    def directions(self) -> np.ndarray:
        """(L, 3) unit vectors to the lamps; of near ones, from the middle pixel."""
        if self.wi.ndim == 2:
            return self.wi
        height, width = self.shape
        return self.wi[:, height // 2, width // 2]

    @property
    def per_irradiance(self) -> np.ndarray:
        """(L, H, W): grey images over the irradiance of a surface that faces the lamp; f cos θ_i where this is
        radiance."""
        E = self.irradiance if self.irradiance.ndim == 3 else self.irradiance[:, None, None]
        return self.grey / E

    def choose(self, lamps: Sequence[int] | np.ndarray) -> "Series":
        """The series of some of its images, by number or by a mask (L,)."""
        chosen = np.arange(len(self))[np.asarray(lamps)]
        return replace(
            self,
            images=self.images[chosen],
            wi=self.wi[chosen],
            irradiance=self.irradiance[chosen],
            positions=None if self.positions is None else self.positions[chosen],
            valid=None if self.valid is None else self.valid[chosen],
            names=tuple(self.names[k] for k in chosen),
        )
