"""Sums over products of a mode at the light and a mode at the camera, what expansions of a BRDF share.

    f = sum_jk c_jk Y_j(wi) Y_k(wo),    Y_(n, ±m) = r_nm(z) {sqrt2 Re p^m, sqrt2 Im p^m},    Y_(n, 0) = r_n0(z)

with p = x + i y a point of the plane that the direction is laid on. Reciprocity is c_jk = c_kj. An isotropic surface
leaves one coefficient for the pair of azimuthal modes ±m of n and n', and none for unequal m:

    c_nn'm (r_nm(wi) r_n'm(wo) + r_n'm(wi) r_nm(wo)) (2 - δ_m0) Re (p_i conj(p_o))^m
"""

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Modes:
    """Values at one direction: ``radial[n, m]``, m >= 0, without the factor |p|^m, and ``plane`` the point p."""

    radial: dict[tuple[int, int], Any]
    plane: tuple[Any, Any]


Pair = tuple[tuple[int, int], tuple[int, int]]


def pairs(numbers: list[tuple[int, int]], anisotropic: bool) -> list[Pair]:
    """Which coefficient stands where: ((n, m), (n', m')) by row, sine modes with m < 0; each unordered pair once."""
    if not anisotropic:
        ordered = sorted(numbers, key=lambda nm: (nm[1], nm[0]))
        return [(a, b) for k, a in enumerate(ordered) for b in ordered[k:] if a[1] == b[1]]
    signed = [(n, s) for n, m in numbers for s in ((m, -m) if m else (0,))]
    return [(a, b) for k, a in enumerate(signed) for b in signed[k:]]


def products(light: Modes, camera: Modes, anisotropic: bool) -> list[Any]:
    """What the coefficients of ``pairs`` multiply, in the same order."""
    highest = max(m for _, m in light.radial)
    index = pairs(list(light.radial), anisotropic)
    if anisotropic:
        i, o = _azimuthal(light, highest), _azimuthal(camera, highest)
        return [i[a] * o[b] if a == b else i[a] * o[b] + i[b] * o[a] for a, b in index]
    (xi, yi), (xo, yo) = light.plane, camera.plane
    turns = _powers(xi * xo + yi * yo, yi * xo - xi * yo, highest)
    found = []
    for a, b in index:
        both = light.radial[a] * camera.radial[b]
        if a != b:
            both = both + light.radial[b] * camera.radial[a]
        found.append(2.0 * both * turns[a[1]][0] if a[1] else both)
    return found


def _azimuthal(modes: Modes, highest: int) -> dict[tuple[int, int], Any]:
    powers = _powers(*modes.plane, highest)
    found = {}
    for (n, m), radial in modes.radial.items():
        if m == 0:
            found[n, 0] = radial
        else:
            found[n, m], found[n, -m] = (np.sqrt(2.0) * radial * part for part in powers[m])
    return found


def _powers(x: Any, y: Any, highest: int) -> list[tuple[Any, Any]]:
    """Real and imaginary part of (x + i y)^m for m = 0 ... highest."""
    found: list[tuple[Any, Any]] = [(1.0, 0.0), (x, y)]
    for _ in range(2, highest + 1):
        re, im = found[-1]
        found.append((re * x - im * y, re * y + im * x))
    return found


def summed(coefficients: Any, terms: list[Any]) -> Any:
    """max(sum_k c_k term_k, 0): a cut expansion may fall below zero, a reflectance may not."""
    total = coefficients.take(0) * terms[0]
    for k, term in enumerate(terms[1:], 1):
        total = total + coefficients.take(k) * term
    return np.maximum(total, 0.0)
