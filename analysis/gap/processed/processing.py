"""What a colour camera that gives out JPEGs did to its pixels before, where the scene file says nothing of it: channels
that a pixel does not have are interpolated from a mosaic, and colours go through a matrix
(analysis.gap.processed.matrices).

In a JPEG no pixel is left as it was measured, so that the mosaic is not taken back: it is simulated with what
compressing does (analysis.gap.processed.compressed). Which of the four patterns it is, is told where colours meet:
interpolated by the right one, a simulation is nearest to the captures. Blur alone brings all four nearer alike;
captures that lie a pixel elsewhere than simulated are hardly nearer by any, and show none.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.processed.matrices import Matrix, encoded_above, linear_above
from interchange.camera import Camera
from interchange.effects.demosaic import Demosaic as Interpolation
from interchange.effects.mosaic import phases
from interchange.effects.parts import called
from interchange.image import Image
from interchange.sensor import Demosaic, Mosaic

BAYER = tuple(pattern for pattern in Mosaic if pattern.is_bayer)
WIDE = 8.0  # px, σ: what is wider than edges is no interpolation's
CLEAR = 1.25  # times as much that the right pattern takes off of the captures' distance as the others do in the mean
# of the captures' squared distance that the right pattern takes off at least. Of synthetic tiles it takes 0.9 where
# they lie as simulated, 0.38 and more where they are 0.3 px off or blurred; one that is not there takes 0.22 at 1 px
# (quality 50 and 92)
SHARE = 1 / 3


@dataclass(frozen=True, eq=False)
class Processing:
    """``matrix``: None where colours stay as they are; ``mosaic``: NONE where every pixel measures all channels.
    ``mosaic_is_said``: whether by the scene file."""

    camera: Camera
    matrix: Matrix | None = None
    mosaic: Mosaic = Mosaic.NONE
    demosaic: Demosaic = Demosaic.BILINEAR
    mosaic_is_said: bool = False

    @property
    def is_there(self) -> bool:
        return self.matrix is not None or self.mosaic.is_bayer

    def mixed_further(self, by: Matrix | None) -> "Processing":
        """With a matrix that pixels go through before the one that is here."""
        if by is None or self.matrix is None:
            return replace(self, matrix=by or self.matrix)
        return replace(self, matrix=replace(by, rows=self.matrix.rows @ by.rows))

    def applied(self, dn: np.ndarray) -> np.ndarray:
        """(H, W, 3) DN of pixels, after the camera's curve, as they are where that comes last."""
        if not self.is_there:
            return dn
        above = linear_above(dn, self.camera)
        if self.mosaic.is_bayer:
            above = self._interpolated(above)
        if self.matrix is not None:
            above = above @ self.matrix.rows.T
        return encoded_above(above, self.camera)

    def taken_back(self, dn: np.ndarray) -> np.ndarray:
        """(H, W, 3) DN as they were before the matrix, rounded and cut off as captures are (matrices.unmixed)."""
        if self.matrix is None:
            return dn
        top = 2**self.camera.sensor.bits_out - 1
        return np.clip(np.rint(self.matrix.taken_back(dn, self.camera)), 0, top)

    def _interpolated(self, above: np.ndarray) -> np.ndarray:
        black = self.camera.sensor.black_level
        raw = np.empty(above.shape[:2], np.float32)
        for i, j, channel in phases(self.mosaic):
            raw[i::2, j::2] = above[i::2, j::2, channel]
        by = Interpolation(self.demosaic, self.mosaic)
        return by.apply(Image(raw[..., None] + black), self.camera, None).pixels - black


def notes(by: Sequence[Processing]) -> list[str]:
    told = [p for p in by if p.mosaic.is_bayer and not p.mosaic_is_said]
    if not told:
        return []
    names = " and ".join(f"{called(p.camera.name)} ({p.mosaic})" for p in told)
    return [
        f"Where colours meet, captures of {names} show that they were interpolated from a mosaic of colours, of which "
        f"the scene file does not say: what that does is taken for known. A JPEG does not let it be taken back, and "
        f"the corrected scene does not say it either."
    ]


def mosaic_shown(c: Condition, off: Callable[[Mosaic], np.ndarray]) -> Mosaic:
    """The mosaic that a condition's capture was interpolated from; NONE where it was not, or hides it. ``off``: DN
    (H, W, 3) that go to a simulation where it is interpolated from a mosaic."""
    ok, none = c.compared, off(Mosaic.NONE)
    left = _sharp(c.mean - c.simulated().dn - none)[ok]
    distance = float(np.square(left).sum())
    if not distance:
        return Mosaic.NONE
    taken_off = {
        pattern: 1 - float(np.square(left - _sharp(off(pattern) - none)[ok]).sum()) / distance
        for pattern in BAYER
    }
    best = max(taken_off, key=lambda p: taken_off[p])
    others = float(np.mean([x for pattern, x in taken_off.items() if pattern is not best]))
    return best if taken_off[best] > max(CLEAR * others, SHARE) else Mosaic.NONE


def _sharp(dn: np.ndarray) -> np.ndarray:
    return dn - cv2.GaussianBlur(dn, (0, 0), WIDE)
