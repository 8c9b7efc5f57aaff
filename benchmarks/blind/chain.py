"""Lens and sensor of the truth: every effect of the image in a form of its own, none of them the catalogue's.

A ``Cause`` has a name of the file contract (or of something outside it), a form, an amplitude a and a shape (the
numbers that do not scale). It acts at one place of the chain, ``STAGE``:

| stage | gets |
|---|---|
| layer | one lamp's light on the fine grid, and what each fine pixel looks at |
| flow | px coordinates of the sensor, one channel: where in the scene's image a pixel looks |
| fine | the image on the fine grid, (h, w, 3) |
| optics | irradiance on the pixels, in electrons |
| sensor | mean electrons, and the exposure s |
| readout | DN above black over the highest, without noise |
| series | mean electrons of all shots in their order |
| noise | nothing of the mean: it changes how the image is drawn |
"""

from collections.abc import Callable, Sequence
from typing import Any

import cv2
import numpy as np

from benchmarks.blind.apart import forms as apart
from benchmarks.blind.bench import Bench, Lamp, Shot
from benchmarks.blind.cause import Cause, Frame, Image, Shape
from benchmarks.blind.kernels import filtered, keys, spread, square

__all__ = ["Cause", "Frame"]  # told here as well


# ---- flow: normalised coordinates of the pixel -> of the source


def _division(x: Image, y: Image, channel: int, a: float, s: Shape) -> tuple[Image, Image]:
    """Fitzgibbon 2001: r_u = r_d / (1 + λ r_d²)."""
    k = 1 / (1 + s["sign"] * a * (x * x + y * y))
    return x * k, y * k


def _offset(x: Image, y: Image, channel: int, a: float, s: Shape) -> tuple[Image, Image]:
    return x - a * np.cos(s["angle"]), y - a * np.sin(s["angle"])


def _wedge_colors(x: Image, y: Image, channel: int, a: float, s: Shape) -> tuple[Image, Image]:
    """Red and blue magnified about a point beside the axis, as a tilted element does; the more, the farther out."""
    if channel == 1:
        return x, y
    k = a * (s["red"] if channel == 0 else s["blue"])
    dx, dy = x - s["x"], y - s["y"]
    g = 1 - k * (1 + 0.3 * np.hypot(dx, dy))
    return s["x"] + dx * g, s["y"] + dy * g


# ---- fine: kernels on the fine grid; lengths in fine px


def _pillbox(image: Image, a: float, s: Shape) -> Image:
    """A disc, as geometrical optics has a lens out of focus; its rim is antialiased."""
    radius = a * s["fine"]
    sub = (np.arange(5) - 2) / 5
    x, y = square(radius + 1)
    kernel = sum((np.hypot(x + i, y + j) <= radius).astype(float) for i in sub for j in sub)
    if radius < 0.5:  # smaller than a fine pixel: the same second moment
        return _two_gaussians(image, a / 2, {**s, "share": 0.0})
    return filtered(image, np.asarray(kernel))


def _two_gaussians(image: Image, a: float, s: Shape) -> Image:
    """A core and a skirt 2.5 times as wide; the rms radius per axis is a px."""
    share = s.get("share", 0.15)
    core = a * s["fine"] / np.sqrt(1 - share + share * 6.25)
    x, y = square(max(4 * 2.5 * core if share else 4 * core, 2))
    r2 = x * x + y * y
    core = max(core, 1e-3)
    kernel = (1 - share) * np.exp(-r2 / 2 / core**2) / core**2
    kernel += share * np.exp(-r2 / 2 / (2.5 * core) ** 2) / (2.5 * core) ** 2
    if core < 0.7:  # too narrow to be sampled: by its second moment alone
        v = (a * s["fine"]) ** 2 / 2
        kernel = np.array([[0, v, 0], [v, 1 - 4 * v, v], [0, v, 0]])
    return filtered(image, kernel)


def _smear(image: Image, a: float, s: Shape) -> Image:
    """Motion that speeds up along a slightly bent path; a px from end to end in 1 s."""
    t = np.linspace(-0.5, 0.5, 25)
    along = a * s["fine"] * (t + s["speed"] * (t * t - 1 / 12))
    across = 0.15 * a * s["fine"] * (t * t - 1 / 12)
    c, q = np.cos(s["angle"]), np.sin(s["angle"])
    x, _y = square(a * s["fine"] * 0.7 + 2)
    kernel = np.zeros_like(x)
    m = x.shape[0] // 2
    for u, v in zip(c * along - q * across, q * along + c * across, strict=True):
        i, j = int(np.floor(v)), int(np.floor(u))
        kernel[m + i - 1 : m + i + 3, m + j - 1 : m + j + 3] += np.outer(keys(v - i), keys(u - j))
    return filtered(image, kernel)


# ---- optics, on electrons


def _cos_power(E: Image, a: float, s: Shape, f: Frame) -> Image:
    """cos^p of the field angle about a point beside the middle, tan 0.6 at the corner."""
    x, y = f.grid
    r2 = (x - s["x"]) ** 2 + (y - s["y"]) ** 2
    return E * ((1 + 0.36 * r2) ** (-a / 2))[..., None]


def _mechanical(E: Image, a: float, s: Shape, f: Frame) -> Image:
    """The overlap of two round apertures that shift against each other with the field."""
    x, y = f.grid
    d = np.minimum(a * np.hypot(x - s["x"], y - s["y"]), 1)
    return E * (2 / np.pi * (np.arccos(d) - d * np.sqrt(1 - d * d)))[..., None]


def _power_law(E: Image, a: float, s: Shape, f: Frame) -> Image:
    """A share a of the light is spread by (1 + r²/r0²)^-p; what falls beside the sensor is lost."""
    r0 = s["r0"] * f.size[0]
    return (1 - a) * E + a * spread(E, lambda r2: (1 + r2 / r0**2) ** -s["p"])


def _ghost(E: Image, a: float, s: Shape, f: Frame) -> Image:
    """A blurred copy turned by half a turn about the axis, smaller."""
    w, h = f.size
    M = np.array(
        [[-s["scale"], 0, (w - 1) / 2 * (1 + s["scale"])], [0, -s["scale"], (h - 1) / 2 * (1 + s["scale"])]]
    )
    copy = cv2.warpAffine(E.astype(np.float32), M, (w, h), flags=cv2.INTER_LINEAR)
    return E + a * cv2.GaussianBlur(copy, (0, 0), s["blur"])


def _dirt(E: Image, a: float, s: Shape, f: Frame) -> Image:
    x, y = f.grid
    shade = np.zeros_like(x)
    for cx, cy, r, k in s["spots"]:
        shade += k * np.exp(-((((x - cx) ** 2 + (y - cy) ** 2) / r**2) ** 1.5))
    return E * np.maximum(1 - a * shade, 0)[..., None]


def _stripes(E: Image, a: float, s: Shape, f: Frame) -> Image:
    x, y = f.grid
    return E * (1 + a * np.sign(np.sin(s["angle"] + s["waves"] * (y if s["rows"] else x))))[..., None]


def _moire(E: Image, a: float, s: Shape, f: Frame) -> Image:
    """Beats between a fine grating and the pixels: coloured waves where the image is bright."""
    x, y = f.grid
    out = E.copy()
    for c in range(3):
        wave = np.sin(s["u"] * x + s["v"] * y + 2.1 * c + 1.5 * np.sin(3 * y))
        out[..., c] *= 1 + a * wave
    return out


def _tone_map(E: Image, a: float, s: Shape, f: Frame) -> Image:
    """Each neighbourhood is drawn towards the middle grey."""
    y = E.mean(axis=2).astype(np.float32)
    local = cv2.GaussianBlur(y, (0, 0), s["radius"] * f.size[0])
    level = max(float(y.mean()), 1e-6)
    return E * (((local + 0.05 * level) / (1.05 * level)) ** -a)[..., None]


def _sharpen(E: Image, a: float, s: Shape, f: Frame) -> Image:
    return E + a * (E - cv2.GaussianBlur(E.astype(np.float32), (0, 0), s["radius"]))


# ---- sensor, on mean electrons


def _gain(e: Image, t: float, a: float, s: Shape, f: Frame) -> Image:
    return e * (1 + s["sign"] * a)


def _diffusion(e: Image, t: float, a: float, s: Shape, f: Frame) -> Image:
    """Neighbours R-G and G-B exchange charge, more towards the corners; grey stays grey."""
    x, y = f.grid
    c = a * (1 + 0.3 * (x * x + y * y))
    R, G, B = e[..., 0], e[..., 1], e[..., 2]
    k = s["blue"]
    return np.stack(
        [R + c * (G - R), G + 0.6 * c * (R - G) + 0.4 * k * c * (B - G), B + k * c * (G - B)], axis=-1
    )


def _soft_well(e: Image, t: float, a: float, s: Shape, f: Frame) -> Image:
    """Fills up softly towards a well that is smaller: e / (1 + (e / w)^12)^(1/12), w the well over 1 + a."""
    w = s["well"] / (1 + a)
    return e / (1 + (np.maximum(e, 0) / w) ** 12) ** (1 / 12)


def _offset_ramp(e: Image, t: float, a: float, s: Shape, f: Frame) -> Image:
    """Electrons at every pixel, a tenth more at the bottom than at the top, a little growing with the exposure."""
    _, y = f.grid
    return e + s["sign"] * a * s["well"] * ((0.97 + 0.03 * t) * (1 + 0.1 * y))[..., None]


# ---- readout, on DN above black over the highest


def _naka_rushton(v: Image, a: float, s: Shape, f: Frame) -> Image:
    return np.where(v > 0, v * (1 + a) / (1 + a * v), v)


def _quadratic(v: Image, a: float, s: Shape, f: Frame) -> Image:
    return np.where(v > 0, v * (1 + s["sign"] * a * (1 - v)), v)


def _color_gains(v: Image, a: float, s: Shape, f: Frame) -> Image:
    return v * (1 + a * np.array([s["red"], 0.0, s["blue"]]))


def _steps(v: Image, a: float, s: Shape, f: Frame) -> Image:
    """Fewer levels than the file has bits for: a is the size of a step over the range."""
    return np.rint(v / a) * a if a > 0 else v


FLOW: dict[str, Callable[..., Any]] = {
    "division": _division, "offset": _offset, "wedge colours": _wedge_colors
}  # fmt: skip
FINE: dict[str, Callable[..., Image]] = {
    "pillbox": _pillbox,
    "two Gaussians": _two_gaussians,
    "smear": _smear,
}
OPTICS: dict[str, Callable[..., Image]] = {
    "cosine power": _cos_power, "mechanical": _mechanical, "power law": _power_law, "ghost": _ghost, "dirt": _dirt,
    "stripes": _stripes, "moire": _moire, "tone map": _tone_map, "sharpen": _sharpen,
}  # fmt: skip
SENSOR: dict[str, Callable[..., Image]] = {
    "gain": _gain, "diffusion": _diffusion, "soft well": _soft_well, "offset ramp": _offset_ramp
}  # fmt: skip
READOUT: dict[str, Callable[..., Image]] = {
    "Naka-Rushton": _naka_rushton, "quadratic": _quadratic, "colour gains": _color_gains, "steps": _steps
}  # fmt: skip
NOISE = ("read noise", "gain error", "uneven pixels", "uneven columns")
FORMS = {**FLOW, **FINE, **OPTICS, **SENSOR, **READOUT}
# with the forms of apart/, by stage; ``layer`` and ``series`` have none but those
ALL: dict[str, dict[str, Callable[..., Any]]] = {
    stage: {**first, **apart.STAGES.get(stage, {})}
    for stage, first in (
        ("flow", FLOW), ("fine", FINE), ("optics", OPTICS), ("sensor", SENSOR), ("readout", READOUT),
        ("layer", {}), ("series", {}),
    )
}  # fmt: skip
SKY = ("sky", *apart.SKY)  # light of the surroundings
COLORED = {"wedge colours", *apart.COLORED}  # flows that differ from channel to channel


def is_chain(cause: Cause) -> bool:
    return cause.form in NOISE or any(cause.form in forms for forms in ALL.values())


def acting(causes: Sequence[Cause], stage: str) -> list[tuple[Callable[..., Any], Cause]]:
    return [(ALL[stage][c.form], c) for c in causes if c.form in ALL[stage] and c.amplitude]


def layer(
    causes: Sequence[Cause],
    found: dict[str, Image],
    where: dict[str, Image],
    bench: Bench,
    lamp: Lamp | None,
) -> dict[str, Image]:
    """``found``, ``where``: as ``tracing`` gives them; ``lamp`` None: the surroundings."""
    for form, c in acting(causes, "layer"):
        found = form(found, where, bench, lamp, c)
    return found


def flow(causes: Sequence[Cause], x: Image, y: Image, channel: int) -> tuple[Image, Image]:
    for form, c in acting(causes, "flow"):
        x, y = form(x, y, channel, c.amplitude, c.shape)
    return x, y


def fine(causes: Sequence[Cause], image: Image, factor: int) -> Image:
    for form, c in acting(causes, "fine"):
        image = form(image, c.amplitude, {**c.shape, "fine": factor})
    return image


def optics(causes: Sequence[Cause], E: Image, frame: Frame) -> Image:
    for form, c in acting(causes, "optics"):
        E = form(E, c.amplitude, c.shape, frame)
    return E


def sensor(causes: Sequence[Cause], e: Image, t: float, frame: Frame) -> Image:
    for form, c in acting(causes, "sensor"):
        e = form(e, t, c.amplitude, c.shape, frame)
    return e


def readout(causes: Sequence[Cause], v: Image, frame: Frame) -> Image:
    for form, c in acting(causes, "readout"):
        v = form(v, c.amplitude, c.shape, frame)
    return v


def series(causes: Sequence[Cause], shots: Sequence[Shot], means: list[Image]) -> list[Image]:
    for form, c in acting(causes, "series"):
        means = form(shots, means, c.amplitude, c.shape)
    return means
