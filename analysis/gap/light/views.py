"""What a camera sees of one arrangement where the image moves and the scene stands elsewhere, lamp by lamp.

Conditions that differ in the lamps' intensities and the exposure alone share it.
"""

import hashlib
from collections import OrderedDict
from dataclasses import replace
from threading import Lock, RLock

import cv2
import numpy as np

from analysis.gap.light.light_change import Change
from analysis.gap.light.radiance import Rendered, means, pixels, single
from analysis.gap.parallel import own_property
from analysis.gap.sensor.filters import at_filters
from analysis.gap.sensor.fine_optics import SHARP, Blur, blurred
from interchange.filtering import Edges, resample, resample_cells

KEPT = 6  # views, of which each has its neighbours
MOST_FINER = 400e6  # bytes of finer grids that are kept beside the last one
Way = tuple[int, int]  # columns and rows, in steps of the finer grid
HERE = (0, 0)
NOWHERE = (0.0, 0.0)
ACROSS = [(1, 0), (-1, 0), (0, 1), (0, -1)]
DIAGONAL = [(1, 1), (-1, -1), (1, -1), (-1, 1)]
Changes = tuple[tuple[float, Change], ...]  # each with its sign


class Views:
    """``base`` moved by ``flow`` (H, W, 2) px (where things go to, minus where they are), or its channels by one each,
    (H, W, 3, 2), with ``changes`` added, and blurred; and ``reflected`` times the light that the renderer does not
    draw."""

    def __init__(
        self,
        base: Rendered,
        flow: np.ndarray | None,
        changes: Changes,
        blur: Blur = SHARP,
        reflected: float = 0.0,
    ) -> None:
        self.base, self.flow, self.changes, self.blur, self.reflected = base, flow, changes, blur, reflected
        self._beside: dict[Way, Rendered] = {}
        self._wider: dict[str, np.ndarray] | None = None
        self._drawing = RLock()  # conditions that share it wait for what another draws

    @property
    def here(self) -> Rendered:
        with self._drawing:
            return self._here

    @own_property
    def _here(self) -> Rendered:
        if self.base.fine and (self.flow is not None or self.blur != SHARP):
            return self._finely([HERE])[HERE]
        return self._changed(self._moved(), HERE)

    def beside(self, way: Way) -> Rendered:
        """``way`` further; of a base with a finer grid."""
        with self._drawing:
            if way not in self._beside:
                self._beside |= self._finely(ACROSS if way in ACROSS else DIAGONAL)
                if len(self._beside) == len(ACROSS) + len(DIAGONAL):
                    self.forget_finer()  # nothing is left to be asked for
            return self._beside[way]

    @own_property
    def _added(self) -> dict[str, np.ndarray]:
        """(H, W, 3) of each lamp whose light changes, where the scene says."""
        names = dict.fromkeys(name for _, change in self.changes for name in change.lamps)
        size = (self.base.origin or self.base).camera.sensor.resolution
        whole = {
            name: np.sum([sign * c.radiance({name: np.ones(3)}, size) for sign, c in self.changes], axis=0)
            for name in names
            if name in self.base.lamps
        }
        added = {
            name: at_filters(means(plane, self.base.coarse), self.base.camera)
            for name, plane in whole.items()
        }
        for name, plane in self.base.undrawn.items() if self.reflected else ():
            added[name] = added.get(name, 0.0) + np.float32(self.reflected) * plane
        return added

    def _changed(self, shown: Rendered, way: Way) -> Rendered:
        lamps = dict(shown.lamps)
        further = NOWHERE if way == HERE else (way[0] / self.base.finer, way[1] / self.base.finer)
        for name, plane in self._added.items():
            lamps[name] = np.maximum(lamps[name] + blurred(placed(plane, self.flow, further), self.blur), 0)
        return replace(shown, lamps=lamps)

    def _finely(self, ways: list[Way]) -> dict[Way, Rendered]:
        w, h = self.base.camera.sensor.resolution
        n = self.base.finer
        self._wider = wider = self._wider or self._finer()
        _keep_finer(self)
        base = self._moved()
        return {
            (u, v): self._changed(
                replace(
                    base,
                    lamps={
                        name: pixels(p[1 - v : 1 - v + n * h, 1 - u : 1 - u + n * w], base.scale, base.camera)
                        for name, p in wider.items()
                    },
                ),
                (u, v),
            )
            for u, v in ways
        }

    def _finer(self) -> dict[str, np.ndarray]:
        """Of each lamp the finer grid, moved and blurred, with a step of it around."""
        n = self.base.finer
        place = None if self.flow is None else _places(self.flow, n, n * self.base.margin)
        found = {}
        for name, plane in self.base.fine.items():
            there = single(plane)
            there = (
                there[self.base.frame] if place is None else _resampled(there, place, self.base.edges[name])
            )
            found[name] = cv2.copyMakeBorder(blurred(there, self.blur, n), 1, 1, 1, 1, cv2.BORDER_REPLICATE)
        return found

    @property
    def bytes_of_finer(self) -> int:
        return sum(plane.nbytes for plane in (self._wider or {}).values())

    def forget_finer(self) -> None:
        self._wider = None

    def _moved(self) -> Rendered:
        """What has no finer grid."""
        shown = self.base
        if self.flow is None and self.blur == SHARP:
            return shown

        def there(plane: np.ndarray) -> np.ndarray:
            return blurred(placed(plane, self.flow), self.blur) if plane.any() else plane

        return replace(
            shown,
            lamps={} if shown.fine else {n: there(p) for n, p in shown.lamps.items()},
            rest=there(shown.rest),
            ambient=there(shown.ambient),
            undrawn={n: there(p) for n, p in shown.undrawn.items()},
        )


def seen(
    base: Rendered,
    flow: np.ndarray | None,
    changes: Changes = (),
    blur: Blur = SHARP,
    reflected: float = 0.0,
) -> Views:
    """The last ``KEPT`` are kept."""
    moved = "" if flow is None else hashlib.sha256(flow.tobytes()).hexdigest()
    key = (id(base), moved, tuple((sign, id(change)) for sign, change in changes), blur, reflected)
    with _keeping:
        if key not in _kept:
            _kept[key] = Views(base, flow, changes, blur, reflected)
            while len(_kept) > KEPT:
                _kept.popitem(last=False)
        _kept.move_to_end(key)
        return _kept[key]


_kept: OrderedDict[tuple[int, str, tuple[tuple[float, int], ...], Blur, float], Views] = OrderedDict()
_keeping = Lock()
_with_finer: list[Views] = []  # whose finer grids are kept, the last ones


def _keep_finer(views: Views) -> None:
    """As what lies beside is asked for next, in most cases."""
    with _keeping:
        _with_finer[:] = [x for x in _with_finer if x is not views] + [views]
        while len(_with_finer) > 1 and sum(x.bytes_of_finer for x in _with_finer) > MOST_FINER:
            _with_finer.pop(0).forget_finer()


def placed(plane: np.ndarray, flow: np.ndarray | None, further: tuple[float, float] = NOWHERE) -> np.ndarray:
    """(H, W, 3): what was rendered where the scene says, moved as the image is, and columns and rows ``further``."""
    if flow is None and further == NOWHERE:
        return plane
    h, w = plane.shape[:2]
    more = np.array(further, np.float32)
    flow = np.broadcast_to(more, (h, w, 2)) if flow is None else flow + more
    return _resampled(plane, _places(flow, 1))


Places = list[tuple[np.ndarray, np.ndarray]]  # columns and rows, of all channels or of each


def _resampled(plane: np.ndarray, places: Places, edges: Edges | None = None) -> np.ndarray:
    """With the ``edges`` of a finer grid, as sharp as they are."""
    plane = np.ascontiguousarray(plane)
    if len(places) == 1:
        return resample(plane, *places[0]) if edges is None else resample_cells(plane, *places[0], edges)
    found = []
    for c, place in enumerate(places):
        one = plane[..., c : c + 1]
        found.append(resample(one, *place) if edges is None else resample_cells(one, *place, edges.of(c)))
    return np.concatenate(found, axis=2)


def _places(flow: np.ndarray, n: int, around: int = 0) -> Places:
    """Where each pixel of a grid ``n`` times finer comes from: columns and rows of one with ``around`` more on each
    side."""
    h, w = flow.shape[:2]
    column, row = np.meshgrid(np.arange(n * w, dtype=np.float32), np.arange(n * h, dtype=np.float32))
    found = []
    for own in [flow] if flow.ndim == 3 else [flow[:, :, c] for c in range(flow.shape[2])]:
        by: np.ndarray = np.ascontiguousarray(n * own, np.float32)
        if n > 1:
            by = cv2.resize(by, (n * w, n * h), interpolation=cv2.INTER_LINEAR)
        found.append((column - by[..., 0] + around, row - by[..., 1] + around))
    return found
