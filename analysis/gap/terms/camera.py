"""Effects of the image chain and of the lens, of all cameras and of each: every one has a lens and a sensor of its own.

What calibration leaves of a number is both parts' together, what all cameras share and what each has. No hypothesis has
an effect of all of them and the same effect of one.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.compared.state import State
from analysis.gap.terms.base import Term
from analysis.gap.terms.chain import (
    OF_A_CAMERA,
    SHARED,
    VIBRATION,
    black_levels,
    black_of_channels,
    chain_terms,
    dark_current,
    dark_shading,
    differ,
    shutter_delay,
)
from analysis.gap.terms.subpixel import PRODUCT
from analysis.gap.terms.uneven_blur import UNEVEN
from interchange.camera import Camera
from interchange.captures import Tolerances
from interchange.effects import MODELS

OWN = float(np.sqrt(1 - SHARED**2))
SUMMED = ("black_level",)  # effects whose shared spike has ``SHARED`` in it


def camera_terms(conditions: Sequence[Condition], tolerances: Tolerances) -> list[Term]:
    """Of the chain, of all cameras and, where there are several, of each."""
    bright = _brightest(conditions)
    shared = chain_terms(State(bright), tolerances, {c.camera.t_exp for c in conditions})
    more = [
        *black_of_channels(conditions, tolerances),
        *dark_shading(conditions, tolerances),
        *dark_current(conditions, tolerances),
        *shutter_delay(conditions, tolerances),
    ]
    if not several(conditions):
        return [*shared, *black_levels(conditions, tolerances), *more]
    own = []
    for name in _names(conditions):
        its = [c for c in conditions if c.camera.name == name]
        seen, exposures = _brightest(its), {c.camera.t_exp for c in its}
        alike = seen.mean.shape[2] == bright.mean.shape[2] and all(
            _start(t, seen.camera) == t.start for t in shared
        )  # then they are drawn once
        found = shared if alike else chain_terms(State(seen), tolerances, exposures)
        own += of_one([t for t in found if t.target != VIBRATION or differ(exposures)], name)
    return [*of_all(shared), *own, *more]


def several(conditions: Sequence[Condition]) -> bool:
    return len(_names(conditions)) > 1


def of_all(terms: Sequence[Term]) -> list[Term]:
    return [replace(t, form=True, spike=t.spike * (1 if t.cause in SUMMED else SHARED)) for t in terms]


def of_one(terms: Sequence[Term], camera: str) -> list[Term]:
    return [
        replace(
            t,
            target=f"{camera}, {t.target}" if t.target else camera,
            camera=camera,
            spike=t.spike * (OF_A_CAMERA / SHARED if t.cause in SUMMED else OWN),
        )
        for t in terms
    ]


def _start(term: Term, camera: Camera) -> float:
    return (
        term.start
        if term.parameter in (PRODUCT, *UNEVEN)
        else float(getattr(MODELS[term.cause].of(camera), term.parameter))
    )


def _names(conditions: Sequence[Condition]) -> list[str]:
    return list(dict.fromkeys(c.camera.name for c in conditions))


def _brightest(conditions: Sequence[Condition]) -> Condition:
    return max(conditions, key=lambda c: float(np.median(c.mean)))
