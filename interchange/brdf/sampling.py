"""Lobes that light paths are drawn from: a mixture of densities over the hemisphere (solid angle).

    COSINE  wi.z / pi
    POWER   (n + 1) / 2 pi  max(wi . axis, 0)^n
    GGX     D(h) h.z / (4 wo.h), D the Trowbridge-Reitz distribution of widths alpha_x, alpha_y
    BLINN   (n + 2) / 2 pi  h.z^(n + 1) / (4 wo.h)

with h the half vector of wi and wo. Walter et al. 2007 for the densities of half vectors.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import Any


class Shape(IntEnum):
    COSINE = 0
    POWER = 1
    GGX = 2
    BLINN = 3


@dataclass(frozen=True)
class Lobe:
    """``weight`` is relative to the others'. ``width`` is the exponent n, or alpha along the tangent;
    ``across`` is alpha along the bitangent, as ``width`` if None."""

    weight: Any
    shape: Shape = Shape.COSINE
    axis: tuple[Any, Any, Any] = (0.0, 0.0, 1.0)
    width: Any = 1.0
    across: Any = None


def mirror(wo: Any) -> tuple[Any, Any, Any]:
    """The direction whose light a mirror would send along ``wo``."""
    return -wo[0], -wo[1], wo[2]
