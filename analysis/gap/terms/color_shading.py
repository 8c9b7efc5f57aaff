"""How a flat field may differ from channel to channel: no cause.

Filters and microlenses take light by its angle, each colour's differently, so that the corners of a white field are
tinted; calibration leaves as much of that as its tolerance of a flat field says. Captures without any effect, of
another engine (rehearsal cases of benchmarks/blind), have 1 to 2 permil of it, one way in red and the other in blue;
without these terms that went into surfaces and into light.
"""

from collections.abc import Sequence

import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.compared.state import State
from analysis.gap.terms.base import NUISANCE, Field, Term
from analysis.gap.terms.generic import image_wave
from analysis.gap.terms.left import falling
from interchange.captures import Tolerances

SLOWEST = 2  # half waves over the image
COLORED = 0.5  # of a flat field's tolerance


def color_shading(conditions: Sequence[Condition], tolerances: Tolerances) -> list[Term]:
    """Of each camera that tells colours, in the slowest waves."""
    waves = [(i, j) for i in range(SLOWEST + 1) for j in range(SLOWEST + 1) if 0 < i + j <= SLOWEST]
    part = falling(waves)
    spike = COLORED / np.sqrt(3) * tolerances.flat_field  # of one channel's, over the signal of all
    return [
        Term(
            NUISANCE,
            camera,
            f"flat field of {'RGB'[k]} {i},{j}",
            "1",
            spike * part[i, j],
            _of_channel(image_wave(camera, i, j, True), k),
            relative=True,
        )
        for camera in dict.fromkeys(c.camera.name for c in conditions if c.mean.shape[2] == 3)
        for i, j in waves
        for k in range(3)
    ]


def _of_channel(whole: Field, channel: int) -> Field:
    def field(s: State) -> np.ndarray | None:
        found = whole(s)
        if found is None:
            return None
        out = np.zeros_like(found)
        out[..., channel] = found[..., channel]
        return out

    return field
