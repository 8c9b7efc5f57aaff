"""What effects of the scene change, lamp by lamp, as the difference of two renderings.

Both are the rasteriser's, whichever renderer a diagnosis simulates with: direct light in a fraction of a second, with
the same spots of every pixel and lamp in both, so that sampling cancels in the difference. What moves an object alone
is rendered where that can be seen. Kept in memory and on disk under the content of the scene.
"""

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from analysis.gap.named import drawn, fingerprint
from analysis.gap.parallel import by_asker
from analysis.gap.radiance import Changes, Rendered, weighted
from analysis.gap.reach import cropped, region
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
NOTHING = 1e-4  # of the largest difference: less is rounding of what was stored


@dataclass(frozen=True, eq=False)
class Change:
    """``lamps`` {name: (h, w, 3) float16} times ``scale`` is the change of radiance by each lamp as bright as rendered,
    in ``rows`` and ``columns`` of the image of ``size`` (width, height) that is enlarged to the camera's."""

    lamps: dict[str, np.ndarray]
    scale: float
    rows: slice
    columns: slice
    size: tuple[int, int]

    def radiance(self, weights: dict[str, np.ndarray], resolution: tuple[int, int]) -> np.ndarray:
        """(H, W, 3) float32 at ``resolution`` (width, height), each lamp weighted by (3,) numbers."""
        out = np.zeros((self.size[1], self.size[0], 3), np.float32)
        out[self.rows, self.columns] = self._part(weights)
        if self.size == resolution:
            return out
        return np.asarray(cv2.resize(out, resolution, interpolation=cv2.INTER_LINEAR))

    def at(
        self,
        weights: dict[str, np.ndarray],
        resolution: tuple[int, int],
        column: np.ndarray,
        row: np.ndarray,
    ) -> np.ndarray:
        """(h, w, 3) float32: the same at places (h, w) px of the image at ``resolution``."""
        part = self._part(weights)
        if not part.size:
            return np.zeros((*column.shape, 3), np.float32)
        x, y = (
            np.clip((place + 0.5) * (n / whole) - 0.5, 0, n - 1) - part_of.start
            for place, n, whole, part_of in zip(
                (column, row), self.size, resolution, (self.columns, self.rows), strict=True
            )
        )
        return np.asarray(
            cv2.remap(part, x.astype(np.float32), y.astype(np.float32), cv2.INTER_LINEAR,
                      borderMode=cv2.BORDER_CONSTANT)
        )  # fmt: skip

    def _part(self, weights: dict[str, np.ndarray]) -> np.ndarray:
        """(rows, columns, 3): what changes."""
        out = np.zeros(
            (self.rows.stop - self.rows.start, self.columns.stop - self.columns.start, 3), np.float32
        )
        for name, plane in self.lamps.items():
            weight = weights.get(name)
            if weight is not None and weight.any():
                out += weighted(plane.astype(np.float32), self.scale * weight)
        return out

    def placed(self, row: int, column: int) -> "Change":
        """The same, counted from elsewhere."""
        return replace(
            self,
            rows=slice(self.rows.start + row, self.rows.stop + row),
            columns=slice(self.columns.start + column, self.columns.stop + column),
        )


class Knots:
    """Renders changes as they are asked for. ``cache``: where they are kept. ``opened``: the rasteriser, opened by the
    first rendering that no cache holds, and kept until ``close``."""

    def __init__(
        self, cache: Path, opened: Callable[[], Rasterizer] = lambda: Rasterizer(shadow_resolution=SHADOWS)
    ) -> None:
        self.cache, self.opened = cache, opened
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
        camera = _small(shown.camera, most)
        width, height = camera.sensor.resolution
        spots = MANY if offset else max((_spots(effect) for effect, _ in effects), default=SPOTS)
        spots = round(spots * float(np.clip(most / (width * height), 1, FINER)))
        before, after = lit_by(effects, replace(shown.scene, cameras=()), replace(after, cameras=()))
        both = (before.bodies, before.lights, after.bodies, after.lights)
        name = fingerprint((*both, drawn(camera), spots, SHADOWS, *([offset] if offset else [])))
        file = self.cache / f"{name[:32]}.knot.npz"
        if file.is_file():
            return _read(file)
        part = part_of(before, after, effects, camera)
        eye = cropped(camera, *part) if part else camera
        lamps = " ".join(x.name for x in before.lights)
        base = (id(shown.scene), spots, f"{part} {camera.sensor.resolution} {lamps}")
        if base not in self._base:
            self._base[base] = self._lamps(before, eye, spots)
        change = _difference(self._lamps(after, eye, spots, offset), self._base[base])
        if part:
            change = change.placed(part[0].start, part[1].start)
        change = replace(change, size=(width, height))
        self.cache.mkdir(parents=True, exist_ok=True)
        _write(file, change)
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


def changed(scene: Scene, effects: Changes) -> Scene:
    """The scene with ``effects``, one after the other; what is never on, or not there yet, changes nothing."""
    for effect, target in effects:
        if has(scene, target):
            scene = effect.on_scene(scene, target)
    return scene


def lit_by(effects: Changes, before: Scene, after: Scene) -> tuple[Scene, Scene]:
    """Both with the lamps alone that change, where effects are about single lamps: light of all others is the same."""
    if not effects or not all(t and isinstance(e, LightPosition | LightSize) for e, t in effects):
        return before, after
    names = {t for _, t in effects}

    def lit(scene: Scene) -> Scene:
        return replace(scene, lights=tuple(x for x in scene.lights if x.name in names))

    return lit(before), lit(after)


def _small(camera: Camera, most: int) -> Camera:
    width, height = camera.sensor.resolution
    share = min(1.0, float(np.sqrt(most / (width * height))))
    return replace(camera.resized(max(1, round(width * share))) if share < 1 else camera, t_exp=1.0)


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


def _difference(after: dict[str, np.ndarray], before: dict[str, np.ndarray]) -> Change:
    lamps = {name: plane - before[name] for name, plane in after.items() if name in before}
    most = max((float(np.abs(d).max()) for d in lamps.values()), default=0.0)
    rows = columns = slice(0, 0)
    if most > 0:
        seen = np.max([np.abs(d).max(axis=2) for d in lamps.values()], axis=0) > NOTHING * most
        v, u = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
        rows, columns = slice(int(v[0]), int(v[-1]) + 1), slice(int(u[0]), int(u[-1]) + 1)
    scale = most or 1.0
    kept = {
        n: (d[rows, columns] / scale).astype(np.float16)
        for n, d in lamps.items()
        if np.abs(d).max() > NOTHING * scale
    }
    height, width = next(iter(before.values())).shape[:2] if before else (1, 1)
    return Change(kept, scale, rows, columns, (width, height))


def _write(file: Path, change: Change) -> None:
    place = [change.rows.start, change.rows.stop, change.columns.start, change.columns.stop, *change.size]
    beside = file.with_name(f".{file.stem}.{os.getpid()}.npz")
    lamps = {f"lamp:{name}": plane for name, plane in change.lamps.items()}
    np.savez(beside, place=np.array(place), scale=np.array(change.scale), **lamps)
    os.replace(beside, file)


def _read(file: Path) -> Change:
    with np.load(file) as stored:
        a, b, c, d, w, h = (int(x) for x in stored["place"])
        lamps = {n.removeprefix("lamp:"): stored[n] for n in stored.files if n.startswith("lamp:")}
        return Change(lamps, float(stored["scale"]), slice(a, b), slice(c, d), (w, h))
