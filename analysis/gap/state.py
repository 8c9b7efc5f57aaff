"""One condition as the model stands: simulated DN, and what sensitivities are made of, on every ``stride``-th pixel."""

import hashlib
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import cv2
import numpy as np

from analysis.gap.conditions import Condition
from analysis.gap.expected import Expected, mean_dn
from analysis.gap.knots import Change, Knots
from analysis.gap.radiance import FINE, Changes, Rendered, pixels
from interchange.effects import Effect
from interchange.filtering import resample
from interchange.frames import apply
from interchange.image import Image, Quantity

KEPT = 8  # moved renderings, each with its neighbours
HERE, WAYS = (0, 0), ((1, 0), (-1, 0), (0, 1), (0, -1))


class State:
    """``effects`` are in the chain; ``flow`` (H, W, 2) px moves what was rendered (where it goes to, minus where it
    is). ``stride``: sensitivities are taken on every so many rows and columns. ``symmetric``: what a motion changes is
    told by the mean of simulation's and capture's gradients, exact to the second order of the motion (only to fit:
    it looks at the capture). Benhimane, Malis: Homography-based 2D visual tracking and servoing. IJRR 2007.

    ``scene``: effects of the scene that are in force, as ``knots`` renders them: what they change is added to what was
    rendered, with them or nearest to that."""

    def __init__(
        self,
        condition: Condition,
        effects: Sequence[Effect] = (),
        flow: np.ndarray | None = None,
        stride: int = 1,
        symmetric: bool = False,
        scene: Changes = (),
        knots: Knots | None = None,
    ) -> None:
        self.condition, self.effects, self.stride = condition, tuple(effects), stride
        self.symmetric = symmetric and not condition.shown.fine
        self.flow, self.scene = flow, scene
        self.camera, self.base = condition.camera, condition.shown.nearest(scene)
        self.changes: list[tuple[float, Change]] = []
        if knots is not None and scene != self.base.standing:
            ends = ((1.0, scene), (-1.0, self.base.standing))
            self.changes = [(sign, knots.change(condition.shown, end)) for sign, end in ends if end]
        self.shown = self.base
        if flow is not None:
            self.shown = moved(self.shown, flow)[HERE]
        self.shown = self._changed(self.shown, HERE)
        self.moved = replace(condition, rendered=self.shown)

    def _changed(self, shown: Rendered, way: tuple[int, int]) -> Rendered:
        """With what the effects of the scene change, ``way`` (columns, rows) steps of the finer grid further."""
        if not self.changes:
            return shown
        lamps = dict(shown.lamps)
        for name in lamps:
            added = [
                sign * change.radiance({name: np.ones(3)}, self.camera.sensor.resolution)
                for sign, change in self.changes
                if name in change.lamps
            ]
            if added:
                lamps[name] = np.maximum(lamps[name] + self.placed(sum(added[1:], added[0]), way), 0)
        return replace(shown, lamps=lamps)

    def placed(self, plane: np.ndarray, way: tuple[int, int] = HERE) -> np.ndarray:
        """(H, W, 3): what was rendered where the scene says, moved as the image is."""
        if self.flow is None and way == HERE:
            return plane
        h, w = plane.shape[:2]
        x, y = np.meshgrid(np.arange(w, dtype=np.float32), np.arange(h, dtype=np.float32))
        if self.flow is not None:
            x, y = x - self.flow[..., 0].astype(np.float32), y - self.flow[..., 1].astype(np.float32)
        return resample(
            np.ascontiguousarray(plane), x - np.float32(way[0] / FINE), y - np.float32(way[1] / FINE)
        )

    def take(self, plane: np.ndarray) -> np.ndarray:
        return plane[:: self.stride, :: self.stride]

    def channels(self, dn: np.ndarray) -> np.ndarray:
        """(H, W, C) with as many channels as the captures have."""
        wanted = self.condition.mean.shape[2]
        if dn.shape[2] == wanted:
            return dn
        return dn.mean(axis=2, keepdims=True) if wanted == 1 else np.repeat(dn, 3, axis=2)

    @cached_property
    def radiance(self) -> np.ndarray:
        return self.shown.radiance(self.condition.scene)

    @cached_property
    def simulation(self) -> Expected:
        return self.moved.simulated(self.effects)

    def dn(self, effects: Sequence[Effect]) -> np.ndarray:
        """(H, W, C): mean DN with these effects in the chain."""
        image = Image(self.radiance, Quantity.RADIANCE, self.camera, passes=self.shown.passes)
        return self.channels(mean_dn(image, self.camera, effects))

    @cached_property
    def residual(self) -> np.ndarray:
        return self.take(self.condition.mean - self.simulation.dn)

    @cached_property
    def usable(self) -> np.ndarray:
        return self.take(self.condition.compared)

    @cached_property
    def per_radiance(self) -> np.ndarray:
        """(h, w, C): DN per radiance at each pixel, taken as if each pixel were alone."""
        one = Image(np.ones_like(self.radiance), Quantity.RADIANCE, self.camera, passes=self.shown.passes)
        none = replace(one, pixels=np.zeros_like(self.radiance))
        difference = mean_dn(one, self.camera, self.effects) - mean_dn(none, self.camera, self.effects)
        return self.take(self.channels(difference))

    @cached_property
    def lamps(self) -> dict[str, np.ndarray]:
        """(h, w, C) DN that each lamp which is on gives."""
        out = {}
        for name, weight in self.shown.weights(self.condition.scene).items():
            if weight.any():
                L = self.channels(self.take(self.shown.lamps[name]) * weight.astype(np.float32))
                out[name] = self.per_radiance * L
        return out

    @cached_property
    def signal(self) -> np.ndarray:
        """(h, w, C) DN above black."""
        return self.per_radiance * self.channels(self.take(self.radiance))

    @cached_property
    def gradient(self) -> tuple[np.ndarray, np.ndarray]:
        """(h, w, C) DN/px along columns and along rows; on the finer grid by what a step of it changes each way, as the
        differences of neighbouring pixels are not the slope of an edge between them."""
        if not self.condition.shown.fine:
            dy, dx = np.gradient(self.simulation.dn, axis=(0, 1))
            return self.take(dx), self.take(dy)
        views = moved(self.base, self.flow)
        slopes = []
        for axis in ((1, 0), (0, 1)):
            ahead, behind = (
                replace(self.condition, rendered=self._changed(views[way], way)).simulated(self.effects).dn
                for way in ((-axis[0], -axis[1]), axis)
            )
            slopes.append(self.take((ahead - behind) * np.float32(FINE / 2)))
        return slopes[0], slopes[1]

    @cached_property
    def symmetric_gradient(self) -> tuple[np.ndarray, np.ndarray]:
        """(h, w, C) DN/px: the mean of both gradients near edges, the simulation's where the capture's is noise."""
        e, c = self.simulation, self.condition
        dy, dx = np.gradient(e.dn, axis=(0, 1))
        real_y, real_x = np.gradient(c.mean, axis=(0, 1))
        noise = e.temporal / len(c.captures) + e.fixed
        steep = cv2.dilate(np.ascontiguousarray(dx**2 + dy**2), np.ones((3, 3), np.uint8)).reshape(dx.shape)
        half = 0.5 * steep / (steep + 9 * noise)
        return self.take(dx + half * (real_x - dx)), self.take(dy + half * (real_y - dy))

    @cached_property
    def grid(self) -> tuple[np.ndarray, np.ndarray]:
        """(h, w) column and row of every pixel that is taken."""
        h, w = self.condition.mean.shape[:2]
        column, row = np.meshgrid(np.arange(w, dtype=np.float32), np.arange(h, dtype=np.float32))
        return self.take(column), self.take(row)

    @cached_property
    def position(self) -> np.ndarray:
        """(h, w, 3) m in the world; far away on the pixel's ray where nothing is seen, on the axis where the lens
        images nothing: one NaN would spread into every mean."""
        seen = self.take(self.shown.passes["position"]).astype(np.float64)
        if np.isnan(seen).any():
            origin, direction = self.camera.rays(np.stack(self.grid, axis=-1))
            lost, eye = np.isnan(direction), self.camera.world_from_camera
            origin, direction = np.where(lost, eye[:3, 3], origin), np.where(lost, eye[:3, 2], direction)
            seen = np.where(np.isnan(seen), origin + 1e4 * direction, seen)
        return seen

    @cached_property
    def in_camera(self) -> np.ndarray:
        """(h, w, 3) m in the camera's frame."""
        return apply(self.camera.camera_from_world, self.position)

    @cached_property
    def normal(self) -> np.ndarray:
        return np.nan_to_num(self.take(self.shown.passes["normal"]))

    def shifted(self, du: np.ndarray, dv: np.ndarray) -> np.ndarray:
        """(h, w, C): what DN change by where the scene moves by (du, dv) px."""
        dx, dy = self.gradient if not self.symmetric else self.symmetric_gradient
        return np.asarray(-(dx * du[..., None] + dy * dv[..., None]), np.float32)


def moved(shown: Rendered, flow: np.ndarray | None) -> dict[tuple[int, int], Rendered]:
    """What is seen where the scene moves by ``flow`` (H, W, 2) px in the image: ``HERE``; and, of a finer grid, a
    step of it further in each of ``WAYS`` (columns, rows). The last ``KEPT`` are kept: conditions that
    differ in nothing but what the lamps give share them."""
    key = (id(shown), "" if flow is None else hashlib.sha256(flow.tobytes()).hexdigest())
    if key not in _kept:
        _kept[key] = shown, _moved_finely(shown, flow) if shown.fine else {HERE: _moved(shown, flow)}
        while len(_kept) > KEPT:
            _kept.popitem(last=False)
    _kept.move_to_end(key)
    return _kept[key][1]


_kept: OrderedDict[tuple[int, str], tuple[Rendered, dict[tuple[int, int], Rendered]]] = OrderedDict()


def _moved(shown: Rendered, flow: np.ndarray | None) -> Rendered:
    if flow is None:
        return shown
    h, w = flow.shape[:2]
    column, row = np.meshgrid(np.arange(w, dtype=np.float32), np.arange(h, dtype=np.float32))
    x, y = (column - flow[..., 0]).astype(np.float32), (row - flow[..., 1]).astype(np.float32)

    def there(plane: np.ndarray) -> np.ndarray:
        return resample(np.ascontiguousarray(plane), x, y)

    return replace(
        shown,
        lamps={} if shown.fine else {n: there(p) for n, p in shown.lamps.items()},
        rest=there(shown.rest) if shown.rest.any() else shown.rest,
        ambient=there(shown.ambient),
    )


def _moved_finely(shown: Rendered, flow: np.ndarray | None) -> dict[tuple[int, int], Rendered]:
    w, h = shown.camera.sensor.resolution
    n = next(iter(shown.fine.values())).shape[0] // h
    fine = {name: plane.astype(np.float32) for name, plane in shown.fine.items()}
    if flow is not None:
        column, row = np.meshgrid(np.arange(n * w, dtype=np.float32), np.arange(n * h, dtype=np.float32))
        flow_here = np.ascontiguousarray(n * flow, np.float32)
        by = cv2.resize(flow_here, (n * w, n * h), interpolation=cv2.INTER_LINEAR)
        x, y = column - by[..., 0], row - by[..., 1]
        fine = {name: resample(plane, x, y) for name, plane in fine.items()}
    wider = {name: cv2.copyMakeBorder(p, 1, 1, 1, 1, cv2.BORDER_REPLICATE) for name, p in fine.items()}
    base = _moved(shown, flow)
    return {
        (u, v): replace(
            base,
            lamps={
                name: pixels(p[1 - v : 1 - v + n * h, 1 - u : 1 - u + n * w], shown.scale, shown.camera)
                for name, p in wider.items()
            },
        )
        for u, v in (HERE, *WAYS)
    }
