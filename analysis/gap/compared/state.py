"""One condition as the model stands: simulated DN, and what sensitivities are made of, on every ``stride``-th pixel."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import cv2
import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.light.knots import Knots
from analysis.gap.light.light_change import Change
from analysis.gap.light.radiance import Changes, Rendered, weighted
from analysis.gap.light.views import Views, Way, seen
from analysis.gap.parallel import own_property
from analysis.gap.sensor.expected import Expected, dn_per_radiance, mean_dn
from analysis.gap.sensor.fine_optics import FineOptics, told_apart
from interchange.camera import Camera
from interchange.effects import Effect
from interchange.frames import apply
from interchange.image import Image, Quantity


class State:
    """``effects`` are in the chain; ``flow`` (H, W, 2) px moves what was rendered (where it goes to, minus where it
    is). ``stride``: sensitivities are taken on every so many rows and columns. ``symmetric``: what a motion changes is
    told by the mean of simulation's and capture's gradients, exact to the second order of the motion (only to fit:
    it looks at the capture). Benhimane, Malis: Homography-based 2D visual tracking and servoing. IJRR 2007.

    ``scene``: effects of the scene that are in force, as ``knots`` renders them: what they change is added to what was
    rendered, with them or nearest to that. ``reflected``: of the light that the renderer does not draw."""

    def __init__(
        self,
        condition: Condition,
        effects: Sequence[Effect] = (),
        flow: np.ndarray | None = None,
        stride: int = 1,
        symmetric: bool = False,
        scene: Changes = (),
        knots: Knots | None = None,
        reflected: float = 0.0,
    ) -> None:
        self.condition, self.effects, self.stride = condition, tuple(effects), stride
        self.symmetric = symmetric and not condition.shown.fine
        self.flow, self.scene, self.reflected = flow, scene, reflected
        self.camera, self.base = condition.camera, condition.shown.nearest(scene)
        changes: tuple[tuple[float, Change], ...] = ()
        if knots is not None and scene != self.base.standing:
            ends = ((1.0, scene), (-1.0, self.base.standing))
            # of coarse pixels few spots would not tell where in one an edge is: they are means of the origin's
            origin = condition.shown.origin

            def drawn(end: Changes) -> Change:
                return knots.step(origin, end) if origin else knots.change(condition.shown, end)

            changes = tuple((sign, drawn(end)) for sign, end in ends if end) + tuple(
                (sign * share, part)
                for sign, end in ends
                for share, part in knots.reflected_change(origin or condition.shown, end)
            )
        self._changes = changes
        self.optics, self.plain, self._rest = self._told_apart(self.effects)
        self.views = self._seen(self.optics)
        self.shown = self.views.here
        self.moved = replace(condition, rendered=self.shown, camera=self.plain)

    def _told_apart(self, effects: Sequence[Effect]) -> tuple[FineOptics, Camera, list[Effect]]:
        """What of the chain the finer grid does, where there is one."""
        if not self.base.fine:
            return FineOptics(), self.camera, list(effects)
        return told_apart(self.camera, effects, self.condition.mean.shape[2])

    def _seen(self, optics: FineOptics) -> Views:
        flow = optics.flow(self.camera, self.flow)
        return seen(self.base, flow, self._changes, optics.blur, self.reflected)

    def take(self, plane: np.ndarray) -> np.ndarray:
        return plane[:: self.stride, :: self.stride]

    def channels(self, dn: np.ndarray) -> np.ndarray:
        """(H, W, C) with as many channels as the captures have."""
        wanted = self.condition.mean.shape[2]
        if dn.shape[2] == wanted:
            return dn
        return dn.mean(axis=2, keepdims=True) if wanted == 1 else np.repeat(dn, 3, axis=2)

    @own_property
    def radiance(self) -> np.ndarray:
        return self.shown.radiance(self.condition.scene)

    @own_property
    def simulation(self) -> Expected:
        return self.moved.simulated(self._rest)

    def dn(self, effects: Sequence[Effect]) -> np.ndarray:
        """(H, W, C): mean DN with these effects in the chain."""
        optics, plain, rest = self._told_apart(effects)
        if optics == self.optics:
            return self._mean(self.shown, self.radiance, plain, rest)
        there = self._seen(optics).here
        return self._mean(there, there.radiance(self.condition.scene), plain, rest)

    def _mean(
        self, shown: Rendered, radiance: np.ndarray, camera: Camera, effects: Sequence[Effect]
    ) -> np.ndarray:
        image = Image(radiance, Quantity.RADIANCE, camera, passes=shown.passes)
        return self.channels(mean_dn(image, camera, effects))

    def _beside(self, way: Way) -> np.ndarray:
        """(H, W, C): mean DN ``way`` further on the finer grid."""
        there = self.views.beside(way)
        return self._mean(there, there.radiance(self.condition.scene), self.plain, self._rest)

    @own_property
    def residual(self) -> np.ndarray:
        return self.take(self.condition.mean - self.simulation.dn)

    @own_property
    def usable(self) -> np.ndarray:
        return self.take(self.condition.compared)

    @own_property
    def per_radiance(self) -> np.ndarray:
        """(h, w, C): DN per radiance at each pixel, where it is, taken as if each pixel were alone."""
        image = Image(self.radiance, Quantity.RADIANCE, self.plain, passes=self.shown.passes)
        return self.take(self.channels(dn_per_radiance(image, self.plain, self._rest)))

    @own_property
    def lamps(self) -> dict[str, np.ndarray]:
        """(h, w, C) DN that each lamp which is on gives."""
        out = {}
        for name, weight in self.shown.weights(self.condition.scene).items():
            if weight.any():
                L = self.channels(weighted(self.take(self.shown.lamps[name]), weight))
                out[name] = self.per_radiance * L
        return out

    @own_property
    def signal(self) -> np.ndarray:
        """(h, w, C) DN above black."""
        return self.per_radiance * self.channels(self.take(self.radiance))

    @own_property
    def gradient(self) -> tuple[np.ndarray, np.ndarray]:
        """(h, w, C) DN/px along columns and along rows; on the finer grid by what a step of it changes each way, as the
        differences of neighbouring pixels are not the slope of an edge between them."""
        if not self.base.fine:
            dy, dx = np.gradient(self.simulation.dn, axis=(0, 1))
            return self.take(dx), self.take(dy)
        slopes = [
            self.take((self._beside((-u, -v)) - self._beside((u, v))) * np.float32(self.base.finer / 2))
            for u, v in ((1, 0), (0, 1))
        ]
        return slopes[0], slopes[1]

    @own_property
    def curvature(self) -> tuple[np.ndarray, np.ndarray]:
        """(h, w, C) DN/px²: second derivatives along columns and along rows, by the same steps."""
        if not self.base.fine:
            second = np.array([[1.0, -2.0, 1.0]], np.float32)
            dn = self.simulation.dn
            along = [cv2.filter2D(dn, -1, k, borderType=cv2.BORDER_REPLICATE) for k in (second, second.T)]
            return self.take(along[0].reshape(dn.shape)), self.take(along[1].reshape(dn.shape))
        twice = 2 * self.simulation.dn
        both = [
            self.take(
                (self._beside((u, v)) + self._beside((-u, -v)) - twice) * np.float32(self.base.finer**2)
            )
            for u, v in ((1, 0), (0, 1))
        ]
        return both[0], both[1]

    @own_property
    def twist(self) -> np.ndarray:
        """(h, w, C) DN/px²: the mixed second derivative."""
        if not self.base.fine:
            return self.take(np.gradient(np.gradient(self.simulation.dn, axis=0), axis=1))
        same, other = (self._beside((1, v)) + self._beside((-1, -v)) for v in (1, -1))
        return self.take((same - other) * np.float32(self.base.finer**2 / 4))

    @own_property
    def symmetric_gradient(self) -> tuple[np.ndarray, np.ndarray]:
        """(h, w, C) DN/px: the mean of both gradients near edges, the simulation's where the capture's is noise."""
        e, c = self.simulation, self.condition
        dy, dx = np.gradient(e.dn, axis=(0, 1))
        real_y, real_x = np.gradient(c.mean, axis=(0, 1))
        noise = e.temporal / len(c.captures) + e.fixed
        steep = cv2.dilate(np.ascontiguousarray(dx**2 + dy**2), np.ones((3, 3), np.uint8)).reshape(dx.shape)
        half = 0.5 * steep / (steep + 9 * noise)
        return self.take(dx + half * (real_x - dx)), self.take(dy + half * (real_y - dy))

    @own_property
    def grid(self) -> tuple[np.ndarray, np.ndarray]:
        """(h, w) column and row of every pixel that is taken."""
        h, w = self.condition.mean.shape[:2]
        column, row = np.meshgrid(np.arange(w, dtype=np.float32), np.arange(h, dtype=np.float32))
        return self.take(column), self.take(row)

    @own_property
    def source(self) -> tuple[np.ndarray, np.ndarray]:
        """(h, w) column and row that every pixel which is taken shows of what was rendered."""
        if self.flow is None:
            return self.grid
        flow = self.take(self.flow).astype(np.float32)
        return self.grid[0] - flow[..., 0], self.grid[1] - flow[..., 1]

    @own_property
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

    @own_property
    def on_surface(self) -> np.ndarray:
        """(h, w, 3) in [0, 1] over the scene's bounds."""
        low, high = self.shown.scene.bounds
        return np.clip((self.position - low) / np.maximum(high - low, 1e-9), 0, 1)

    @own_property
    def kept(self) -> dict[tuple[object, ...], Any]:
        """What terms share of this state, by keys of their own."""
        return {}

    @own_property
    def in_camera(self) -> np.ndarray:
        """(h, w, 3) float32 m in the camera's frame."""
        return apply(self.camera.camera_from_world, self.position).astype(np.float32)

    @own_property
    def normal(self) -> np.ndarray:
        return np.nan_to_num(self.take(self.shown.passes["normal"]))

    def shifted(self, du: np.ndarray, dv: np.ndarray) -> np.ndarray:
        """(h, w, C): what DN change by where the scene moves by (du, dv) px."""
        dx, dy = self.gradient if not self.symmetric else self.symmetric_gradient
        return np.asarray(-(dx * du[..., None] + dy * dv[..., None]), np.float32)
