"""Linear radiance of every capture, rendered once: lamp by lamp, since light adds up, and kept on disk.

    L(capture) = L_rest + sum over lamps (I_capture / I_rendered) L_lamp

Captures that differ in nothing but the lamps' intensities and the exposure share one rendering.
"""

import hashlib
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from interchange.camera import Camera
from interchange.image import Image
from interchange.light import Light, LightKind
from interchange.problems import Where
from interchange.scene import Scene

AMBIENT = "ambient"
PASSES = ("depth", "position", "normal", "object_id", "material_id", "lit")
Render = Callable[[Scene, Camera, Sequence[str], bool], Image]  # scene, camera, passes, per light


@dataclass(frozen=True, eq=False)
class Rendered:
    """What one camera sees of one arrangement: ``lamps`` {name: (H, W, 3)} at ``intensity``, and the passes.

    ``ambient`` (H, W, 3): under radiance 1 from everywhere. ``indirect``: share of light that met another surface
    first, (H, W, 3), or None where the renderer draws none.
    """

    scene: Scene
    camera: Camera
    lamps: dict[str, np.ndarray]
    intensity: dict[str, np.ndarray]
    rest: np.ndarray
    ambient: np.ndarray
    indirect: np.ndarray | None
    passes: dict[str, np.ndarray]
    samples: int = 64  # a pixel

    def weights(self, scene: Scene) -> dict[str, np.ndarray]:
        """(3,) a lamp: its intensity in ``scene`` over the one that was rendered."""
        now = {light.name: np.asarray(light.intensity, np.float64) for light in scene.lights}
        return {
            name: np.divide(now[name], rendered, out=np.zeros(3), where=rendered > 0)
            for name, rendered in self.intensity.items()
        }

    def radiance(self, scene: Scene) -> np.ndarray:
        """(H, W, 3) float32 with the intensities of ``scene``."""
        total = self.rest.copy()
        for name, weight in self.weights(scene).items():
            if weight.any():
                total += self.lamps[name] * weight.astype(np.float32)
        return total


def arrangement(scene: Scene, camera: Camera) -> str:
    """A name for all that decides a rendering but the lamps' intensities: SHA-256 of what is there."""
    lights = tuple(replace(x, intensity=(1.0, 1.0, 1.0)) for x in scene.lights)
    return fingerprint((scene.bodies, lights, replace(camera, t_exp=1.0)))


def fingerprint(thing: Any) -> str:
    sha = hashlib.sha256()
    _feed(sha, thing)
    return sha.hexdigest()


def _feed(sha: Any, thing: Any) -> None:
    if isinstance(thing, Where):
        return
    if isinstance(thing, np.ndarray):
        sha.update(f"{thing.dtype}{thing.shape}".encode())
        sha.update(np.ascontiguousarray(thing).tobytes())
    elif is_dataclass(thing):
        sha.update(type(thing).__name__.encode())
        for f in fields(thing):
            if f.name not in ("source", "digest", "file"):
                sha.update(f.name.encode())
                _feed(sha, getattr(thing, f.name))
    elif isinstance(thing, dict):
        for key in sorted(thing):
            sha.update(str(key).encode())
            _feed(sha, thing[key])
    elif isinstance(thing, tuple | list):
        sha.update(str(len(thing)).encode())
        for part in thing:
            _feed(sha, part)
    else:
        sha.update(repr(thing.value if isinstance(thing, Enum) else thing).encode())


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
    key = fingerprint((scene.bodies, scene.lights, replace(camera, t_exp=1.0), settings))
    file = cache / f"{key[:32]}.npz"
    intensity = {x.name: np.asarray(x.intensity, np.float64) for x in scene.lights}
    if not file.is_file():
        arrays = _arrays(scene, camera, render, bool(settings.get("indirect")))
        cache.mkdir(parents=True, exist_ok=True)
        beside = file.with_name(f".{file.stem}.{os.getpid()}.npz")
        np.savez(beside, **arrays)
        os.replace(beside, file)
    with np.load(file) as stored:
        arrays = {name: stored[name] for name in stored.files}
    return Rendered(
        scene=scene,
        camera=camera,
        lamps={name: arrays[f"light:{name}"] for name in intensity},
        intensity=intensity,
        rest=arrays["rest"],
        ambient=arrays[AMBIENT],
        indirect=arrays.get("indirect"),
        passes={k: v for k, v in arrays.items() if k.split(":")[0] in PASSES},
        samples=int(settings.get("samples", 64)),
    )


def _arrays(scene: Scene, camera: Camera, render: Render, indirect: bool) -> dict[str, np.ndarray]:
    wanted = [*PASSES, *(["direct", "indirect"] if indirect else [])]
    image = render(scene, camera, wanted, True)
    lamps = {name: p for name, p in image.passes.items() if name.startswith("light:")}
    rest = np.maximum(image.pixels - sum(lamps.values(), np.zeros_like(image.pixels)), 0)
    rest[rest < 1e-5 * max(float(image.pixels.max()), 1e-30)] = 0  # rounding, where nothing shines by itself
    dome = Light(AMBIENT, LightKind.DOME, (1.0, 1.0, 1.0))
    ambient = render(replace(scene, lights=(dome,)), camera, [], False).pixels - rest
    found = {name: p for name, p in image.passes.items() if name.split(":")[0] in PASSES}
    out = {**found, **lamps, "rest": rest, AMBIENT: ambient}
    if indirect:
        bounced = image.passes["indirect"]
        out["indirect"] = np.divide(bounced, image.pixels, out=np.zeros_like(bounced), where=image.pixels > 0)
    return out
