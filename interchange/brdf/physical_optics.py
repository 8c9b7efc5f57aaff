"""What models by physical optics share: light scattered by Gaussian heights (Beckmann), and a mirror's narrow lobe.

    series(g, b) = sum_{m >= 1} e^-g g^m / (m! m) e^(-b / m)

g is the mean square of the phase that the heights give, e^-g the share of light that still leaves as from a mirror,
b = (T |v|)² / 4 for heights correlated over T and the tangential wave vector v. Up to g = 12 it is summed; beyond,
it is the integral over m about the largest term (Stirling's m!), by 11 nodes evenly spaced in sqrt(m). Both agree
with the series within 5e-5 of it where it is above 1e-4 of its peak.

Beckmann, Spizzichino: The scattering of electromagnetic waves from rough surfaces. Pergamon 1963.
"""

from typing import Any

import numpy as np

from interchange.brdf.microfacet import Vector, beckmann

TERMS = 32
SUMMED = 12.0  # g up to which TERMS of the series suffice


def series(g: Any, b: Any) -> Any:
    """The sum above for g, b >= 0; it may underflow to 0 far from the mirror direction."""
    term, total = np.exp(-g), 0.0 * g
    for m in range(1, TERMS + 1):
        term = term * (g / m)
        total = total + term * np.exp(-b / m) / m
    return np.where(g < SUMMED, total, _integral(np.maximum(g, SUMMED), b))


def _integral(g: Any, b: Any) -> Any:
    """Integral of e^-g g^m / (Gamma(m + 1) m) e^(-b / m) over m. Its exponent is taken relative to that of the largest
    term, at ln(m / g) = b / m², so that nothing large cancels."""
    x = 0.5 * lambert_w(2.0 * b / np.square(g))
    m = g * np.exp(x)
    rise = x * (1.0 + x * (1.5 + x * (5.0 / 6.0 + x * (7.0 / 24.0 + x * 0.075))))
    top = -g * np.where(x < 0.1, rise, 1.0 + (2.0 * x - 1.0) * np.exp(x))
    step = 0.5 / np.sqrt(1.0 + 2.0 * x)  # one standard deviation of sqrt(m), whose peak is sqrt(m) wide
    total = 0.0 * g
    for j in range(-5, 6):
        q = 1.0 + j * step / np.sqrt(m)
        u = np.square(q) - 1.0
        near = -0.5 + u * (1 / 6 + u * (-1 / 12 + u * (0.05 + u * (-1 / 30 + u * (1 / 42 - u / 56)))))
        fall = np.where(
            np.absolute(u) < 0.25, near * np.square(u), u - np.square(q) * 2.0 * np.log(np.maximum(q, 0.1))
        )
        k = m * np.square(q)
        stirling = -1.0 / (12.0 * k) + 1.0 / (360.0 * k * np.square(k))
        total = total + np.exp(top + m * (fall - x * np.square(u) / np.square(q)) + stirling) / np.square(q)
    return 2.0 * step * total / (np.sqrt(2.0 * np.pi) * m)


def lambert_w(c: Any) -> Any:
    """w >= 0 with w e^w = c >= 0, within 1e-6 of it: the guess of Iacono and Boyd 2017, improved by Newton twice."""
    log = np.log(1.0 + c)
    w = log * (1.0 - np.log(1.0 + log) / (2.0 + log))
    for _ in range(2):
        w = (np.square(w) + c * np.exp(-w)) / (1.0 + w)
    return w


def mirror_lobe(wi: Vector, wo: Vector, h: Vector, cos: Any, alpha: Any) -> Any:
    """A mirror seen with a finite solid angle, in 1/sr: D(h) h.z / (4 (wo.h) max(wi.z, wo.z)), D ``beckmann``.

    Reciprocal; its albedo tends to 1 for small ``alpha`` and never exceeds it, as h is drawn from D h.z and
    wi.z <= max(wi.z, wo.z). ``cos`` = wo.h.
    """
    return beckmann(h, alpha, alpha) * h[2] / (4.0 * cos * np.maximum(wi[2], wo[2]))
