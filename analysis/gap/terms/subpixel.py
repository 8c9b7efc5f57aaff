"""What a unit of an effect changes that acts within a pixel: by derivatives of the image on the finer grid.

∂S_c/∂p = -∇S_c · ∂d_c/∂p             a channel that lies d_c px aside
∂S/∂σ² = ½ (S_xx + S_yy)              a blur; exact at every σ for a Gaussian (the heat equation)
∂S/∂u² = S_xx / 24,  ∂S/∂(u v) = S_xy / 12     a straight path (u, v), whose covariance is u u' / 12

How unevenly a path is run through shows by its cube (interchange.filtering.line): by differences, where there is one.
"""

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import replace
from threading import Lock

import numpy as np

from analysis.gap.compared.state import State
from analysis.gap.terms.base import Field, Term
from interchange.camera import Camera
from interchange.effects import Effect
from interchange.effects.defocus import Defocus
from interchange.effects.lateral_chromatic_aberration import LateralChromaticAberration
from interchange.effects.motion_blur import MotionBlur
from interchange.parameter import parameters

PRODUCT = "u v"  # px²
UNEVENLY = "acceleration"  # of a path
FASTER = 0.5  # its step
KEPT = 32  # derivatives, eight of them a camera
ACROSS = 0.2  # of a path's square: what is as wide is no path
SMALL = 1e-5  # of the difference that a channel's shift is told by
PATH = 1 / 12  # variance of a path over its length's square


def subpixel(own: Effect, parameter: str, t_exp: float, camera: Camera) -> tuple[Field, int] | None:
    """DN a unit, and the power of ``parameter`` that the unit is of; None of what is no such effect, or is a square of
    which ``own``, the camera's, has some already.

    ``t_exp`` s: the exposure that a path is told at, 0 where it is as long in every one.
    """
    if isinstance(own, LateralChromaticAberration):
        return _apart(parameter), 1
    if isinstance(own, Defocus) and parameter == "blur" and not own.blur:
        return _blurred, 2
    if isinstance(own, MotionBlur) and parameter in ("u", "v"):
        axis = "uv".index(parameter)
        return (_along(axis, t_exp), 2) if not own.path(camera)[axis] else None
    return None


def across(t_exp: float) -> Field:
    """A unit of the product of a path's columns and rows: their squares do not tell a path to the lower right from one
    to the lower left."""

    def field(s: State) -> np.ndarray:
        return np.asarray(np.float32(PATH * grown(s, t_exp) ** 2) * s.twist, np.float32)

    return field


def grown(s: State, t_exp: float) -> float:
    """A path at a condition's exposure, over that at ``t_exp``; 0: it is as long in every one."""
    return s.camera.t_exp / t_exp if t_exp else 1.0


def unevenly(s: State) -> np.ndarray | None:
    """A unit of the logarithm that the speed along a path grows by; None where there is no path yet."""
    now = next((e for e in s.effects if isinstance(e, MotionBlur)), MotionBlur.of(s.camera))
    if not any(now.path(s.camera)):
        return None
    others = [e for e in s.effects if not isinstance(e, MotionBlur)]
    limits = parameters(MotionBlur)[UNEVENLY]
    ends = [max(now.acceleration - FASTER, limits.low), min(now.acceleration + FASTER, limits.high)]
    dn = [s.dn([*others, replace(now, acceleration=a)]) for a in ends]
    return np.asarray(s.take((dn[1] - dn[0]) / np.float32(ends[1] - ends[0])), np.float32)


def straight(terms: Sequence[Term], at: np.ndarray) -> np.ndarray:
    """``at`` (q,) with every path the straight one that is nearest: what is left over is a blur."""
    there = at.copy()
    for index in paths(terms).values():
        there[index] = along(at[index])
    return there


def along(theta: np.ndarray) -> np.ndarray:
    """(3,): a path's squares and product without what is across it."""
    length, way = np.linalg.eigh(_square(theta))
    u, v = way[:, -1]
    return max(float(length[-1]), 0.0) * np.array([u * u, v * v, u * v])


def paths(terms: Sequence[Term]) -> dict[tuple[str, str], np.ndarray]:
    """Of every cause that is a path, its squares' and its product's numbers."""
    found: dict[tuple[str, str], dict[str, int]] = {}
    for k, t in enumerate(terms):
        if t.cause == MotionBlur.name():
            found.setdefault(t.candidate, {})[t.parameter] = k
    return {c: np.array([own["u"], own["v"], own[PRODUCT]]) for c, own in found.items() if PRODUCT in own}


def is_path(theta: np.ndarray, covariance: np.ndarray) -> bool:
    """Whether squares and product (3,), known to ``covariance`` (3, 3), may be a straight path's: across it there is
    nothing, or it is no more than ``ACROSS`` of what there is along it, or than twice its standard deviation."""
    length = np.linalg.eigvalsh(_square(theta))
    slope = width_gradient(theta)
    return bool(length[0] <= ACROSS * length[1] + 2 * np.sqrt(max(float(slope @ covariance @ slope), 0.0)))


def width_gradient(theta: np.ndarray) -> np.ndarray:
    """(3,): what each of a path's squares and product (3,) adds to its width's square; with them, the square itself."""
    x, y = np.linalg.eigh(_square(theta))[1][:, 0]
    return np.array([x * x, y * y, 2 * x * y])


def _square(theta: np.ndarray) -> np.ndarray:
    return np.array([[theta[0], theta[2]], [theta[2], theta[1]]])


def _apart(parameter: str) -> Field:
    def field(s: State) -> np.ndarray | None:
        if s.condition.mean.shape[2] != 3:
            return None
        by = _shifted_by(s, parameter)
        dx, dy = s.gradient
        return np.asarray(-(dx * by[..., 0] + dy * by[..., 1]), np.float32)

    return field


def _shifted_by(s: State, parameter: str) -> np.ndarray:
    """(h, w, 3, 2) px a unit; conditions of one camera share it."""
    now, size = s.optics.lateral, s.camera.sensor.resolution
    key = (now, parameter, size, s.stride, s.camera.K.tobytes())
    with _keeping:
        if key not in _shifts:
            limits, here = parameters(type(now))[parameter], float(getattr(now, parameter))
            values = [
                min(max(here + x, limits.low), limits.high) for x in (SMALL, -SMALL)
            ]  # one-sided at its end
            ends = [replace(now, **{parameter: x}).shifts(s.camera) for x in values]
            _shifts[key] = s.take((ends[0] - ends[1]) / np.float32(values[0] - values[1]))
            while len(_shifts) > KEPT:
                _shifts.popitem(last=False)
        return _shifts[key]


_shifts: OrderedDict[tuple[object, ...], np.ndarray] = OrderedDict()
_keeping = Lock()


def _blurred(s: State) -> np.ndarray:
    along = s.curvature
    return np.asarray(np.float32(0.5) * (along[0] + along[1]), np.float32)


def _along(axis: int, t_exp: float) -> Field:
    def field(s: State) -> np.ndarray:
        return np.asarray(np.float32(0.5 * PATH * grown(s, t_exp) ** 2) * s.curvature[axis], np.float32)

    return field
