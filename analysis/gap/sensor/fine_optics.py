"""What a lens and a motion do within a pixel, done on the finer grid that light is rendered on.

Pixels are means over their squares, and edges are sharper than they are wide: a blur or a shift by a tenth of a pixel
changes a pixel by where in it an edge lies, which no filter of pixels can know. Channels that lie apart, a blur and a
straight motion act before pixels are formed; the rest of the chain is ``interchange.exposure``'s.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from analysis.gap.sensor.uneven_optics import EVEN, Slopes, UnevenBlur, uneven
from interchange.camera import Camera
from interchange.effects import Effect
from interchange.effects.defocus import Defocus
from interchange.effects.field_blur import FieldBlur
from interchange.effects.lateral_chromatic_aberration import LateralChromaticAberration
from interchange.effects.motion_blur import MotionBlur
from interchange.filtering import combined, convolve, gaussian, line

# px: rms of a Gaussian, the path's columns and rows; how much faster that is at its end, and how the Gaussian's
# variance differs over the image
Blur = tuple[float, float, float, float, Slopes]
SHARP: Blur = (0.0, 0.0, 0.0, 0.0, EVEN)


@dataclass(frozen=True)
class FineOptics:
    """``lateral``: how channels lie apart; ``blur``: what is drawn as a Gaussian and a path, px of the sensor's."""

    lateral: LateralChromaticAberration = field(default_factory=LateralChromaticAberration)
    blur: Blur = SHARP

    @property
    def is_there(self) -> bool:
        return self.lateral.is_there or self.blur != SHARP

    def flow(self, camera: Camera, flow: np.ndarray | None) -> np.ndarray | None:
        """``flow`` (H, W, 2) px; with what moves the channels besides, (H, W, 3, 2)."""
        if not self.lateral.is_there:
            return flow
        apart = self.lateral.shifts(camera)
        return apart if flow is None else apart + flow[:, :, None, :]


def blurred(plane: np.ndarray, blur: Blur, finer: int = 1) -> np.ndarray:
    """(h, w, C) of the whole image, on a grid ``finer`` times finer than the sensor's."""
    if blur == SHARP:
        return plane
    sigma, u, v = (finer * x for x in blur[:3])
    faster, slopes = blur[3:]
    if slopes.are_there:
        plane, sigma = uneven(plane, blur[0], slopes, finer), 0.0
        if not (u or v):
            return plane
    kernels = ([gaussian(sigma)] if sigma else []) + ([line(u, v, faster)] if u or v else [])
    return convolve(np.ascontiguousarray(plane, np.float32), combined(kernels))


def told_apart(
    camera: Camera, effects: Sequence[Effect], channels: int
) -> tuple[FineOptics, Camera, list[Effect]]:
    """What of ``camera`` with ``effects`` the finer grid does; camera and effects without that. An image of other than
    three ``channels`` has none that lie apart."""
    given = {type(e): e for e in effects}
    lateral = given.get(LateralChromaticAberration, LateralChromaticAberration.of(camera))
    defocus = given.get(Defocus, Defocus.of(camera))
    motion = given.get(MotionBlur, MotionBlur.of(camera))
    assert isinstance(lateral, LateralChromaticAberration)
    differing = given.get(UnevenBlur, UnevenBlur())
    assert isinstance(defocus, Defocus)
    assert isinstance(motion, MotionBlur)
    assert isinstance(differing, UnevenBlur)
    if channels != 3:
        lateral = LateralChromaticAberration()
    sigma, slopes = _with_discs(camera, defocus.blur, differing.slopes(camera))
    u, v = motion.path(camera)
    faster = motion.acceleration if u or v else 0.0
    optics = FineOptics(lateral, (sigma, u, v, faster, slopes if slopes.are_there else EVEN))
    if not optics.is_there:
        return optics, camera, list(effects)
    rest = [
        e
        for e in effects
        if not isinstance(e, LateralChromaticAberration | Defocus | MotionBlur | UnevenBlur)
    ]
    if Defocus in given:
        rest.append(replace(defocus, blur=0.0))
    if MotionBlur in given:
        rest.append(replace(motion, **dict.fromkeys(motion.carried_by, 0.0)))
    return optics, _without(camera), rest


def _with_discs(camera: Camera, sigma: float, slopes: Slopes) -> tuple[float, Slopes]:
    """rms blur and slopes with what the lens has of discs that grow with the field."""
    if not _has_round_discs(camera):
        return sigma, slopes
    axis, grown, _, _ = camera.lens.field_blur
    more = slopes._replace(corner=slopes.corner + axis * grown / 8, fourth=grown**2 / 16)
    return float(np.hypot(sigma, axis / 4)), more


def _has_round_discs(camera: Camera) -> bool:
    """Whether its ``field_blur`` has neither coma nor astigmatism, and no depth of field that adds to it."""
    lens, blur = camera.lens, FieldBlur.of(camera)
    by_depth = lens.f_stop > 0 and lens.focus_distance > 0
    return blur.is_there and blur.tangential == blur.sagittal and not blur.coma and not by_depth


@lru_cache(maxsize=64)
def _without(camera: Camera) -> Camera:
    """The same object for the same camera, as chains of effects are kept by it."""
    apart = MotionBlur().on(LateralChromaticAberration().on(camera))
    discs = (0.0,) * 4 if _has_round_discs(camera) else camera.lens.field_blur
    return replace(apart, lens=replace(apart.lens, blur=0.0, field_blur=discs))
