"""A material's pattern as other views show it: what is left at the same place of a surface when another camera sees it,
or the same camera where the body lies elsewhere.

    m(p) = Σ w s r / Σ w s²      r: captures less simulation, s: signal, w: 1 / variance, over the pixels of all other
                                 views that show p, away from edges, shadows and highlights
    m_a - m_b                    by Gaussians a and b texels wide: detail between them

Times the signal of a view, detail has none of that view's noise, and nothing that stays with an image or a camera. Of
five sizes, each is weighed by how far views agree on it. Where they do, there is a pattern, and it is what the same
view's other conditions show: as sharp as that view has it, and where no other one looks. What is coarser waves or
places tell (material_terms).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import cv2
import numpy as np
from scipy.ndimage import map_coordinates

from analysis.gap.compared.conditions import Condition
from analysis.gap.compared.laid import Part, laid, parts
from analysis.gap.compared.regions import light_regions
from analysis.gap.compared.state import State
from analysis.gap.noise.fixed_pattern import flat
from analysis.gap.parallel import each
from analysis.gap.terms.base import Field

SIZES = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0)  # texels: detail is between each and the next
SMOOTH = 8.0  # texels: what is smoothed more is looked at on a grid a quarter as fine
FEWEST = 400  # texels that views share
AGREED = 0.5  # correlation of views from which on one of them is believed by itself
KNOWN = 0.1  # of the median weight of texels: less is no pixel's

View = tuple[str, bytes, bytes]  # a camera, where it stands and where the body does
Place = tuple[str, str]  # a material and a body of it
Sums = np.ndarray  # (2, h, w): Σ w s r and Σ w s² of each texel


@dataclass(frozen=True, eq=False)
class Pattern:
    """Of the ``part`` of a body that is seen: ``detail`` {view: {condition: (k, h, w)}} of k sizes for each condition
    that was looked at, and for any other of the view under ""."""

    part: Part
    detail: dict[View, dict[str, np.ndarray]]

    def at(self, view: View, condition: str, u: np.ndarray, v: np.ndarray, size: int) -> np.ndarray | None:
        """(n,): of one size at box coordinates; None where other views do not show enough of it."""
        found = self.detail.get(view)
        if found is None:
            return None
        x, y = self.part.texel(u, v)
        plane = found.get(condition, found[""])[size]
        return np.asarray(map_coordinates(plane, [y, x], order=1, mode="nearest"))


def pattern_fields(conditions: Sequence[Condition], names: Sequence[str]) -> dict[str, list[Field]]:
    """Of each of the materials ``names``, one field a size, each of rms 1 where it is known; none where no views share
    enough of it."""
    return {name: _fields(found, name) for name, found in _patterns(conditions, names).items()}


def _fields(patterns: dict[str, Pattern], name: str) -> list[Field]:
    fields = []
    for size in range(len(SIZES) - 1):
        planes = [found[""][size] for p in patterns.values() for found in p.detail.values()]
        known = np.concatenate([np.zeros(0), *(plane[plane != 0] for plane in planes)])
        if not known.size:
            return []
        rms = float(np.sqrt(np.mean(known**2)))
        fields.append(_field(patterns, name, size, rms))
    return fields


def _field(patterns: dict[str, Pattern], name: str, size: int, rms: float) -> Field:
    def field(s: State) -> np.ndarray | None:
        if name not in s.shown.scene.material_names or not s.lamps:
            return None
        out, known = np.zeros_like(s.signal), False
        for body, own, u, v in laid(s, name):
            if body in patterns and len(u):
                share = patterns[body].at(_view(s.condition, body), s.condition.name, u, v, size)
                if share is not None:
                    out[own], known = s.signal[own] * (share / np.float32(rms))[:, None], True
        return out if known else None

    return field


def _view(condition: Condition, body: str) -> View:
    where = next(b.world_from_body for b in condition.shown.scene.bodies if b.name == body)
    camera = condition.camera
    return camera.name, camera.world_from_camera.tobytes(), where.tobytes()


def _patterns(conditions: Sequence[Condition], names: Sequence[str]) -> dict[str, dict[str, Pattern]]:
    lit = [c for c in conditions if c.lamps]
    seen = parts(lit, names)
    sums: dict[Place, dict[View, dict[str, Sums]]] = {}
    for c, counted in zip(lit, each(partial(_counted, seen=seen), lit), strict=True):
        for (name, body), found in counted.items():
            sums.setdefault((name, body), {}).setdefault(_view(c, body), {})[c.name] = found
    out: dict[str, dict[str, Pattern]] = {name: {} for name in names}
    several = [place for place, by_view in sums.items() if len(by_view) > 1]
    for (name, body), detail in zip(several, each(lambda place: _detail(sums[place]), several), strict=True):
        if detail:
            out[name][body] = Pattern(seen[name][body], detail)
    return out


def _counted(c: Condition, seen: dict[str, dict[str, Part]]) -> dict[Place, Sums]:
    """What a condition shows of every body."""
    dn, state, out = c.simulated().dn, State(c), {}
    s, w = flat(c, dn)
    w = np.where(light_regions(c)["lit"][..., None], w, 0)
    planes = (w * s * (c.mean - dn)).sum(axis=-1), (w * s * s).sum(axis=-1)
    for name in (n for n in seen if n in c.shown.scene.material_names):
        for body, own, u, v in laid(state, name):
            if len(u):
                (h, width), (x, y) = seen[name][body].shape, seen[name][body].texel(u, v)
                place = np.clip(np.rint(y), 0, h - 1) * width + np.clip(np.rint(x), 0, width - 1)
                counted = [np.bincount(place.astype(int), plane[own], h * width) for plane in planes]
                out[name, body] = np.stack(counted).reshape(2, h, width)
    return out


def _detail(by_view: dict[View, dict[str, Sums]]) -> dict[View, dict[str, np.ndarray]]:
    """Of each view that shares enough with the others."""
    whole = {view: np.sum(list(own.values()), axis=0) for view, own in by_view.items()}
    out = {}
    for view, own in by_view.items():
        there, known = _between(np.sum([x for other, x in whole.items() if other != view], axis=0))
        here, looked = _between(whole[view])
        both = known & looked
        if both.sum() < FEWEST:
            continue
        agreed = _correlation(there[:, both], here[:, both]) > AGREED
        out[view] = {"": _filled(there, known, here, looked, agreed)}
        for name, one in own.items() if agreed.any() else ():
            out[view][name] = _filled(there, known, *_between(whole[view] - one), agreed)
    return out


def _between(sums: Sums) -> tuple[np.ndarray, np.ndarray]:
    """(k, h, w): what lies between a size and the next, and where (h, w) there is anything."""
    up, down = sums
    blurred = [[_blurred(x, sigma) for x in (up, down)] for sigma in SIZES]
    weight = blurred[0][1]
    known = weight > KNOWN * float(np.median(weight[down > 0])) if (down > 0).any() else down > 0
    smooth = [np.divide(a, b, out=np.zeros_like(a), where=known) for a, b in blurred]
    return np.stack([a - b for a, b in pairwise(smooth)]).astype(np.float32), known


def _blurred(plane: np.ndarray, sigma: float) -> np.ndarray:
    h, w = plane.shape
    if sigma <= SMOOTH or min(h, w) < 4 * SMOOTH:
        return cv2.GaussianBlur(plane, (0, 0), sigma)
    small = cv2.resize(plane, (-(-w // 4), -(-h // 4)), interpolation=cv2.INTER_AREA)
    return cv2.resize(cv2.GaussianBlur(small, (0, 0), sigma / 4), (w, h), interpolation=cv2.INTER_LINEAR)


def _correlation(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(k,): of each row (k, n)."""
    product, squares = (a * b).sum(axis=1), (a * a).sum(axis=1) * (b * b).sum(axis=1)
    return np.asarray(product / np.sqrt(np.maximum(squares, 1e-30)))


def _filled(
    there: np.ndarray, known: np.ndarray, here: np.ndarray, looked: np.ndarray, agreed: np.ndarray
) -> np.ndarray:
    """What other views show; of the sizes on which they ``agreed`` with it what this view does, as sharp as it is."""
    return np.where(looked & agreed[:, None, None], here, np.where(known, there, 0)).astype(np.float32)
