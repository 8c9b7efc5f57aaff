"""What a photometric file holds: a luminous intensity distribution and what was said of its luminaire.

Goniometers turn in three ways (CIE 121-1996); a direction (x, y, w), w along the luminaire's axis (the light's
-z), has the angles

    type C:  cos V = w,           tan H = y / x     planes turn around the axis; H from 0 to 360 degrees
    type B:  tan V = y / w,       sin H = x         planes turn around x, the horizontal axis
    type A:  sin V = y,           tan H = x / w     planes turn around y, the vertical axis

``Profile`` is of type C; B and A are resampled to it.
"""

from dataclasses import dataclass, field

import numpy as np

from interchange.light import Profile
from interchange.problems import Problem


class BadAngles(Exception):
    """Why a set of angles cannot be used; the reader adds file and line."""


@dataclass(frozen=True, eq=False)
class Photometry:
    """``horizontal``, ``vertical``: the angles as they were measured, degrees; ``profile``: all around, candela.

    ``lumens``: flux of the bare lamps as stated, None for absolute photometry; ``efficiency``: stated share of
    it that leaves the luminaire, or None. ``size``: width, length, height of the luminous opening, m.
    """

    profile: Profile
    standard: str
    goniometer: str  # "C", "B", "A"
    symmetry: str
    horizontal: np.ndarray
    vertical: np.ndarray
    lamps: int
    lumens: float | None
    efficiency: float | None
    watts: float
    size: tuple[float, float, float]
    factor: float  # what the file's numbers were multiplied by
    keywords: dict[str, str] = field(default_factory=dict)
    notes: tuple[Problem, ...] = ()


def all_around(horizontal: np.ndarray, candela: np.ndarray) -> tuple[np.ndarray, np.ndarray, str]:
    """Type C half-planes (H, V) at ``horizontal`` degrees, mirrored to 0 .. 2 pi by where they begin and end.

    0 alone: the same all around; 0 to 90: four quarters; 0 to 180: mirrored at the plane 0-180; 90 to 270:
    mirrored at the plane 90-270; 0 to 360: no symmetry. Raises BadAngles for any other range.
    """
    h = np.asarray(horizontal, np.float64)
    if len(h) == 1:
        return np.zeros(1), candela, "rotational"
    first, last = float(h[0]), float(h[-1])
    symmetry = ""
    if (first, last) == (0, 90):
        symmetry = "quadrants"
        h, candela = np.concatenate([h, 180 - h[-2::-1]]), np.concatenate([candela, candela[-2::-1]])
    elif (first, last) in ((90, 270), (-90, 90)):
        symmetry = "plane 90-270"
        h = h % 360 if first < 0 else h
        order = np.argsort(np.concatenate([h, (180 - h[1:-1]) % 360]), kind="stable")
        h = np.concatenate([h, (180 - h[1:-1]) % 360])[order]
        candela = np.concatenate([candela, candela[1:-1]])[order]
        if h[0] != 0:
            raise BadAngles("Horizontal angles from 90 to 270 degrees must include 180")
        h, candela = np.append(h, 360.0), np.concatenate([candela, candela[:1]])
    elif first == 0 and 180 < last < 360 and 360 - last <= 1.01 * np.diff(h).max():
        symmetry = "none"  # EULUMDAT never repeats the first plane; some LM-63 files forget to
        h, candela = np.append(h, 360.0), np.concatenate([candela, candela[:1]])
    if float(h[0]) == 0 and float(h[-1]) == 180:
        symmetry = symmetry or "plane 0-180"
        h, candela = np.concatenate([h, 360 - h[-2::-1]]), np.concatenate([candela, candela[-2::-1]])
    elif (float(h[0]), float(h[-1])) != (0, 360):
        raise BadAngles(
            "Horizontal angles must be 0 alone, or run from 0 to 90, 180 or 360, or from 90 to 270 degrees; "
            f"got {first:g} to {last:g}"
        )
    return np.radians(h), candela, symmetry or "none"


def as_type_c(
    goniometer: str, horizontal: np.ndarray, vertical: np.ndarray, candela: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(phi, theta, candela) of type C, rad, from a table (H, V) of type B or A, degrees.

    Angles that begin at 0 stand for both sides. Bilinear in the table's own angles; 0 outside. The new grid is
    at least twice as fine as the table (steps of 0.1 to 1 degree).
    """
    if len(horizontal) < 2 or len(vertical) < 2:
        raise BadAngles(f"Type {goniometer} photometry needs two or more angles in both directions")
    spacing = min(np.diff(horizontal).min(), np.diff(vertical).min())
    step = float(np.clip(spacing / 2, 0.1, 1.0))
    around = vertical if goniometer == "B" else horizontal  # the angle that can go behind the luminaire
    top = 90.0 if np.abs(around).max() <= 90 else 180.0
    theta = np.radians(np.linspace(0, top, round(top / step) + 1))
    phi = np.radians(np.linspace(0, 360, 361))
    x, y = np.sin(theta) * np.cos(phi[:, None]), np.sin(theta) * np.sin(phi[:, None])
    w = np.broadcast_to(np.cos(theta), x.shape)
    if goniometer == "B":
        h, v = np.arcsin(np.clip(x, -1, 1)), np.arctan2(y, w)
    else:
        h, v = np.arctan2(x, w), np.arcsin(np.clip(y, -1, 1))
    h, v = np.degrees(h), np.degrees(v)
    h = np.abs(h) if horizontal[0] >= 0 else h
    v = np.abs(v) if vertical[0] >= 0 else v
    return phi, theta, _bilinear(horizontal, vertical, candela, h, v)


def _bilinear(x: np.ndarray, y: np.ndarray, table: np.ndarray, h: np.ndarray, v: np.ndarray) -> np.ndarray:
    near = 1e-9  # degrees: rounding of the angles above
    inside = (h >= x[0] - near) & (h <= x[-1] + near) & (v >= y[0] - near) & (v <= y[-1] + near)
    i = np.clip(np.searchsorted(x, h, side="right") - 1, 0, len(x) - 2)
    j = np.clip(np.searchsorted(y, v, side="right") - 1, 0, len(y) - 2)
    s = np.clip((h - x[i]) / (x[i + 1] - x[i]), 0, 1)
    t = np.clip((v - y[j]) / (y[j + 1] - y[j]), 0, 1)
    low = table[i, j] * (1 - t) + table[i, j + 1] * t
    high = table[i + 1, j] * (1 - t) + table[i + 1, j + 1] * t
    return np.where(inside, low * (1 - s) + high * s, 0.0)


def full_angle(profile: Profile, share: float, azimuth: float = 0.0) -> float:
    """Degrees between the directions, to both sides of the peak in the plane ``azimuth`` (rad), where the intensity
    has fallen to ``share`` of the largest in that plane: 0.5 gives the beam angle, 0.1 the field angle.

    360 where it does not fall that far.
    """
    angle = np.radians(np.linspace(-180, 180, 7201))
    values = profile.evaluate(np.abs(angle), np.where(angle >= 0, azimuth, azimuth + np.pi))
    peak = int(np.argmax(values))
    below = values < share * values[peak]
    if not below.any():
        return 360.0
    turned, low = np.roll(values[:-1], -peak), share * values[peak]
    right = int(np.argmax(turned < low))
    left = int(np.argmax(turned[::-1] < low)) + 1
    step = 360 / 7200
    n = len(turned)

    def crossing(inner: float, outer: float) -> float:
        return (inner - low) / (inner - outer)

    to_right = right - 1 + crossing(turned[right - 1], turned[right])
    to_left = left - 1 + crossing(turned[(n - left + 1) % n], turned[n - left])
    return float((to_right + to_left) * step)
