"""The records of a scene that an effect is about, exchanged: all others stay the same objects."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from interchange.camera import Camera
from interchange.light import Light
from interchange.material import Material, Texture
from interchange.problems import BrightfieldError, did_you_mean
from interchange.scene import Body, Scene

T = TypeVar("T")
SEVERAL = " + "  # between targets


def with_lights(scene: Scene, target: str, change: Callable[[Light], Light]) -> Scene:
    chosen = _chosen("lamp", target, [x.name for x in scene.lights])
    return replace(scene, lights=tuple(change(x) if x.name in chosen else x for x in scene.lights))


def with_cameras(scene: Scene, target: str, change: Callable[[Camera], Camera]) -> Scene:
    chosen = _chosen("camera", target, [x.name for x in scene.cameras])
    return replace(scene, cameras=tuple(change(x) if x.name in chosen else x for x in scene.cameras))


def with_bodies(scene: Scene, target: str, change: Callable[[Body], Body]) -> Scene:
    """``target``: an object, which may be several bodies, or several objects."""
    chosen = _chosen("object", target, scene.object_names)
    return replace(scene, bodies=tuple(change(x) if x.name in chosen else x for x in scene.bodies))


def with_materials(scene: Scene, target: str, change: Callable[[Material], Material]) -> Scene:
    """Bodies that shared a material share the changed one."""
    chosen = _chosen("material", target, scene.material_names)
    done: dict[int, Material] = {}

    def changed(body: Body) -> Body:
        if body.material.name not in chosen:
            return body
        return replace(body, material=once(done, body.material, change))

    return replace(scene, bodies=tuple(map(changed, scene.bodies)))


def once(done: dict[int, T], thing: T, change: Callable[[T], T]) -> T:
    if id(thing) not in done:
        done[id(thing)] = change(thing)
    return done[id(thing)]


def bounds(scene: Scene, target: str) -> np.ndarray:
    """(2, 3) m: lowest and highest world coordinates of an object, or of several together."""
    chosen = _chosen("object", target, scene.object_names)
    return replace(scene, bodies=tuple(b for b in scene.bodies if b.name in chosen)).bounds


def members(names: Sequence[str], target: str) -> list[str]:
    """Those of ``names`` that ``target`` is about: a prim path or its last part, with all that is under it, or several
    of them with " + " between."""
    wanted = target.split(SEVERAL)
    return [n for n in names if any(w in (n, n.rsplit("/", 1)[-1]) or n.startswith(f"{w}/") for w in wanted)]


def has(scene: Scene, target: str) -> bool:
    """Whether there is all that a target names."""
    known = [*scene.object_names, *scene.material_names, *(x.name for x in scene.lights)]
    return not target or all(members(known, one) for one in target.split(SEVERAL))


def called(target: str) -> str:
    """A target for people: its last part; of several the first, and how many more there are."""
    first, *more = target.split(SEVERAL)
    return first.rsplit("/", 1)[-1] + (f" and {len(more)} more" if more else "")


def scaled(texture: Texture, factor: float | np.ndarray) -> Texture:
    """``factor``: one number, or one a channel."""
    pixels = texture.pixels * np.asarray(factor, np.float32)
    return replace(texture, pixels=pixels.astype(np.float32), file="")


def _chosen(kind: str, target: str, names: Iterable[str]) -> set[str]:
    known = list(names)
    if not target:
        return set(known)
    for one in target.split(SEVERAL):
        if not members(known, one):
            hint = did_you_mean(one, known)
            raise BrightfieldError(f'An effect\'s target must be a {kind} of the scene; got "{one}".{hint}')
    return set(members(known, target))
