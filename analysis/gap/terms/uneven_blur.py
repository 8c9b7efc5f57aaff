"""A blur that is not the same everywhere: what its variance has more of in one place of the image than in another.

    σ² = σ0² + a r² + f r⁴ + b x + c y + d w + e w²     x, y: of half the image's diagonal from the axis; r² = x² + y²
                                                 w = z0 / z - 1, z along the axis, z0 that of what has edges

A lens's field curves (a; and f, as discs that grow by the square of how far out they are have a variance that grows by
the fourth power), its sensor leans (b, c), and a thin lens draws what is nearer than what it is focused on as discs
whose variance is a square of 1 / z (d, e; interchange.effects.defocus). By the heat equation each is its share of
½ (S_xx + S_yy), whatever blur there is already.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from analysis.gap.compared.state import State
from analysis.gap.sensor.uneven_optics import axis_of, from_axis
from analysis.gap.terms.base import Field, Term

CORNER, FOURTH = "variance more in the corner", "variance more in the corner, steeply"  # a, f, px²
LEANING = ("variance more to the right", "variance more downwards")  # b, c
NEARER = ("variance more where nearer", "variance more off the focus")  # d, e
# as parameters of UnevenBlur
DRAWN = {CORNER: "corner", FOURTH: "fourth", LEANING[0]: "right", LEANING[1]: "down"}
UNEVEN = (CORNER, FOURTH, *LEANING, *NEARER)
PART = 0.5  # of the blur itself: of what varies over the image there is less than of what does not
FOCUS = 0.1  # w of a focus that misses what is seen, typically; depths that differ less hardly differ in blur


def most(values: Mapping[str, float]) -> float:
    """px²: the most that the variance differs by from that on the axis, as ``values`` {parameter: θ} say, if all of
    what they say comes together."""
    square = np.linspace(0, 1, 21)
    radial = values.get(CORNER, 0.0) * square + values.get(FOURTH, 0.0) * square**2
    return float(np.abs(radial).max()) + sum(abs(values.get(n, 0.0)) for n in (*LEANING, *NEARER))


def uneven(blur: Term, state: State) -> list[Term]:
    """How much ``blur``, the variance of a defocus over the whole image, may differ within it: parts of its cause.
    What differs less than the blur does itself is expected to be so much less there without a cause too."""
    along = state.curvature
    weight = ((along[0] + along[1]) ** 2).sum(axis=-1)  # where a blur shows
    if not weight.any():
        return []
    inverse = 1 / _depth(state) if "position" in state.shown.passes else np.ones(weight.shape)
    middle = float(np.average(inverse, weights=weight))
    apart = float(np.average((inverse / middle - 1) ** 2, weights=weight) ** 0.5)
    depths = [min(apart / FOCUS, 1.0), min((apart / FOCUS) ** 2, 1.0)]
    shares = [PART, PART, PART, PART, *(PART * x for x in depths)]
    fields: list[Field] = [
        lambda s: _place(s)[0] ** 2 + _place(s)[1] ** 2,
        lambda s: (_place(s)[0] ** 2 + _place(s)[1] ** 2) ** 2,
        lambda s: _place(s)[0],
        lambda s: _place(s)[1],
        lambda s: 1 / (middle * _depth(s)) - 1,
        lambda s: (1 / (middle * _depth(s)) - 1) ** 2,
    ]
    return [
        replace(
            blur,
            parameter=name,
            unit="px^2",
            spike=blur.spike * share,
            part=share,
            field=_of_blur(field),
            power=1,
            low=-np.inf,
            kind="chain" if name in DRAWN else "linear",
            start=0.0,
        )
        for name, share, field in zip(UNEVEN, shares, fields, strict=True)
        if share > 0.01
    ]


def _of_blur(where: Field) -> Field:
    def field(s: State) -> np.ndarray:
        along = s.curvature
        share = where(s)
        assert share is not None
        return np.asarray(np.float32(0.5) * (along[0] + along[1]) * share[..., None], np.float32)

    return field


def _place(s: State) -> tuple[np.ndarray, np.ndarray]:
    column, row = s.grid
    return from_axis(column, row, s.camera.sensor.resolution, axis_of(s.camera))


def _depth(s: State) -> np.ndarray:
    """(h, w) m along the axis."""
    return np.maximum(s.in_camera[..., 2], 1e-9)
