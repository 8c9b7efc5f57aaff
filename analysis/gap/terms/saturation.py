"""Terms of a well that fills up softly: what is lost above a share k of the sensor's range R.

∂S/∂c_k = -max(S - k R, 0)        k in KNEES, c_k >= 0

Any knee is about a sum of these. A hard one shows in the files themselves (analysis.gap.noise.codes).
"""

from collections.abc import Sequence

import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.compared.state import State
from analysis.gap.sensor.expected import SATURATED
from analysis.gap.terms.base import Field, Term
from analysis.gap.terms.left import SMOOTH
from interchange.camera import Sensor
from interchange.captures import Tolerances

KNEES = (0.5, 0.7, 0.8, 0.9)  # of the range: below, it is a response curve; above, hardly a pixel is compared
LEAST = 1e-3  # of an image's pixels that must be brighter,
WELL = 0.25  # by that part of what is left up to what is saturated: a loss that hardly shows says nothing of the rest


def saturation_terms(conditions: Sequence[Condition], tolerances: Tolerances) -> list[Term]:
    """Of the knees that enough pixels of some image lie well above."""
    seen = [k for k in KNEES if any(_bright(c, k) for c in conditions)]
    spike = SMOOTH * tolerances.flat_field / np.sqrt(max(len(seen), 1))
    return [Term("saturation", "", lost_above(k), "1", spike, _lost(k), relative=True, low=0.0) for k in seen]


def lost_above(knee: float) -> str:
    """The parameter's name."""
    return f"lost above {100 * knee:.0f} % of the range"


def _bright(condition: Condition, knee: float) -> bool:
    model = condition.simulated()
    well_above = knee + WELL * (SATURATED - knee)
    return bool((model.dn - model.black > well_above * _range(condition.camera.sensor)).mean() > LEAST)


def _range(sensor: Sensor) -> float:
    """DN."""
    return float(2**sensor.bits_out - 1 - sensor.black_out)


def _lost(knee: float) -> Field:
    def field(s: State) -> np.ndarray:
        above_black = s.take(s.simulation.dn) - np.float32(s.simulation.black)
        return np.asarray(-np.maximum(above_black - knee * _range(s.camera.sensor), 0), np.float32)

    return field
