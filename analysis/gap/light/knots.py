"""What effects of the scene change, lamp by lamp, as the difference of two renderings.

Both are the rasteriser's, whichever renderer a diagnosis simulates with: direct light in a fraction of a second, with
the same spots of every pixel and lamp in both, so that sampling cancels in the difference. What moves an object alone
is rendered where that can be seen. Kept in memory and on disk under the content of the scene.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from analysis.gap.light.light_change import Change, difference, read, small, write
from analysis.gap.light.named import drawn, fingerprint
from analysis.gap.light.radiance import Changes, Rendered, changed
from analysis.gap.light.reach import cropped, region
from analysis.gap.light.reflections import Reflections, Weighted
from analysis.gap.parallel import by_asker
from interchange.camera import Camera
from interchange.effects import Effect
from interchange.effects.geometry import Geometry
from interchange.effects.light_position import LightPosition
from interchange.effects.light_size import LightSize
from interchange.effects.object_pose import ObjectPose
from interchange.effects.parts import bounds, has
from interchange.effects.shadow import TWIN
from interchange.scene import Scene
from realtime.renderers.rasterizer import Rasterizer

LARGEST = 200_000  # px that a rendering has at most; differences of larger images are enlarged
SENSITIVE = 60_000  # the same, of what tells a sensitivity alone, which one pixel in some is looked at
# a pixel: of what shades, moves, has penumbrae; and times how many of smaller images at most
SPOTS, MANY, SOFT = 8, 16, 64
FINER = 2
# texels along a side of a shadow map, eight a pixel in between: with 4096 steps of the bench's pin, bracket and lamps
# differ by up to 1.5 % in amount, stands by up to 4 %, for one and a half to four times the time
LEAST_SHADOWS, SHADOWS = 512, 2048


class Knots:
    """Renders changes as they are asked for. ``cache``: where they are kept. ``opened``: the rasteriser, opened by the
    first rendering that no cache holds, and kept until ``close``. ``reflections``: what the light by way of surfaces
    changes by, where the simulation has any (analysis.gap.light.reflections)."""

    def __init__(
        self,
        cache: Path,
        opened: Callable[[], Rasterizer] = lambda: Rasterizer(shadow_resolution=SHADOWS),
        reflections: Reflections | None = None,
    ) -> None:
        self.cache, self.opened, self.reflections = cache, opened, reflections
        self.rendered = 0  # images drawn so far
        self._rasterizer: Rasterizer | None = None
        self._scenes: dict[int, Scene] = {}  # which live as long as their ids are used
        self._changes: dict[tuple[int, tuple[int, int], Changes, float, int], Change] = {}
        self._base: dict[tuple[int, int, str], dict[str, np.ndarray]] = {}

    def change(self, shown: Rendered, effects: Changes) -> Change:
        """What ``effects``, one after the other, add to what was ``shown``. Raises BrightfieldError, ParameterError."""
        return self._kept(shown, effects, 0.0, LARGEST)

    def step(self, shown: Rendered, effects: Changes) -> Change:
        """The same, as fine as a sensitivity needs it."""
        return self._kept(shown, effects, 0.0, SENSITIVE)

    def reflected_change(self, shown: Rendered, effects: Changes) -> Weighted:
        """What ``effects`` add to the light that was reflected, beside ``change``."""
        return self.reflections.changes(shown, effects) if self.reflections and shown.indirect else ()

    def reflected_step(self, shown: Rendered, effect: Effect, target: str, parameter: str) -> Weighted:
        """The same of a unit more of a parameter, beside ``step``."""
        if not (self.reflections and shown.indirect):
            return ()
        return self.reflections.slope(shown, effect, target, parameter)

    def standing_off(self, shown: Rendered, offset: float) -> Change:
        """What it adds that shadows are cast on points ``offset`` m above the surfaces."""
        return self._kept(shown, (), offset, SENSITIVE)

    def _kept(self, shown: Rendered, effects: Changes, offset: float, most: int) -> Change:
        key = (id(shown.scene), shown.camera.sensor.resolution, effects, offset, most)

        def drawn() -> Change:
            if key not in self._changes:
                self._scenes[id(shown.scene)] = shown.scene
                after = changed(shown.scene, effects)
                self._changes[key] = self._between(shown, after, effects, offset, most)
            return self._changes[key]

        return self._changes[key] if key in self._changes else by_asker(drawn)

    def close(self) -> None:
        """Give the rasteriser back; what was rendered stays."""
        if self._rasterizer is not None:
            self._rasterizer.release()
        self._rasterizer = None

    def __enter__(self) -> "Knots":
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _between(self, shown: Rendered, after: Scene, effects: Changes, offset: float, most: int) -> Change:
        camera = small(shown.camera, most)
        width, height = camera.sensor.resolution
        spots = MANY if offset else max((_spots(effect) for effect, _ in effects), default=SPOTS)
        spots = round(spots * float(np.clip(most / (width * height), 1, FINER)))
        before, after = lit_by(effects, replace(shown.scene, cameras=()), replace(after, cameras=()))
        both = (before.bodies, before.lights, after.bodies, after.lights)
        name = fingerprint((*both, drawn(camera), spots, SHADOWS, *([offset] if offset else [])))
        file = self.cache / f"{name[:32]}.knot.npz"
        if file.is_file():
            return read(file)
        part = part_of(before, after, effects, camera)
        eye = cropped(camera, *part) if part else camera
        lamps = " ".join(x.name for x in before.lights)
        base = (id(shown.scene), spots, f"{part} {camera.sensor.resolution} {lamps}")
        if base not in self._base:
            self._base[base] = self._lamps(before, eye, spots)
        change = difference(self._lamps(after, eye, spots, offset), self._base[base])
        if part:
            change = change.placed(part[0].start, part[1].start)
        change = replace(change, size=(width, height))
        self.cache.mkdir(parents=True, exist_ok=True)
        write(file, change)
        return change

    def _lamps(self, scene: Scene, camera: Camera, spots: int, offset: float = 0.0) -> dict[str, np.ndarray]:
        if self._rasterizer is None:
            self._rasterizer = self.opened()
        self.rendered += 1
        side = 8 * max(camera.sensor.resolution)
        self._rasterizer.shadow_resolution = int(
            np.clip(1 << (side - 1).bit_length(), LEAST_SHADOWS, SHADOWS)
        )
        image = self._rasterizer.render(scene, camera, (), True, spots, shadow_offset=offset)
        found: dict[str, np.ndarray] = {}
        for name, plane in image.passes.items():
            if name.startswith("light:"):
                lamp = name.removeprefix("light:").removesuffix(TWIN)
                found[lamp] = found[lamp] + plane if lamp in found else plane
        return found


def lit_by(effects: Changes, before: Scene, after: Scene) -> tuple[Scene, Scene]:
    """Both with the lamps alone that change, where effects are about single lamps: light of all others is the same."""
    if not effects or not all(t and isinstance(e, LightPosition | LightSize) for e, t in effects):
        return before, after
    names = {t for _, t in effects}

    def lit(scene: Scene) -> Scene:
        return replace(scene, lights=tuple(x for x in scene.lights if x.name in names))

    return lit(before), lit(after)


def _spots(effect: Effect) -> int:
    if isinstance(effect, LightSize):
        return SOFT
    return MANY if isinstance(effect, LightPosition | ObjectPose | Geometry) else SPOTS


def part_of(before: Scene, after: Scene, effects: Changes, camera: Camera) -> tuple[slice, slice] | None:
    """Rows and columns that can change; None: all of them."""
    if not effects or not all(
        isinstance(effect, ObjectPose | Geometry) and target for effect, target in effects
    ):
        return None
    boxes = [bounds(s, target) for s in (before, after) for _, target in effects if has(s, target)]
    if not boxes:
        return None
    return region(after, boxes, camera)
