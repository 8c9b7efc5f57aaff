"""How an effect may differ from its formula: its change of the image, modulated.

No formula is the effect itself: a fall-off is not quite a polynomial, a blur not quite a Gaussian. What a cause
changes, Δ, may be off by a share that varies slowly with the place in the image, the distance from its middle, the
brightness, the channel and the exposure time, in all cameras alike and in each, as every one has a lens and a sensor of
its own; and at each pixel by a share of its own (``doubt``). What the chain of an image changes may lie a little aside
and be a little wider: a blur's kernel need be neither even nor a Gaussian. Its third moment, and what its fourth has
beyond a Gaussian's, change an image by derivatives of what its variance changes: the first times -m3 / (3 m2) px, the
second times (m4 - 3 m2²) / (12 m2) px². Without this, what the formula of a strong effect leaves is taken for a second,
weak effect.

Kennedy, O'Hagan: Bayesian calibration of computer models. J. R. Stat. Soc. B 2001. Brynjarsdottir, O'Hagan: Learning
about physical parameters: the importance of model discrepancy. Inverse Problems 2014.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from analysis.gap.compared.state import State
from analysis.gap.terms.base import FORM, Cause, Field, Term
from interchange.effects import MODELS

SHARE = 0.1  # of an effect that its formula misses, by a slow modulation
OWN = 0.1  # and pixel by pixel

ASIDE = 0.1  # px that it may lie aside by, and px² that it may be wider by: a twentieth of a blur 2 px long
EXPOSURE = "with the exposure"
DISPLACED = ("to the right of it", "below it", "wider")


@dataclass(frozen=True, eq=False)
class Changed:
    """What a cause changes in a condition: ``dn`` (h, w, C); ``moved``: what more it would be ``DISPLACED`` by 1 px, or
    1 px²; nothing where it moves nothing in the image. ``bend``: what it changes beyond a straight line from nothing to
    where it is in force; None where it is in force nowhere."""

    dn: np.ndarray
    moved: dict[str, np.ndarray]
    bend: np.ndarray | None = None


Change = dict[str, Changed]  # by the condition's name
Modulation = Callable[[State], np.ndarray]


def form_terms(
    changes: dict[Cause, Change], cameras: Sequence[str] = (), exposures: Sequence[float] = ()
) -> list[Term]:
    """Terms that the evidence never widens, for each cause of ``changes``. Where there are several ``cameras``, each
    has its own of what the image chain does in all of them; ``exposures`` s: of each condition."""
    slow = MODULATIONS | ({EXPOSURE: _with_exposure(exposures)} if len(set(exposures)) > 1 else {})
    spike = SHARE / np.sqrt(len(slow))
    terms = [
        Term(
            FORM,
            f"{name} {target} {camera}".strip(),
            word,
            "1",
            spike,
            _modulated(change, modulation, camera),
        )
        for (name, target), change in changes.items()
        for camera in ("", *(cameras if len(cameras) > 1 and _of_every_camera(name, target) else ()))
        for word, modulation in slow.items()
    ]
    terms += [
        Term(FORM, f"{name} {target}".strip(), word, "px", ASIDE, _moved(change, word))
        for (name, target), change in changes.items()
        for word in DISPLACED
        if any(word in found.moved for found in change.values())
    ]
    return terms


def displaced(whole: np.ndarray) -> dict[str, np.ndarray]:
    """What (H, W, C) becomes more by 1 px to the right, 1 px further down, and wider by 1 px²."""
    down, right = np.gradient(whole, axis=(0, 1))
    wider = cv2.Laplacian(np.ascontiguousarray(whole, np.float32), cv2.CV_32F).reshape(whole.shape)
    return dict(zip(DISPLACED, (-right, -down, wider), strict=True))


def doubt(changes: Sequence[Change], state: State) -> np.ndarray | None:
    """(h, w, C) DN²: what each pixel of each cause's change may be off by."""
    own = [change[state.condition.name].dn for change in changes if state.condition.name in change]
    if not own:
        return None
    return np.asarray(OWN**2 * np.sum([np.square(x) for x in own], axis=0), np.float32)


def _of_every_camera(name: str, target: str) -> bool:
    return not target and name in MODELS and MODELS[name].is_of_the_chain()


def _modulated(change: Change, modulation: Modulation, camera: str) -> Field:
    """In the captures of one ``camera``, or of all where it is none's."""

    def field(s: State) -> np.ndarray | None:
        found = change.get(s.condition.name)
        if found is None or camera not in ("", s.camera.name):
            return None
        return np.asarray(found.dn * modulation(s), np.float32)

    return field


def _moved(change: Change, word: str) -> Field:
    def field(s: State) -> np.ndarray | None:
        found = change.get(s.condition.name)
        return None if found is None else found.moved.get(word)

    return field


def _across(axis: int) -> Modulation:
    def modulation(s: State) -> np.ndarray:
        n = s.camera.sensor.resolution[axis]
        return (2 * np.sqrt(3) * ((s.grid[axis] + 0.5) / n - 0.5))[..., None]

    return modulation


def _from_middle(s: State) -> np.ndarray:
    w, h = s.camera.sensor.resolution
    r2 = ((s.grid[0] + 0.5) / w - 0.5) ** 2 + ((s.grid[1] + 0.5) / h - 0.5) ** 2
    return np.asarray(((r2 - 1 / 6) / 0.105)[..., None])  # mean and deviation over a rectangle


def _brightness(s: State) -> np.ndarray:
    return np.asarray(np.tanh(s.signal / max(float(s.signal.mean()), 1e-9) - 1))


def _with_exposure(exposures: Sequence[float]) -> Modulation:
    """By its logarithm: mean and deviation over the conditions."""
    logs = np.log(exposures)
    mean, deviation = float(logs.mean()), float(logs.std())

    def modulation(s: State) -> np.ndarray:
        return np.array((np.log(s.camera.t_exp) - mean) / deviation)

    return modulation


def _channel(k: int) -> Modulation:
    def modulation(s: State) -> np.ndarray:
        n = s.signal.shape[2]
        unit = np.zeros(n)
        if n == 3:
            unit[k], unit[(k + 1) % 3] = 1.2, -1.2
        return unit

    return modulation


MODULATIONS: dict[str, Modulation] = {
    "to the right": _across(0),
    "downwards": _across(1),
    "from the middle": _from_middle,
    "with brightness": _brightness,
    "red against green": _channel(0),
    "green against blue": _channel(1),
}
