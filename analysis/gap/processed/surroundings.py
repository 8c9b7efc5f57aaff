"""What captures show where the scene shows nothing: the room around, which no simulation has."""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from analysis.gap.compared.conditions import Condition
from interchange.effects.parts import called

BRIGHT = 0.05  # of the mean signal where something is shown; glare and ghosts of lenses in use add less
AROUND = np.ones((9, 9), np.uint8)  # px: how far a silhouette's blur reaches
FAR = np.ones((33, 33), np.uint8)  # the same of one that nobody would focus by
LEAST = 100  # px


def without_surroundings(found: Sequence[Condition]) -> tuple[list[Condition], list[str]]:
    """Conditions that leave out where the scene shows nothing and captures show something, by camera, and a note of
    each. Where captures are as dark as the simulation there, they are kept: they tell of glare, ghosts and a black
    level. ``found`` is rendered."""
    bare = [_shows_nothing(c) for c in found]
    left_out, notes = set(), []
    for name in dict.fromkeys(c.camera.name for c in found):
        own = [(c, nothing) for c, nothing in zip(found, bare, strict=True) if c.camera.name == name]
        there = _brightness(own)
        if there > BRIGHT:
            left_out.add(name)
            share = float(np.mean([(nothing & c.mask).mean() for c, nothing in own]))
            notes.append(
                f"Nothing of the scene is in {100 * share:.0f} % of what {called(name)} captured, and captures are "
                f"{100 * there:.0f} % as bright there as where it is: surroundings that the scene file lacks. They are "
                f"left out; what they throw onto parts and into the lens is not simulated."
            )
    return [
        replace(c, mask=c.mask & ~_widened(nothing, AROUND)) if c.camera.name in left_out else c
        for c, nothing in zip(found, bare, strict=True)
    ], notes


def _shows_nothing(c: Condition) -> np.ndarray:
    """(H, W) bool."""
    return np.asarray(c.shown.passes["object_id"] < 0)


def _widened(region: np.ndarray, by: np.ndarray) -> np.ndarray:
    return np.asarray(cv2.dilate(region.astype(np.uint8), by) > 0)


def _brightness(own: Sequence[tuple[Condition, np.ndarray]]) -> float:
    """What captures have above the simulation where nothing is shown, and above what they have there in the dark, which
    is a black level; over the mean signal elsewhere."""
    more: list[float] = []
    dark: list[float] = []
    signal: list[float] = []
    for c, bare in own:
        nothing, something = ~_widened(~bare, FAR) & c.mask, ~bare & c.mask
        if min(np.count_nonzero(nothing), np.count_nonzero(something)) >= LEAST:
            simulated = c.simulated()
            (more if c.lamps else dark).append(float((c.mean - simulated.dn)[nothing].mean()))
            if c.lamps:
                signal.append(float((c.mean - simulated.black)[something].mean()))
    if not more:
        return 0.0
    return (float(np.mean(more)) - (float(np.mean(dark)) if dark else 0.0)) / max(
        float(np.mean(signal)), 1e-9
    )
