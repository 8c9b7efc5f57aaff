"""Forms of the sensor. Who writes the diagnosis does not read this folder.

Stages and signatures as in ``chain``.
"""

import numpy as np

from benchmarks.blind.cause import Frame, Image, Shape

# ---- sensor, on mean electrons


def shutter(e: Image, t: float, a: float, s: Shape, f: Frame) -> Image:
    """The shutter opens or closes late: a s more or less, whatever was asked for."""
    return e * max(1 + s["sign"] * a / t, 0)


def leak(e: Image, t: float, a: float, s: Shape, f: Frame) -> Image:
    """Each colour filter lets some of the others' light through, more where it is met obliquely."""
    x, y = f.grid
    M = np.array(s["matrix"])
    tilt = 1 + s["slope"] * (x * np.cos(s["angle"]) + y * np.sin(s["angle"]))
    return e + a * tilt[..., None] * (e @ (M - np.diag(M.sum(axis=1))).T)


def drain(e: Image, t: float, a: float, s: Shape, f: Frame) -> Image:
    """An antiblooming drain: above the knee, well / (1 + a), charge grows by its logarithm alone."""
    knee = s["well"] / (1 + a)
    soft = s["soft"] * s["well"]
    over = np.maximum(e - knee, 0)
    return np.where(e > knee, knee + soft * np.log1p(over / soft), e)


def taps(e: Image, t: float, a: float, s: Shape, f: Frame) -> Image:
    """A pedestal that the clamp leaves: halves of the sensor and its colours differ a little; some is dark current."""
    x, _ = f.grid
    half = 1 + s["halves"] * np.tanh(40 * x)[..., None]
    return e + s["sign"] * a * s["well"] * (1 - s["dark"] + s["dark"] * t) * half * np.array(s["colors"])


# ---- readout, on DN above black over the highest


def running_out(v: Image, a: float, s: Shape, f: Frame) -> Image:
    """(1 - e^-av) / (1 - e^-a): each site that is taken can't be taken again."""
    return np.where(v > 0, -np.expm1(-a * np.maximum(v, 0)) / -np.expm1(-a), v)


def bent(v: Image, a: float, s: Shape, f: Frame) -> Image:
    """Integral nonlinearity of a converter: a cubic that is right at both ends and at one place between."""
    w = np.clip(v, 0, 1)
    return v + s["sign"] * a * w * (1 - w) * (s["zero"] - w)
