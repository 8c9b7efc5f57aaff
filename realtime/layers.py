"""What is lit together: passes over the image, their layers, and the lamps' points that shine on them."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from realtime.gbuffer import GBuffer
from realtime.lamps import POWER, Sample, beam, is_shaped
from realtime.lens import Lensmap
from realtime.shadow_fit import Frustum
from realtime.through import Through
from realtime.view import View

CHUNK = 4  # lamps a draw
# depth of a pixel whose samples are lit one by one: if they are of one group more than its own, else
ALIKE, AMONG = 0.25, 0.75

Signature = tuple[str, bool, bool, str, int]


@dataclass(frozen=True, eq=False)
class Lit:
    """A lamp's point, ready for the shader: its record (rows, 4), and the frusta of its shadow map, if it casts any."""

    sample: Sample
    record: np.ndarray
    frusta: list[Frustum | None]

    @property
    def signature(self) -> Signature:
        """Points of one signature are lit by one program: mode, shaped, focused, beam, shadow maps."""
        light = self.sample.light
        return (
            self.sample.mode,
            is_shaped(light),
            light.focus != 0,
            beam(light),
            len(self.frusta),
        )

    def scaled(self, share: float) -> "Lit":
        record = self.record.copy()
        record[POWER, :3] *= share
        return Lit(self.sample, record, self.frusta)


@dataclass(frozen=True, eq=False)
class Pass:
    """One pass over the image: ``grid``² samples a pixel; ``aperture``: the eye's shift over the distance in focus.
    ``lensmap``: of a lens that distorts; ``view`` is then wide and looked up ray by ray, or drawn ``through`` it."""

    view: View
    grid: int
    jitter: np.ndarray
    aperture: np.ndarray
    lensmap: Lensmap | None
    through: Through | None = None

    @property
    def looked_up(self) -> bool:
        return self.lensmap is not None and self.through is None

    @property
    def defines(self) -> dict[str, object]:
        """Of shaders/locate.glsl."""
        through = self.through is not None
        blind = self.lensmap is not None and self.lensmap.blind
        return {"LENS": self.looked_up, "THROUGH": through, "BLIND": through and blind}


@dataclass(frozen=True, eq=False)
class Layer:
    """What is lit together: all samples of a pass, or, with ``base``, the 2 x 2 of each mixed pixel: ALIKE or AMONG."""

    buffer: GBuffer
    drawn: Pass
    base: float = 0.0

    @property
    def pick(self) -> bool:
        return self.base > 0

    def depth(self, number: int) -> float:
        """By which the samples of material group ``number`` are told apart: exact in 32 bits."""
        return AMONG if self.base == AMONG else self.base + (number + 1) / 65536


def chunks(points: list[Lit], apart: bool) -> Iterator[list[Lit]]:
    """Points of one signature, at most CHUNK at a time; ``apart``: of one lamp only."""
    alike: dict[tuple[object, ...], list[Lit]] = {}
    for point in points:
        alike.setdefault((point.signature, id(point.sample.light) if apart else 0), []).append(point)
    for group in alike.values():
        for i in range(0, len(group), CHUNK):
            yield group[i : i + CHUNK]
