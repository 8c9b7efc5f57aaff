"""Stripes over the image, of the periods at which captures differ most from their simulation; they have no cause."""

from collections.abc import Sequence

import cv2
import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.compared.state import State
from analysis.gap.terms.base import Field, Term
from analysis.gap.terms.normal_equations import stride_for

WAVES = "stripes fixed to the image"
PERIODS = 3  # that are tried
SHOWN = 0.1  # rms of a wave of amplitude 1 where the captures are looked at; of most it is 0.7


def stripe_terms(camera: str, conditions: Sequence[Condition], spike: float, slowest: int) -> list[Term]:
    """Waves over the image at the frequencies where what the captures have beyond the simulation, over the signal, is
    strongest: ``ways`` counts those that were looked at. ``slowest``: cycles over the image.

    Captures are looked at in one pixel of many, where a wave may look slower, up to being none: what looks slower than
    ``slowest`` there is no stripes, and what hardly shows there is not told of (stripes 6 px apart, in every third
    pixel, between their crests).
    """
    own = [c for c in conditions if c.camera.name == camera]
    h, w, channels = own[0].mean.shape
    numerator, denominator = np.zeros((h, w, channels)), np.zeros((h, w, channels))
    for c in own:
        model = c.simulated()
        s = np.where(c.compared[..., None], np.maximum(model.dn - model.black, 0), 0).astype(np.float64)
        dy, dx = np.gradient(model.dn, axis=(0, 1))
        weight = 1 / np.maximum(model.variance + (0.01 * s) ** 2 + 0.1 * (dx**2 + dy**2), 1e-12)
        numerator += weight * s * np.where(s > 0, c.mean - model.dn, 0)
        denominator += weight * s * s
    # what a wave of each frequency explains; what goes with the signal alone would leak from frequency 0
    numerator -= numerator.sum(axis=(0, 1)) / np.maximum(denominator.sum(axis=(0, 1)), 1e-30) * denominator
    window = np.hanning(h)[:, None, None] * np.hanning(w)[:, None]
    spectrum = np.fft.rfft2(numerator * window, axes=(0, 1))
    power = (np.abs(spectrum) ** 2).sum(axis=2)
    fy, fx = np.fft.fftfreq(h)[:, None], np.fft.rfftfreq(w)[None, :]
    stride = stride_for(conditions)
    for seen in (1, stride):  # pixels
        power[np.hypot(_cycles(fy, h, seen), _cycles(fx, w, seen)) < slowest] = 0  # slower waves are smooth
    if not power.any():
        return []
    peak = power >= cv2.dilate(power, np.ones((3, 3)))
    terms = []
    for k in np.argsort(-np.where(peak, power, 0), axis=None)[:PERIODS]:
        j, i = np.unravel_index(k, power.shape)
        u, v = float(fx[0, i]), float(fy[j, 0])
        angle = np.degrees(np.arctan2(v, u)) % 180
        name = f"{camera} period {1 / np.hypot(u, v):.1f} px at {angle:.0f} degrees"
        looked_at = np.arange(0, w, stride), np.arange(0, h, stride)[:, None]
        for phase, word in ((0.0, "cos"), (0.5, "sin")):
            if np.sqrt(np.mean(_wave(u, v, phase, *looked_at) ** 2)) < SHOWN:
                continue
            for channel in range(channels):
                terms.append(
                    Term(WAVES, name, f"{word} {channel}", "1", spike, _field(camera, u, v, phase, channel), True,
                         generic=True, ways=int((power > 0).sum()) // PERIODS)
                )  # fmt: skip
    return terms


def _cycles(frequency: np.ndarray, n: int, stride: int) -> np.ndarray:
    """Over ``n`` pixels, as it looks in every ``stride``-th of them."""
    each = frequency * stride
    return np.asarray((each - np.rint(each)) * n / stride)


def _wave(u: float, v: float, phase: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.asarray(np.cos(2 * np.pi * (u * x + v * y) - np.pi * phase))


def _field(camera: str, u: float, v: float, phase: float, channel: int) -> Field:
    def field(s: State) -> np.ndarray | None:
        if s.camera.name != camera:
            return None
        out = np.zeros_like(s.signal)
        out[..., channel] = s.signal[..., channel] * _wave(u, v, phase, *s.grid).astype(np.float32)
        return out

    return field
