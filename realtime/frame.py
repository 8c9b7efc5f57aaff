"""One image in the making: passes over the bodies, each lit from one point (or a few) of every lamp."""

from collections.abc import Generator, Iterator
from dataclasses import replace

import numpy as np

from interchange.camera import Camera
from interchange.scene import Scene
from realtime import lamps, polytope, sampling
from realtime.bend import Bend, bend
from realtime.gbuffer import GBuffer
from realtime.layers import Lit, Pass, chunks
from realtime.lens import lensmap
from realtime.passes import Centre, centre, motion
from realtime.schedule import schedule
from realtime.shadow_fit import Visible
from realtime.shadow_maps import BUDGET
from realtime.stages import Stages
from realtime.target import Target
from realtime.through import LIVE, STILL, Through
from realtime.view import has_depth_of_field, view

LEAST, MOST, FINEST = 512, 2048, 4096  # texels along a side of a shadow map that is fitted to the image
LIVE_SAMPLES = 4  # up to here an image is meant to be fast; beyond, to be right
CUT = 0.5  # opacity from which a surface counts in the passes of the pixels' centres
MIDDLE = np.zeros(2)


def fitted_side(pixels: int, fine: bool, lamps: int) -> int:
    """Texels along a side of each lamp's map: two to a pixel, ``fine`` eight, as long as all maps can be kept."""
    side = 1 << int(np.ceil(np.log2((8 if fine else 2) * pixels)))
    side = int(np.clip(side, LEAST, FINEST if fine else MOST))
    while side > MOST // 2 and 4 * side * side * lamps > BUDGET:  # depth of four bytes
        side //= 2
    return side


class Frame:
    def __init__(
        self, stages: Stages, scene: Scene, camera: Camera, samples: int, shadow_side: int, once: bool
    ) -> None:
        self.stages, self.scene, self.camera = stages, scene, camera
        self.lights = [light for light in scene.lights if light.is_on]
        self.shown = [light for light in scene.lights if light.visible]  # one that is off is black, and hides
        self.size = camera.sensor.resolution
        self.lensmap = lensmap(camera)
        self.blurred = has_depth_of_field(camera)
        self.plan = schedule(samples, any(map(lamps.is_extended, self.lights)), self.blurred)
        self.origin = stages.bodies.origin
        self.tolerance = LIVE if samples <= LIVE_SAMPLES else STILL
        self.bend = self._bend()
        self.once = (
            once
            and self.plan.grid == 2
            and (self.lensmap is None or self.bend is not None)
            and bool(scene.bodies)
            and not stages.table.textured
            and not self.shown
        )
        self.side = shadow_side or fitted_side(max(self.size), samples > LIVE_SAMPLES, len(self.lights))
        self.visible = self._visible()
        rounds = self.plan.passes * self.plan.rounds
        self.points = [lamps.samples(light, i, rounds, self.origin) for i, light in enumerate(self.lights)]
        self._ready: dict[tuple[int, bool], Lit] = {}

    def radiance(self, alone: bool) -> Generator[None, None, tuple[np.ndarray, dict[str, np.ndarray]]]:
        """The image (H, W, 3), and each lamp's own by its name if ``alone``; in pieces of some lamps' light."""
        plan, targets = self.plan, self.stages.targets
        if plan.passes == 1 and (plan.grid == 1 or self.once) and not alone:
            return (yield from self._only_pass()), {}
        total = targets.get("total", self.size)
        own = {light.name: targets.get(f"light:{light.name}", self.size) for light in self.lights if alone}
        jitters = (sampling.square(plan.passes) - 0.5) / plan.grid
        spots = (
            sampling.shuffled(sampling.disk(plan.passes), 0) if self.blurred else np.zeros((plan.passes, 2))
        )
        shifts = sampling.shuffled(sampling.square(plan.passes), 1) - 0.5
        weight = 1.0 / (plan.passes * (1 if self.once else plan.grid**2))
        for k in range(plan.passes):
            drawn = self._pass(plan.grid, jitters[k], spots[k], shifts[k], self.bend)
            self._begin(drawn, k)
            yield
            if alone:
                self._own_light_by_lamp(own, weight)
            self._own_light(lamps_too=not alone)
            if alone:
                self.stages.lighting.resolve(total.framebuffer, weight)
            for chunk in chunks(list(self._points_of_pass(k)), alone):
                self._light(chunk, k)
                if alone:
                    target = own[chunk[0].sample.light.name]
                    self.stages.lighting.resolve(target.framebuffer, weight)
                yield
            if not alone:
                self.stages.lighting.resolve(total.framebuffer, weight)
        images = {name: target.read() for name, target in own.items()}
        targets.keep({"total", *(f"light:{name}" for name in own)})
        return sum(images.values(), total.read()), images

    def _only_pass(self) -> Generator[None, None, np.ndarray]:
        """The image of a single pass whose samples are pixels, without a sum."""
        lighting = self.stages.lighting
        self._begin(self._pass(self.plan.grid, MIDDLE, MIDDLE, bend=self.bend), 0)
        yield
        self._own_light()
        for chunk in chunks(list(self._points_of_pass(0)), False):
            self._light(chunk, 0)
            yield
        return lighting.read()

    def _begin(self, drawn: Pass, index: int) -> None:
        buffer = self._gbuffer(drawn, index)
        if self.once:
            merged, whole = self.stages.merge.draw(buffer, drawn)
            self.stages.lighting.begin_merged(merged, whole, buffer, drawn)
        else:
            self.stages.lighting.begin(buffer, drawn)

    def _own_light_by_lamp(self, own: dict[str, Target], weight: float) -> None:
        """Each lamp that the camera sees into its own image: the others hide it, and are dark."""
        for light in self.shown:
            if light.is_on:
                others = [x if x is light else replace(x, intensity=(0.0, 0.0, 0.0)) for x in self.shown]
                self.stages.lighting.show(others, self.origin)
                self.stages.lighting.resolve(own[light.name].framebuffer, weight)

    def _own_light(self, lamps_too: bool = True) -> None:
        """What shines into the camera by itself: lamps that it sees, and surfaces."""
        if lamps_too and self.shown:
            self.stages.lighting.show(self.shown, self.origin)
        if self.stages.table.emits:
            self.stages.lighting.add([], [])

    def centre_passes(self, wanted: tuple[str, ...], following: Scene | None) -> dict[str, np.ndarray]:
        """Passes through the pixels' centres."""
        drawn = self._pass(1, MIDDLE, MIDDLE)
        buffer = self._gbuffer(drawn, 0, threshold=CUT)
        seen = centre(self.camera, drawn.view, buffer, self.lensmap, self.origin)
        found: dict[str, np.ndarray] = {}
        for name in wanted:
            match name:
                case "depth" | "position" | "normal":
                    found[name] = getattr(seen, name).astype(np.float32)
                case "object_id":
                    names = {n: i for i, n in enumerate(self.scene.object_names)}
                    found[name] = _ids(seen, [names[b.name] for b in self.scene.bodies])
                case "material_id":
                    names = {n: i for i, n in enumerate(self.scene.material_names)}
                    found[name] = _ids(seen, [names[b.material.name] for b in self.scene.bodies])
                case "motion" if following is not None:
                    found[name] = motion(seen, self.scene, self.camera, following)
                case "lit":
                    found |= self._lit_shares(drawn, buffer)
        return found

    def _lit_shares(self, drawn: Pass, buffer: GBuffer) -> dict[str, np.ndarray]:
        """``lit:NAME``: of a lamp's points above the surface's horizon, the share that nothing hides."""
        found = {}
        lighting = self.stages.lighting
        lighting.begin(buffer, drawn)
        for light, points in zip(self.lights, self.points, strict=True):
            target = self.stages.targets.get("lit", self.size)
            for k, at_once in enumerate(points):
                for chunk in chunks([self._prepare(p, 1.0, whole=True) for p in at_once], False):
                    self._light(chunk, k, lit=True)
            lighting.resolve(target.framebuffer, 1.0)
            sums = target.read()
            share = np.divide(
                sums[..., 0], sums[..., 1], out=np.zeros(sums.shape[:2], np.float32), where=sums[..., 1] > 0
            )
            found[f"lit:{light.name}"] = share
        self.stages.targets.keep({"total"})
        return found

    def _light(self, chunk: list[Lit], index: int, lit: bool = False) -> None:
        maps = [self.stages.shadows.draw(p.frusta, self.side, p.sample, index) for p in chunk if p.frusta]
        self.stages.lighting.add(chunk, maps, lit)

    def _pass(
        self,
        grid: int,
        jitter: np.ndarray,
        spot: np.ndarray,
        shift: np.ndarray = MIDDLE,
        bend: Bend | None = None,
    ) -> Pass:
        lens, bodies = self.camera.lens, self.stages.bodies
        how = self.camera, self.origin, bodies.bounds, grid, jitter, spot, self.lensmap, shift
        seen = view(*how)
        aperture = (
            spot * lens.focal_length / (2 * lens.f_stop * lens.focus_distance) if self.blurred else MIDDLE
        )
        if bend is None:
            return Pass(seen, grid, jitter, aperture, self.lensmap)
        window = view(*how, through=True)
        through = Through(bend, bodies, window, seen.clip_from_world, aperture, self.tolerance)
        return Pass(window, grid, jitter, aperture, self.lensmap, through)

    def _bend(self) -> Bend | None:
        """The lens, if the bodies can be drawn through it."""
        found = bend(self.camera, self.lensmap) if self.lensmap is not None else None
        if found is None:
            return None
        through = self._pass(1, MIDDLE, MIDDLE, bend=found).through
        return found if through is not None and through.feasible else None

    def _gbuffer(self, drawn: Pass, index: int, threshold: float = 0.0) -> GBuffer:
        marked = threshold > 0 or not self.once
        return self.stages.gbuffer.draw(drawn.view, drawn.looked_up, index, threshold, marked, drawn.through)

    def _points_of_pass(self, k: int) -> Iterator[Lit]:
        for points in self.points:
            if len(points) == 1 and self.plan.passes * self.plan.rounds > 1:  # a lamp without extent
                yield self._prepare(points[0][0], 1.0)
                continue
            for r in range(self.plan.rounds):
                for point in points[k * self.plan.rounds + r]:
                    yield self._prepare(point, 1.0 / self.plan.rounds)

    def _prepare(self, point: lamps.Sample, share: float, whole: bool = False) -> Lit:
        """The point with its shadow maps' frusta; what shines equally in every pass is prepared once.
        ``whole``: its shadows also outside its beam."""
        key = (id(point), whole)
        if key not in self._ready:
            shadows = self.stages.shadows
            frusta = (
                shadows.frusta(point, self.visible, whole, self.side) if point.light.casts_shadows else []
            )
            self._ready[key] = Lit(
                point, shadows.record(point, frusta, self.side, self.visible.extent), frusta
            )
        ready = self._ready[key]
        return ready if share == 1.0 else ready.scaled(share)

    def _visible(self) -> Visible:
        """What of the scene the camera can see, a little enlarged for the spread of a pixel and of the lens."""
        bounds = self.stages.bodies.bounds - self.origin
        extent = float(np.linalg.norm(bounds[1] - bounds[0]))
        bounds = bounds + np.array([[-1.0], [1.0]]) * (1e-4 * extent + 1e-9)
        m = self._pass(1, MIDDLE, MIDDLE).view.clip_from_world
        wider = 1.12 if self.blurred else 1.02
        sides = [wider * m[3] + m[0], wider * m[3] - m[0], wider * m[3] + m[1], wider * m[3] - m[1]]
        planes = np.array([*sides, m[3] - m[2], m[2]])
        return Visible(bounds, polytope.cut(polytope.box(bounds), planes))


def _ids(seen: Centre, by_body: list[int]) -> np.ndarray:
    table = np.array([*by_body, -1], np.int32)  # body -1 finds the last entry
    return table[seen.body]
