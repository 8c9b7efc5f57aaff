"""Forms of the lens. Who writes the diagnosis does not read this folder.

Stages and signatures as in ``chain``.
"""

import cv2
import numpy as np

from benchmarks.blind.cause import Frame, Image, Shape
from benchmarks.blind.kernels import filtered, keys, spread, square

# ---- flow


def fov(x: Image, y: Image, channel: int, a: float, s: Shape) -> tuple[Image, Image]:
    """Devernay and Faugeras 2001: r_d = arctan(ω r_u) / ω, the middle's scale kept, or its inverse; a = ω²."""
    w = np.sqrt(a)
    r = np.maximum(np.hypot(x, y), 1e-9)
    angle = np.minimum(w * r, 1.4)
    k = (np.tan(angle) if s["sign"] > 0 else np.arctan(w * r)) / (w * r)
    return x * k, y * k


def zones(x: Image, y: Image, channel: int, a: float, s: Shape) -> tuple[Image, Image]:
    """Lateral colour of a lens that was corrected at one zone: it turns back beyond it; a tilted plate adds a step."""
    if channel == 1:
        return x, y
    k = a * (s["red"] if channel == 0 else s["blue"])
    g = 1 - k * (1 - s["zone"] * (x * x + y * y))
    step = k * s["plate"]
    return x * g - step * np.cos(s["angle"]), y * g - step * np.sin(s["angle"])


# ---- fine


def splat(x: np.ndarray, y: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Kernel of points at (x, y) fine px: their mean and second moments stay what they are."""
    kernel = np.zeros_like(square(float(max(np.abs(x).max(), np.abs(y).max())) + 3)[0])
    m = kernel.shape[0] // 2
    for u, v, q in zip(x, y, weight, strict=True):
        i, j = int(np.floor(v)), int(np.floor(u))
        kernel[m + i - 1 : m + i + 3, m + j - 1 : m + j + 3] += q * np.outer(keys(v - i), keys(u - j))
    return kernel


def blades(image: Image, a: float, s: Shape) -> Image:
    """Out of focus behind an iris of a few blades, its rim brighter or darker by spherical aberration; a px radius."""
    n = np.linspace(-1, 1, 25)
    x, y = (v.ravel() for v in np.meshgrid(n, n))
    sector = 2 * np.pi / s["blades"]
    angle = np.mod(np.arctan2(y, x) - s["angle"], sector) - sector / 2
    r = np.hypot(x, y)
    inside = r * np.cos(angle) <= np.cos(sector / 2)
    x, y, weight = x[inside], y[inside], (1 + s["rim"] * (2 * r * r - 1))[inside]
    x, y = x - np.average(x, weights=weight), y - np.average(y, weights=weight)
    return filtered(image, splat(a * s["fine"] * x, a * s["fine"] * y, weight))


def curved(image: Image, a: float, s: Shape) -> Image:
    """Field curvature: a Gaussian of rms a px × |zone - r²|, sharp on one ring. Between blurs of a few widths images
    are mixed by variance."""
    h, w = image.shape[:2]
    y, x = np.mgrid[:h, :w]
    r2 = ((x - (w - 1) / 2) ** 2 + (y - (h - 1) / 2) ** 2) / (np.hypot(h, w) / 2) ** 2
    variance = (a * s["fine"] * (s["zone"] - r2)) ** 2
    step = max(float(variance.max()) / 4, 0.64)  # narrower Gaussians are badly sampled
    level = variance / step
    out = image * np.maximum(1 - level, 0)[..., None]
    for k in range(1, int(np.ceil(level.max())) + 1):
        weight = np.maximum(1 - np.abs(level - k), 0)[..., None]
        out = out + weight * cv2.GaussianBlur(
            image, (0, 0), np.sqrt(k * step), borderType=cv2.BORDER_REPLICATE
        )
    return out.astype(image.dtype)


def vibration(image: Image, a: float, s: Shape) -> Image:
    """A harmonic vibration of many periods: an ellipse of half axis a px, run through as a sine is, at any exposure."""
    p = 2 * np.pi * (np.arange(48) + 0.5) / 48
    along, across = a * s["fine"] * np.cos(p), a * s["fine"] * s["flat"] * np.sin(p)
    c, q = np.cos(s["angle"]), np.sin(s["angle"])
    return filtered(image, splat(c * along - q * across, q * along + c * across, np.ones_like(p)))


def settling(image: Image, a: float, s: Shape) -> Image:
    """A mount that creeps to rest while the shutter is open: the trace is bright where it ends; a px long."""
    path = np.exp(-s["rate"] * (np.arange(40) + 0.5) / 40)
    path = a * s["fine"] * (path - path.mean())
    return filtered(image, splat(np.cos(s["angle"]) * path, np.sin(s["angle"]) * path, np.ones_like(path)))


# ---- optics


def _radius(f: Frame, s: Shape) -> np.ndarray:
    x, y = f.grid
    return np.hypot((x - s["x"]) * s["squeeze"], (y - s["y"]) / s["squeeze"])


def rim(E: Image, a: float, s: Shape, f: Frame) -> Image:
    """A hood or a ring cuts off the outer field alone: nothing within a radius, from there a square law."""
    t = np.maximum(_radius(f, s) - s["from"], 0) / (1 - s["from"])
    return E * np.maximum(1 - a * t * t, 0)[..., None]


def bell(E: Image, a: float, s: Shape, f: Frame) -> Image:
    """exp(-a r^q): the pupil shrinks and the coating loses with the angle."""
    return E * np.exp(-a * _radius(f, s) ** s["power"])[..., None]


def barrel(E: Image, a: float, s: Shape, f: Frame) -> Image:
    """A share a of the light: part of it scattered evenly by the barrel, part in a halo of exp(-r / r0)."""
    r0 = s["r0"] * f.size[0]
    halo = spread(E, lambda r2: np.exp(-np.sqrt(r2) / r0))
    even = s["kept"] * E.mean(axis=(0, 1))
    return (1 - a) * E + a * (s["even"] * even + (1 - s["even"]) * halo)
