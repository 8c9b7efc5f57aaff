"""Parts of an image, each pixel in exactly one of each kind."""

from collections.abc import Iterator, Sequence

import cv2
import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.compared.state import State
from analysis.gap.sensor.expected import SATURATED

EDGE, PENUMBRA = 2, 3  # px around geometry's and shadows' edges
HIGHLIGHT = 3.0  # times the median of its material in this image
ZONES = ("upper left", "upper middle", "upper right", "left", "centre", "right",
         "lower left", "lower middle", "lower right")  # fmt: skip


def names_of_ids(ids: np.ndarray, names: Sequence[str], plane: np.ndarray) -> Iterator[tuple[str, float]]:
    """Sum of ``plane`` over each name's pixels; -1 is the background."""
    sums = np.bincount(ids.reshape(-1) + 1, weights=plane.reshape(-1), minlength=len(names) + 1)
    present = np.bincount(ids.reshape(-1) + 1, minlength=len(names) + 1) > 0
    for k in np.flatnonzero(present):
        yield (names[k - 1].rsplit("/", 1)[-1] if k else "background"), float(sums[k])


def zones(shape: tuple[int, ...]) -> dict[str, np.ndarray]:
    """Nine parts of the image, a third of each side."""
    row = np.minimum(3 * np.arange(shape[0]) // shape[0], 2)[:, None]
    column = np.minimum(3 * np.arange(shape[1]) // shape[1], 2)[None, :]
    return {name: np.asarray(3 * row + column == k) for k, name in enumerate(ZONES)}


def light_regions(condition: Condition) -> dict[str, np.ndarray]:
    """saturated > edge > penumbra > highlight > shadow > lit: the first that a pixel is."""
    shown, model = condition.shown, condition.simulated()
    masks = {"saturated": np.maximum(condition.mean, model.dn).max(axis=2) >= SATURATED * model.top}
    masks["edge"] = _near(_steps(shown.passes["object_id"]) | _steps(shown.passes["material_id"]), EDGE)
    lit = [shown.passes[f"lit:{n}"] for n in condition.lamps if f"lit:{n}" in shown.passes]
    reached = np.zeros(masks["edge"].shape)
    partly = np.zeros(masks["edge"].shape, bool)
    for share in lit:
        reached += share
        partly |= ((share > 0.02) & (share < 0.98)) | _steps(share > 0.5)
    masks["penumbra"] = _near(partly, PENUMBRA) if lit else partly
    signal = np.maximum(model.dn - model.black, 0).mean(axis=2)
    highlight = np.zeros_like(partly)
    ids = shown.passes["material_id"]
    for k in np.unique(ids[ids >= 0]):
        own = (ids == k) & (reached > 0)
        if own.any():
            highlight |= own & (signal > HIGHLIGHT * np.median(signal[own]))
    masks["highlight"] = highlight
    masks["shadow"] = reached < 0.5 * max(len(lit), 1)
    masks["lit"] = np.ones_like(partly)
    taken = np.zeros_like(partly)
    out = {}
    for name, mask in masks.items():
        out[name] = mask & ~taken
        taken |= mask
    return out


def lamp_shares(state: State) -> dict[str, np.ndarray]:
    """(H, W, C) a lamp: what part of a pixel's light it gives; "no lamp" has the rest."""
    total = sum(state.lamps.values(), np.zeros(state.condition.mean.shape, np.float32))
    out = {}
    for name, plane in state.lamps.items():
        share = np.divide(plane, total, out=np.zeros_like(plane), where=total > 0)
        out[name.rsplit("/", 1)[-1]] = share.astype(np.float64)
    out["no lamp"] = 1.0 - sum(out.values(), np.zeros(state.condition.mean.shape))
    return out


def _steps(plane: np.ndarray) -> np.ndarray:
    found = np.zeros(plane.shape, bool)
    down, right = plane[1:] != plane[:-1], plane[:, 1:] != plane[:, :-1]
    found[1:] |= down
    found[:-1] |= down
    found[:, 1:] |= right
    found[:, :-1] |= right
    return found


def _near(mask: np.ndarray, px: int) -> np.ndarray:
    return np.asarray(cv2.dilate(mask.astype(np.uint8), np.ones((2 * px - 1, 2 * px - 1), np.uint8)) > 0)
