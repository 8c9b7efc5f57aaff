"""Families without a cause, which compete with the effects on equal terms, so that the unknown is named as unknown.

Each says what the gap is fixed to: the image, the surface, the lamp (light_terms) or a capture.
"""

from collections.abc import Sequence

import numpy as np

from analysis.gap.conditions import Condition
from analysis.gap.light_terms import surface_coordinates
from analysis.gap.state import State
from analysis.gap.terms import Field, Term
from interchange.captures import Tolerances

ORDER = 5  # cosines a side

FACTOR, OFFSET = "fixed to the image, multiplicative", "fixed to the image, additive"
SURFACE, MIRROR, CAPTURE = "fixed to the surface", "mirrored copy", "fixed to a capture"


def generic_terms(conditions: Sequence[Condition], tolerances: Tolerances) -> list[Term]:
    t = tolerances
    terms = []
    waves = [(i, j) for i in range(ORDER) for j in range(ORDER) if 0 < i + j < ORDER + 1]
    spread = np.sqrt(len(waves))
    for camera in dict.fromkeys(c.camera.name for c in conditions):
        for i, j in waves:
            label = f"{camera} {i},{j}"
            terms.append(_term(FACTOR, label, t.flat_field / spread, _image(camera, i, j, True)))
            terms.append(_term(OFFSET, label, t.flat_field / 6 / spread, _image(camera, i, j, False)))
    spread = np.sqrt(len(waves))
    terms += [_term(SURFACE, f"{i},{j}", t.albedo / spread, _surface(i, j)) for i, j in waves]
    terms.append(_term(MIRROR, "ghost", t.flat_field / 6, _mirrored))
    terms += [_term(CAPTURE, c.name, t.light_intensity / 2, _capture(c.name)) for c in conditions]
    return terms


def _term(cause: str, parameter: str, spike: float, field: Field) -> Term:
    return Term(cause, "", parameter, "1", spike, field, relative=True, generic=True)


def _cosines(x: np.ndarray, y: np.ndarray, i: int, j: int) -> np.ndarray:
    return (np.cos(np.pi * i * x) * np.cos(np.pi * j * y)).astype(np.float32)[..., None]


def _image(camera: str, i: int, j: int, factor: bool) -> Field:
    def field(s: State) -> np.ndarray | None:
        if s.camera.name != camera:
            return None
        w, h = s.camera.sensor.resolution
        wave = _cosines((s.grid[0] + 0.5) / w, (s.grid[1] + 0.5) / h, i, j)
        return s.signal * wave if factor else np.broadcast_to(100 * wave, s.signal.shape)

    return field


def _surface(i: int, j: int) -> Field:
    def field(s: State) -> np.ndarray | None:
        p = surface_coordinates(s)
        return s.signal * _cosines(p[..., 0], p[..., 1], i, j)

    return field


def _mirrored(s: State) -> np.ndarray:
    return s.take((s.simulation.dn - s.simulation.black)[::-1, ::-1])


def _capture(name: str) -> Field:
    return lambda s: s.signal if s.condition.name == name else None
