"""What a lens does to normalised image coordinates (x, y) = (X/Z, Y/Z): OpenCV's two models and their inverses.

``opencv``, 14 parameters k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 τx τy (those that are left out are 0), r² = x² + y²:

    q = (1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶)
    x' = x q + 2 p1 x y + p2 (r² + 2 x²) + s1 r² + s2 r⁴
    y' = y q + p1 (r² + 2 y²) + 2 p2 x y + s3 r² + s4 r⁴
    (x'', y'', 1) ~ T(τx, τy) (x', y', 1)      a sensor that is tilted against the lens (Scheimpflug)

``fisheye``, 4 parameters k1 k2 k3 k4 (Kannala, Brandt 2006), θ = atan r:

    (x', y') = (x, y) / r · θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸)

In these coordinates a lens sees less than 180°: what lies at right angles to its axis or behind has no (x, y).
"""

from collections.abc import Sequence
from enum import StrEnum
from functools import lru_cache

import numpy as np


class LensModel(StrEnum):
    OPENCV = "opencv"
    FISHEYE = "fisheye"


NAMES = {
    LensModel.OPENCV: (
        "k1",
        "k2",
        "p1",
        "p2",
        "k3",
        "k4",
        "k5",
        "k6",
        "s1",
        "s2",
        "s3",
        "s4",
        "tau_x",
        "tau_y",
    ),
    LensModel.FISHEYE: ("k1", "k2", "k3", "k4"),
}
Pair = tuple[np.ndarray, np.ndarray]


def padded(d: Sequence[float], model: LensModel) -> tuple[float, ...]:
    """``d`` with zeros for what it leaves out: 8 or 14 numbers, 4 of a fisheye.

    ValueError where there are more than the model has, or one is not finite."""
    most = len(NAMES[model])
    values = tuple(float(v) for v in d)
    if len(values) > most or not np.isfinite(values).all():
        raise ValueError(
            f"Lens.distortion must hold up to {most} finite numbers ({' '.join(NAMES[model])}); got {values}."
        )
    while len(values) > 8 and not values[-1]:
        values = values[:-1]
    size = most if model is LensModel.FISHEYE or len(values) > 8 else 8
    return values + (0.0,) * (size - len(values))


def distort(x: np.ndarray, y: np.ndarray, d: Sequence[float], model: LensModel = LensModel.OPENCV) -> Pair:
    """Normalised image coordinates after the lens."""
    if model is LensModel.FISHEYE:
        r = np.hypot(x, y)
        theta = np.arctan(r)
        scale = np.where(r > 1e-12, _fisheye(theta, d) / np.where(r > 1e-12, r, 1.0), 1.0)
        return x * scale, y * scale
    if not any(d):
        return x, y
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, *tilt = (*d, *(0.0,) * (14 - len(d)))
    r2 = x * x + y * y
    radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x) + r2 * (s1 + r2 * s2)
    v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y + r2 * (s3 + r2 * s4)
    return _mapped(tilted(*tilt), u, v) if any(tilt) else (u, v)


def undistort(x: np.ndarray, y: np.ndarray, d: Sequence[float], model: LensModel = LensModel.OPENCV) -> Pair:
    """The inverse of ``distort`` by Newton's method; NaN where the model folds and there is none."""
    if model is LensModel.FISHEYE:
        return _undistort_fisheye(x, y, tuple(d))
    if not any(d):
        return x, y
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, *tilt = (*d, *(0.0,) * (14 - len(d)))
    x, y = np.asarray(x, np.float64), np.asarray(y, np.float64)
    if any(tilt):
        x, y = _mapped(np.linalg.inv(tilted(*tilt)), x, y)
    flat = (*tuple(d)[:12], *(0.0,) * (12 - len(tuple(d)[:12])))
    u, v = np.array(x), np.array(y)
    for _ in range(20):
        r2 = u * u + v * v
        num, den = 1 + r2 * (k1 + r2 * (k2 + r2 * k3)), 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
        q = num / den
        dq = ((k1 + r2 * (2 * k2 + 3 * r2 * k3)) * den - num * (k4 + r2 * (2 * k5 + 3 * r2 * k6))) / (
            den * den
        )
        prism_x, prism_y = 2 * (s1 + 2 * s2 * r2), 2 * (s3 + 2 * s4 * r2)
        xx = q + 2 * u * u * dq + 2 * p1 * v + 6 * p2 * u + prism_x * u
        xy = 2 * u * v * dq + 2 * p1 * u + 2 * p2 * v + prism_x * v
        yx = 2 * u * v * dq + 2 * p1 * u + 2 * p2 * v + prism_y * u
        yy = q + 2 * v * v * dq + 6 * p1 * v + 2 * p2 * u + prism_y * v
        fx, fy = distort(u, v, flat)
        ex, ey, det = fx - x, fy - y, xx * yy - xy * yx
        u, v = u - (yy * ex - xy * ey) / det, v - (xx * ey - yx * ex) / det
    fx, fy = distort(u, v, flat)
    bad = ~(np.hypot(fx - x, fy - y) < 1e-9)
    return np.where(bad, np.nan, u), np.where(bad, np.nan, v)


def tilted(tau_x: float, tau_y: float) -> np.ndarray:
    """(3, 3): the homography from an upright sensor onto one that is turned by ``tau_x``, then ``tau_y``, rad.

    Louhichi et al.: Self-calibration of Scheimpflug cameras. Meas. Sci. Technol. 2007; as OpenCV has it.
    """
    (cx, sx), (cy, sy) = (np.cos(tau_x), np.sin(tau_x)), (np.cos(tau_y), np.sin(tau_y))
    R = np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]]) @ np.array([[1, 0, 0], [0, cx, sx], [0, -sx, cx]])
    return np.asarray(np.array([[R[2, 2], 0, -R[0, 2]], [0, R[2, 2], -R[1, 2]], [0, 0, 1]]) @ R)


def _mapped(H: np.ndarray, x: np.ndarray, y: np.ndarray) -> Pair:
    w = H[2, 0] * x + H[2, 1] * y + H[2, 2]
    return (H[0, 0] * x + H[0, 1] * y + H[0, 2]) / w, (H[1, 0] * x + H[1, 1] * y + H[1, 2]) / w


def _fisheye(theta: np.ndarray, d: Sequence[float]) -> np.ndarray:
    k1, k2, k3, k4 = d
    t2 = theta * theta
    return np.asarray(theta * (1 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4)))))


@lru_cache(maxsize=64)
def widest(d: tuple[float, ...]) -> float:
    """The angle from the axis, rad, up to which a fisheye's image height grows; at most π/2."""
    k1, k2, k3, k4 = d
    turns = np.roots([9 * k4, 7 * k3, 5 * k2, 3 * k1, 1.0])  # of its slope, in θ²
    real = turns[np.isreal(turns)].real
    return float(min([np.pi / 2, *np.sqrt(real[real > 0])]))


def _undistort_fisheye(x: np.ndarray, y: np.ndarray, d: tuple[float, ...]) -> Pair:
    """Newton's method, kept by bisection on the branch that grows from the axis."""
    k1, k2, k3, k4 = d
    radius = np.hypot(x, y)
    low, high = np.zeros_like(radius), np.full_like(radius, widest(d))
    theta = np.minimum(radius, high)
    for _ in range(60):
        error = _fisheye(theta, d) - radius
        low, high = np.where(error <= 0, theta, low), np.where(error > 0, theta, high)
        t2 = theta * theta
        slope = 1 + t2 * (3 * k1 + t2 * (5 * k2 + t2 * (7 * k3 + t2 * 9 * k4)))
        with np.errstate(divide="ignore", invalid="ignore"):
            step = theta - error / slope
        theta = np.where((step >= low) & (step <= high), step, (low + high) / 2)
        if np.all(np.abs(error) < 1e-15):
            break
    seen = (np.abs(_fisheye(theta, d) - radius) < 1e-9) & (theta < np.pi / 2 - 1e-6)
    scale = np.where(radius > 1e-12, np.tan(theta) / np.where(radius > 1e-12, radius, 1.0), 1.0)
    scale = np.where(seen, scale, np.nan)
    return x * scale, y * scale
