"""Textures that were found, laid onto their bodies: what they change in every capture, where that is on the surface.

    factor(p) = 1 + Σ s Δ / Σ s²      s: signal, Δ: what the textures add to it, over all pixels that show p

by a Gaussian of a texel, which has the size of a pixel of the view that shows the body largest. Where nothing was seen
it is 1.
"""

from collections.abc import Sequence

import cv2
import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.compared.laid import laid, parts
from analysis.gap.search.fit import Fit
from analysis.gap.terms.base import added

SIZE = 1.0  # texels
MOST = 2048  # texels a side of a body's box
KNOWN = 0.05  # of the median weight of texels: less is no pixel's
Patterns = dict[str, dict[str, np.ndarray]]


def patterns(conditions: Sequence[Condition], fitted: Fit) -> Patterns:
    """{material: {body: (h, w)}} of the textures among the causes; row 0 where v is 0."""
    index = [
        i
        for i, t in enumerate(fitted.terms)
        if t.cause == "texture" and t.candidate in fitted.best.causes and fitted.after.theta[i]
    ]
    out: Patterns = {}
    for material in dict.fromkeys(fitted.terms[i].target.partition(", ")[0] for i in index):
        own = [i for i in index if fitted.terms[i].target.partition(", ")[0] == material]
        out[material] = _laid_out(conditions, fitted, material, own)
    return out


def _laid_out(
    conditions: Sequence[Condition], fitted: Fit, material: str, own: Sequence[int]
) -> dict[str, np.ndarray]:
    lit = [c for c in conditions if c.lamps and material in c.shown.scene.material_names]
    shapes = {}
    for body, part in parts(lit, [material])[material].items():
        wide = part.shape / np.maximum((part.high - part.low)[::-1], 1e-6)
        shapes[body] = tuple(np.clip(np.ceil(wide), 1, MOST).astype(int))
    sums = {body: np.zeros((2, *shape)) for body, shape in shapes.items()}
    terms = [fitted.terms[i] for i in own]
    for c in lit:
        state = fitted.after.state(c)
        change = added(state, terms, fitted.after.theta[list(own)])
        usable = state.usable[..., None]
        planes = (usable * state.signal * change).sum(axis=-1), (usable * state.signal**2).sum(axis=-1)
        for body, at, u, v in laid(state, material):
            if len(u):
                h, w = shapes[body]
                place = np.clip((v * h).astype(int), 0, h - 1) * w + np.clip((u * w).astype(int), 0, w - 1)
                for k, plane in enumerate(planes):
                    sums[body][k] += np.bincount(place, plane[at], h * w).reshape(h, w)
    return {body: _factor(*both) for body, both in sums.items() if both[1].any()}


def _factor(up: np.ndarray, down: np.ndarray) -> np.ndarray:
    a, b = (cv2.GaussianBlur(x, (0, 0), SIZE) for x in (up, down))
    known = b > KNOWN * float(np.median(down[down > 0]))
    return np.asarray(1 + np.divide(a, b, out=np.zeros_like(a), where=known))
