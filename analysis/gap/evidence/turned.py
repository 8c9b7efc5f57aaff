"""Whether captures tell a camera that has turned from a principal point that lies elsewhere.

Both shift all that is seen from one place by two numbers, and alike but for 1 + x²/f², which calibration leaves in the
image as well. Of captures that differ from the scene by θ of the one, the other explains all but

    M = θ' (G - G A⁻¹ G) θ,      A = G + P,  free in the other's two numbers, P what calibration leaves of the rest

in σ², and is exp(-M / 2 T) times as probable, T as blind cases showed it (analysis.gap.evidence.sureness). Not by
their log Z: where a hypothesis stands elsewhere, that of one and the same differs by 10 between two linearisations
that it is told from.

Atkinson, Fedorov: The design of experiments for discriminating between two rival models. Biometrika 1975.
"""

import numpy as np

from analysis.gap.evidence.likelihood import Evidence, Hypothesis
from analysis.gap.evidence.sureness import TEMPERATURE
from analysis.gap.terms.base import Cause
from interchange.effects.camera_pose import CameraPose
from interchange.effects.principal_point import PrincipalPoint

POSE, POINT = CameraPose.name(), PrincipalPoint.name()
SHIFTING = {POSE: ("rx", "ry"), POINT: ("cx", "cy")}


def alike(evidence: Evidence, best: Hypothesis, theta: np.ndarray) -> dict[Cause, tuple[Cause, float]]:
    """Of each cause of ``best`` that shifts what a camera sees, the other that could have, and how many times as
    probable that is; ``theta`` (q,): where the best stands."""
    found = {}
    for cause in best.causes:
        others = [
            c
            for c in evidence.members
            if _opposite(cause, c) and c not in best.causes and _whole(evidence, c)
        ]
        if len(others) == 1:  # a camera that has several stands turns at each by itself
            left = unexplained(evidence, cause, theta, others[0])
            found[cause] = others[0], float(np.exp(-left / (2 * TEMPERATURE)))
    return found


def unexplained(evidence: Evidence, cause: Cause, theta: np.ndarray, other: Cause) -> float:
    """M: what ``other`` leaves of ``cause`` at ``theta`` (q,), σ²."""
    G, precision = evidence.e.G, evidence.spike**-2
    precision[_shifting(evidence, other)] = 0.0
    own = np.zeros(len(G))
    own[evidence.members[cause]] = theta[evidence.members[cause]]
    shown = G @ own
    explained = np.linalg.solve(G + np.diag(precision), shown)
    return max(float(own @ shown - explained @ shown), 0.0)


def _opposite(cause: Cause, other: Cause) -> bool:
    of = {name: target.partition(" at ")[0] for name, target in (cause, other)}
    return of.keys() == SHIFTING.keys() and of[POSE] == of[POINT]


def _whole(evidence: Evidence, cause: Cause) -> bool:
    return len(_shifting(evidence, cause)) == len(SHIFTING[cause[0]])


def _shifting(evidence: Evidence, cause: Cause) -> list[int]:
    return [i for i in evidence.members[cause] if evidence.terms[i].parameter in SHIFTING[cause[0]]]
