"""Linear radiance of every capture, rendered once: lamp by lamp, since light adds up, and kept on disk.

    L(capture) = L_rest + sum over lamps (I_capture / I_rendered) L_lamp

Captures that differ in nothing but the lamps' intensities and the exposure share one rendering. It is made on a grid
``FINE`` times finer than the sensor's, with as many samples in all: pixels are means over ``FINE`` x ``FINE`` of its
values, and a motion of a part of a pixel moves edges as it does in a camera, which no interpolation of pixels can.
Reflected light is drawn on the sensor's own grid (analysis.gap.light.reflected).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from analysis.gap.light.named import arrangement, drawn, fingerprint, kept_on_disk
from analysis.gap.light.reflected import finely
from analysis.gap.light.room import COARSER, DOME, coarsely, leanings, share_of
from analysis.gap.parallel import own_property
from analysis.gap.sensor.filters import BehindFilters, at_filters, seen_through
from interchange.camera import Camera
from interchange.effects import Effect
from interchange.effects.parts import has
from interchange.filtering import Edges, edges
from interchange.image import Image
from interchange.light import Light
from interchange.scene import Scene

AMBIENT = "ambient"
PASSES = ("depth", "position", "normal", "object_id", "material_id", "lit")
SURFACES = ("object_id", "material_id", "normal")  # what tells them apart on the finer grid
FINE = 3  # odd: the middle of a pixel is the middle of one of its parts
MOST = 300e6  # bytes of a rendering on the fine grid; what needs more is made on the sensor's own
TRACED = 500_000  # pixels that reflected light is traced for at most, where it is not part of what is drawn
Key = tuple[str, str, str]  # of a term: its cause, what that is about, and its parameter
Changes = tuple[tuple[Effect, str], ...]  # effects of the scene, each with what it is about


class Paths(Enum):
    """Which light an image shows: all; what comes straight from the lamps; or all, of which what met another surface
    first is looked at alone, lamp by lamp."""

    ALL = "all"
    DIRECT = "direct"
    REFLECTED = "reflected"


# scene, camera, passes, per light, by how many pixels of its own a sensor's pixel is drawn, and which light
Render = Callable[[Scene, Camera, Sequence[str], bool, int, Paths], Image]


@dataclass(frozen=True, eq=False)
class Rendered:
    """What one camera sees of one arrangement: ``lamps`` {name: (H, W, 3)} at ``intensity``, and the passes.

    ``ambient`` (H, W, 3): under radiance 1 from everywhere; ``leaning`` {axis: (H, W, 3) float16}: under radiance
    ω_axis from the direction ω, over that. ``indirect``: of each lamp, share of light that met another
    surface first, (H, W, 3); none where the renderer draws none, but ``undrawn``: the radiance of each that paths have,
    (H, W, 3). ``fine``: the lamps (n H, n W, 3) float16 over ``scale``, on a grid n times finer, with ``margin`` pixels
    around; none where that would be too much. ``coarse``: how many of the sensor's pixels
    along a side are one here, which ``origin`` has apart. ``elsewhere``: the same with effects of the scene in force,
    ``standing``, that a difference of direct light does not tell. ``moved``: the same from where the camera stands with
    ``pose`` {term: its value} (analysis.gap.search.anew).
    """

    scene: Scene
    camera: Camera
    lamps: dict[str, np.ndarray]
    intensity: dict[str, np.ndarray]
    rest: np.ndarray
    ambient: np.ndarray
    indirect: dict[str, np.ndarray]
    passes: dict[str, np.ndarray]
    samples: int = 64  # a pixel and channel
    fine: dict[str, np.ndarray] = field(default_factory=dict)
    scale: float = 1.0
    coarse: int = 1
    undrawn: dict[str, np.ndarray] = field(default_factory=dict)
    origin: "Rendered | None" = None
    standing: Changes = ()
    elsewhere: tuple["Rendered", ...] = ()
    leaning: dict[str, np.ndarray] = field(default_factory=dict)
    margin: int = 0  # px (analysis.gap.light.margin)
    moved: "Rendered | None" = None
    pose: "Mapping[Key, float]" = field(default_factory=dict)

    @property
    def finer(self) -> int:
        """How many times finer ``fine`` is."""
        width = self.camera.sensor.resolution[0] + 2 * self.margin
        return int(next(iter(self.fine.values())).shape[1] // width)

    @property
    def frame(self) -> tuple[slice, slice]:
        """Rows and columns of ``fine`` that the sensor sees."""
        around, (w, h) = self.finer * self.margin, self.camera.sensor.resolution
        return slice(around, around + self.finer * h), slice(around, around + self.finer * w)

    @own_property
    def edges(self) -> dict[str, Edges]:
        """Of each lamp those on the finer grid."""
        return {name: edges(single(plane)) for name, plane in self.fine.items()}

    def nearest(self, scene: Changes) -> "Rendered":
        """Of this and ``elsewhere`` the one where most of ``scene`` is in force, and nothing else."""
        wanted = {(effect.name(), target) for effect, target in scene}
        fitting = [r for r in self.elsewhere if {(e.name(), t) for e, t in r.standing} <= wanted]
        return max(fitting, key=lambda r: len(r.standing), default=self)

    def weights(self, scene: Scene) -> dict[str, np.ndarray]:
        """(3,) a lamp: its intensity in ``scene`` over the one that was rendered."""
        now = {light.name: np.asarray(light.intensity, np.float64) for light in scene.lights}
        return {
            name: np.divide(now[name], rendered, out=np.zeros(3), where=rendered > 0)
            for name, rendered in self.intensity.items()
        }

    @own_property
    def pixels_of(self) -> dict[str, dict[str, int]]:
        """How many pixels show each material and each object that is seen: {pass: {name: pixels}}."""
        found = {}
        for word, names in (
            ("material_id", self.scene.material_names),
            ("object_id", self.scene.object_names),
        ):
            ids = self.passes[word]
            counts = np.bincount(ids[ids >= 0])
            found[word] = {names[k]: int(counts[k]) for k in np.flatnonzero(counts)}
        return found

    def radiance(self, scene: Scene) -> np.ndarray:
        """(H, W, 3) float32 with the intensities of ``scene``."""
        total = self.rest.copy()
        for name, weight in self.weights(scene).items():
            if weight.any():
                total += weighted(self.lamps[name], weight)
        return total


def weighted(plane: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """(H, W, 3) float32, each channel times its own number; whole rows at once, as loops over three are slow."""
    h, w, _ = plane.shape
    row = np.tile(weight.astype(np.float32), w)
    return np.asarray((plane.reshape(h, -1) * row).reshape(h, w, 3))


def changed(scene: Scene, effects: Changes) -> Scene:
    """The scene with ``effects``, one after the other; what is never on, or not there yet, changes nothing."""
    for effect, target in effects:
        if has(scene, target):
            scene = effect.on_scene(scene, target)
    return scene


def fineness(camera: Camera) -> int:
    """How many times finer than the sensor's the grid is that light is rendered on; pixels that lie behind a mosaic of
    colours, several of which are one, are whole parts of it."""
    if not isinstance(camera.sensor, BehindFilters):
        return FINE
    n = camera.sensor.across
    return n if n > FINE else n * FINE


def render_all(
    views: Sequence[tuple[Scene, Camera]],
    render: Render,
    settings: dict[str, Any],
    cache: Path,
    told: Callable[[int, int], None] = lambda done, total: None,
) -> list[Rendered]:
    """What each view shows; views of one arrangement share one object, and what ``cache`` holds is not rendered.

    ``settings`` name the renderer and all that decides its image.
    """
    keys = [arrangement(scene, camera) for scene, camera in views]
    groups: dict[str, list[int]] = {}
    for i, key in enumerate(keys):
        groups.setdefault(key, []).append(i)
    done: dict[str, Rendered] = {}
    told(0, len(groups))
    for key, members in groups.items():
        scene, camera = views[members[0]]
        lit = _at_full_power(scene, [views[i][0] for i in members])
        done[key] = _rendered(lit, camera, render, settings, cache)
        told(len(done), len(groups))
    return [done[key] for key in keys]


def _at_full_power(scene: Scene, scenes: Sequence[Scene]) -> Scene:
    """The scene with every lamp as bright as it gets in any of them; those that are never on are left out."""
    most = {
        light.name: np.max([next(x.intensity for x in s.lights if x.name == light.name) for s in scenes], 0)
        for light in scene.lights
    }
    lights = tuple(replace(x, intensity=tuple(most[x.name])) for x in scene.lights if most[x.name].any())
    return replace(scene, lights=lights)


def _rendered(
    scene: Scene, camera: Camera, render: Render, settings: dict[str, Any], cache: Path
) -> Rendered:
    eye, finer = drawn(camera), fineness(camera)
    key = fingerprint((scene.bodies, scene.lights, eye, settings, finer, MOST, TRACED))
    file = cache / f"{key[:32]}.npz"
    intensity = {x.name: np.asarray(x.intensity, np.float64) for x in scene.lights}
    arrays = kept_on_disk(file, lambda: _arrays(scene, eye, finer, render, settings))
    scale = float(arrays.get("scale", 1.0))
    fine = {name: arrays[f"fine:{name}"] for name in intensity if f"fine:{name}" in arrays}
    around = kept_on_disk(
        cache / f"{fingerprint((key, COARSER))[:32]}.npz",
        lambda: _leaning(scene, eye, arrays, render),
    )
    seen = partial(at_filters, camera=camera)
    return Rendered(
        scene=scene,
        camera=camera,
        lamps={
            name: pixels(fine[name], scale, camera) if fine else seen(arrays[f"light:{name}"])
            for name in intensity
        },
        intensity=intensity,
        rest=seen(arrays["rest"]),
        ambient=seen(arrays[AMBIENT]),
        indirect={k.removeprefix("indirect:"): v for k, v in arrays.items() if k.startswith("indirect:")},
        passes={k: v for k, v in arrays.items() if k.split(":")[0] in PASSES},
        samples=int(settings.get("samples", 64)) // (4 if isinstance(camera.sensor, BehindFilters) else 1),
        fine=fine,
        scale=scale,
        undrawn={k.removeprefix("undrawn:"): seen(v) for k, v in arrays.items() if k.startswith("undrawn:")},
        leaning=around,
    )


def _arrays(
    scene: Scene, camera: Camera, finer: int, render: Render, settings: dict[str, Any]
) -> dict[str, np.ndarray]:
    bounces = bool(settings.get("indirect"))
    width, height = camera.sensor.resolution
    if 6 * finer**2 * width * height * len(scene.lights) > MOST:
        finer = 1
    eye = camera.resized(finer * width) if finer > 1 else camera
    image = render(scene, eye, SURFACES if bounces else PASSES, True, finer**2, Paths.DIRECT)
    lamps = {n.removeprefix("light:"): p for n, p in image.passes.items() if n.startswith("light:")}
    if bounces:
        around = render(scene, camera, (*PASSES, "indirect"), True, 1, Paths.REFLECTED)
        out = reflected(lamps, image, around)
        rest = np.maximum(around.pixels - sum((around.passes[f"light:{n}"] for n in lamps), 0.0), 0)
        out |= {n: p for n, p in around.passes.items() if n.split(":")[0] in PASSES}
    else:
        rest = means(np.maximum(image.pixels - sum(lamps.values(), np.zeros_like(image.pixels)), 0), finer)
        middle = slice(finer // 2, None, finer)
        out = {n: p[middle, middle] for n, p in image.passes.items() if n.split(":")[0] in PASSES}
    rest[rest < 1e-5 * max(float(image.pixels.max()), 1e-30)] = 0  # rounding, where nothing shines by itself
    ambient = _under_a_dome(scene, camera, render) - rest
    if not bounces and settings.get("reflected"):
        out |= _undrawn(scene, camera, list(lamps), render, {**out, "rest": rest, AMBIENT: ambient})
    if finer > 1:
        scale = max((float(p.max()) for p in lamps.values()), default=1.0) or 1.0
        out |= {f"fine:{n}": (p / scale).astype(np.float16) for n, p in lamps.items()}
        out["scale"] = np.array(scale)
    else:
        out |= {f"light:{n}": p for n, p in lamps.items()}
    return {**out, "rest": rest, AMBIENT: ambient}


def _under_a_dome(scene: Scene, camera: Camera, render: Render) -> np.ndarray:
    return render(replace(scene, lights=(DOME,)), camera, (), False, 1, Paths.ALL).pixels


def _undrawn(
    scene: Scene, camera: Camera, lamps: Sequence[str], render: Render, drawn: Mapping[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """What paths have of each lamp's reflected light, (H, W, 3), as ``undrawn:NAME``; of large sensors traced on a
    coarser grid and laid onto the surfaces, where they have textures over what they have of light from everywhere."""
    width, height = camera.sensor.resolution
    coarser = int(np.ceil(np.sqrt(width * height / TRACED))) // 2 * 2 + 1  # odd

    def traced(eye: Camera) -> list[np.ndarray]:
        around = render(scene, eye, ("indirect",), True, 1, Paths.REFLECTED)
        return [np.maximum(around.passes[f"indirect:{n}"], 0) for n in lamps]

    def textured(eye: Camera) -> list[np.ndarray]:
        return [_under_a_dome(scene, eye, render), *traced(eye)]

    if coarser == 1 or drawn["rest"].any():
        planes = traced(camera)
    elif any(body.material.maps for body in scene.bodies):
        dome, *fine = coarsely(textured, camera, coarser, surfaces(drawn), drawn["normal"])
        planes = [share_of(dome, plane) * drawn[AMBIENT] for plane in fine]
    else:
        planes = coarsely(traced, camera, coarser, surfaces(drawn), drawn["normal"])
    return {f"undrawn:{n}": plane for n, plane in zip(lamps, planes, strict=True)}


def _leaning(
    scene: Scene, camera: Camera, arrays: Mapping[str, np.ndarray], render: Render
) -> dict[str, np.ndarray]:
    def drawn(eye: Camera, light: Light) -> np.ndarray:
        lit = replace(scene, lights=(light,) if light.is_on else ())
        return render(lit, eye, (), False, 1, Paths.ALL).pixels

    def alone(eye: Camera, light: Light) -> np.ndarray:
        """Without what shines by itself."""
        return drawn(eye, light) - drawn(eye, replace(light, intensity=(0.0, 0.0, 0.0)))

    shines = bool(arrays["rest"].any())
    return leanings(alone if shines else drawn, camera, surfaces(arrays), arrays["normal"])


def finely_lit(
    scene: Scene, eye: Camera, n: int, render: Render, bounces: bool
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """What each lamp gives on a grid ``n`` times finer, (n H, n W, 3); and where the renderer's light ``bounces`` the
    share of it that did, and the passes on ``eye``'s own."""
    direct = render(scene, eye.resized(n * eye.sensor.resolution[0]), SURFACES, True, n**2, Paths.DIRECT)
    lamps = {k.removeprefix("light:"): p for k, p in direct.passes.items() if k.startswith("light:")}
    if not bounces:
        return lamps, {}
    around = render(scene, eye, (*PASSES, "indirect"), True, 1, Paths.REFLECTED)
    passes = {k: p for k, p in around.passes.items() if k.split(":")[0] in PASSES}
    return lamps, reflected(lamps, direct, around) | passes


def reflected(lamps: dict[str, np.ndarray], direct: Image, around: Image) -> dict[str, np.ndarray]:
    """Adds to ``lamps`` (n H, n W, 3) what ``around`` (H, W) has of each one's reflected light; its share of the whole,
    (H, W, 3), as ``indirect:NAME``."""
    if not lamps:
        return {}
    planes = [np.maximum(around.passes[f"indirect:{n}"], 0) for n in lamps]
    fine = finely(np.concatenate(planes, axis=2), surfaces(direct.passes), direct.passes["normal"])
    out = {}
    for k, (name, plane) in enumerate(zip(list(lamps), planes, strict=True)):
        lamps[name] = lamps[name] + fine[..., 3 * k : 3 * k + 3]
        whole = means(lamps[name], len(fine) // len(plane))
        share = np.divide(plane, whole, out=np.zeros_like(whole), where=whole > 0)
        out[f"indirect:{name}"] = np.minimum(share, 1)
    return out


def surfaces(passes: Mapping[str, np.ndarray]) -> np.ndarray:
    """(H, W): a number for each material of each body, -1 where nothing is."""
    material, body = passes["material_id"], passes["object_id"]
    return np.where(body < 0, -1, body * (1 + int(material.max(initial=0))) + material)


def single(plane: np.ndarray) -> np.ndarray:
    """float32 of the same; halves by OpenCV, which takes a ninth of NumPy's time for them."""
    if plane.dtype != np.float16:
        return np.asarray(plane, np.float32)
    return cv2.convertFp16(np.ascontiguousarray(plane).view(np.int16)).reshape(plane.shape)


def means(plane: np.ndarray, n: int) -> np.ndarray:
    """(h // n, w // n, C) float32 over n x n of (h, w, C); what is left over at the end is left out."""
    h, w = plane.shape[0] // n, plane.shape[1] // n
    part = np.ascontiguousarray(single(plane[: h * n, : w * n]))
    mean = cv2.resize(part, (w, h), interpolation=cv2.INTER_AREA)
    return np.asarray(mean.reshape(h, w, plane.shape[2]))


def pixels(fine: np.ndarray, scale: float, camera: Camera) -> np.ndarray:
    """(H, W, 3) float32: what the sensor's pixels see of a lamp's light on the finer grid."""
    n = fine.shape[1] // camera.sensor.resolution[0]
    if isinstance(camera.sensor, BehindFilters):
        return seen_through(single(fine), n, camera.sensor) * np.float32(scale)
    return means(fine, n) * np.float32(scale)
