"""What of a scene is chosen by its name: ``/World/Plate.material``, ``/World/Plug.shape``, ``/World/Lamp.profile``.

| address           | a name is                                                                                  |
|-------------------|--------------------------------------------------------------------------------------------|
| OBJECT.material   | a material of the scene's file, bound or not, by its path or the end of it; FILE:MATERIAL;  |
|                   | FILE, of a file with one material                                                           |
| OBJECT.shape      | a CAD, mesh or scene FILE, or ``FILE in mm`` where the file has no unit: its surface stands |
|                   | where the object stands, in its own size                                                    |
| LAMP.profile      | a photometric FILE (IES, EULUMDAT): how the lamp's light spreads; its power stays           |

``scene`` stands for what the scene has. Files are looked for from the scene's folder.
"""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from analysis.sweep.address import groups_of, set_values
from interchange.effects.parts import with_bodies, with_lights
from interchange.formats import photometry
from interchange.formats.base import Options
from interchange.formats.bop import rigid_and_stretch
from interchange.formats.document import open_scene
from interchange.light import LightKind, Profile
from interchange.material import Material
from interchange.problems import BrightfieldError, did_you_mean
from interchange.scene import Body, Scene

OWN = "scene"  # the name of what the scene has


def is_choice(scene: Scene, address: str) -> bool:
    """Whether the address is of something that is chosen by name. Raises BrightfieldError where the scene lacks it."""
    prim, _, what = address.rpartition(".")
    if what not in CHOICES or not prim or "." in prim:
        return False
    name = groups_of(scene, prim)[0]
    return name in (scene.object_names if what in OF_OBJECTS else [x.name for x in scene.lights])


def with_values(scene: Scene, values: Mapping[str, float | str]) -> Scene:
    """The scene with other numbers, and with what is chosen by name. Raises BrightfieldError, FileError.

    Numbers of materials are set before materials are handed round, so that they go with the material.
    """
    named = {a: v for a, v in values.items() if isinstance(v, str)}
    for address, name in named.items():
        if not address.endswith(".material"):
            scene = choose(scene, address, name, scene)
    scene = set_values(scene, {a: v for a, v in values.items() if not isinstance(v, str)})
    before = scene
    for address, name in named.items():
        if address.endswith(".material"):
            scene = choose(scene, address, name, before)
    return scene


def choose(scene: Scene, address: str, name: str, before: Scene) -> Scene:
    """``before``: the scene whose materials are meant. Raises BrightfieldError, FileError."""
    prim, _, what = address.rpartition(".")
    return scene if name == OWN else CHOICES[what](scene, groups_of(scene, prim)[0], name, before)


def file_of(scene: Scene, address: str, name: str) -> Path | None:
    """The file that a name stands for, None for what the scene's own file has."""
    if name == OWN:
        return None
    whole = Path(scene.source).parent / (_with_unit(name)[0] if address.endswith(".shape") else name)
    if address.endswith(".material") and not whole.is_file():
        file, colon, _ = name.rpartition(":")
        return Path(scene.source).parent / file if colon else None
    return whole


def digest_of(scene: Scene, address: str, name: str) -> str:
    """SHA-256 of what the file behind a name holds, with all that it refers to; "" where there is none."""
    file = file_of(scene, address, name)
    if file is None:
        return ""
    if address.endswith(".profile"):
        return hashlib.sha256(file.read_bytes()).hexdigest()
    unit = _with_unit(name)[1] if address.endswith(".shape") else ""
    return open_scene(file, Options(unit=unit or None)).digest


def _material(scene: Scene, prim: str, name: str, before: Scene) -> Scene:
    chosen = _material_named(before, f"{prim}.material", name)
    return with_bodies(scene, prim, lambda b: replace(b, material=chosen))


def _material_named(scene: Scene, address: str, name: str) -> Material:
    file = file_of(scene, address, name)
    if file is None:
        bound = {b.material.name: b.material for b in scene.bodies}
        if name in bound or len([n for n in bound if n.endswith("/" + name.lstrip("/"))]) == 1:
            return _one(list(bound.values()), name, scene.source)
        rest = _materials(Path(scene.source))
        return _one([*bound.values(), *(m for m in rest if m.name not in bound)], name, scene.source)
    found = _materials(file)
    if (Path(scene.source).parent / name).is_file():
        if len(found) != 1:
            raise BrightfieldError(
                f"A file that stands for a material must hold one; it has {len(found)}: write {name}:NAME. ({file})"
            )
        return found[0]
    return _one(found, name.rpartition(":")[2], str(file))


def _one(materials: Sequence[Material], name: str, where: str) -> Material:
    fits = [m for m in materials if m.name == name or m.name.endswith("/" + name.lstrip("/"))]
    if len(fits) == 1:
        return fits[0]
    if fits:
        raise BrightfieldError(
            f'"{name}" must be one material; it fits {" and ".join(m.name for m in fits)}.'
        )
    words = [w for m in materials for w in (m.name, m.name.rsplit("/", 1)[-1])]
    hint = did_you_mean(name, words) or f" There are {', '.join(m.name for m in materials[:12])}."
    raise BrightfieldError(f'There is no material "{name}".{hint} ({where})')


def _shape(scene: Scene, prim: str, name: str, before: Scene) -> Scene:
    own = [b for b in scene.bodies if b.name == prim]
    if len({b.material.name for b in own}) > 1:
        raise BrightfieldError(f"What another shape stands for must be of one material; {prim} has several.")
    pose, where = rigid_and_stretch(own[0].world_from_body)[0], own[0].where
    found = _bodies(scene, name)
    new = [Body(prim, b.mesh, own[0].material, pose @ b.world_from_body, where) for b in found]
    at = next(k for k, b in enumerate(scene.bodies) if b.name == prim)
    rest = [b for b in scene.bodies if b.name != prim]
    return replace(scene, bodies=(*rest[:at], *new, *rest[at:]))


def _profile(scene: Scene, prim: str, name: str, before: Scene) -> Scene:
    path = Path(scene.source).parent / name
    (lamp,) = [x for x in scene.lights if x.name == prim]
    if lamp.kind in (LightKind.DISTANT, LightKind.DOME):
        raise BrightfieldError(f"A lamp with a profile must stand somewhere; {prim} is a {lamp.kind}.")
    profile = _distribution(str(path), _changed(path))
    return with_lights(scene, prim, lambda x: replace(x, profile=profile, projector=None))


def _changed(path: Path) -> int:
    try:
        return path.stat().st_mtime_ns
    except OSError as error:
        raise BrightfieldError(f"The file cannot be read: {error.strerror}. ({path})") from None


@lru_cache(maxsize=64)  # once a process: renderers keep by identity what they have uploaded
def _distribution(path: str, changed: int) -> Profile:
    """With a mean of 1 over all directions."""
    found = photometry.read(path)
    return replace(found, candela=found.candela * (4 * np.pi / found.power()))


def _with_unit(name: str) -> tuple[str, str]:
    """The file of a shape, and the unit that it is told to be in, "" for its own."""
    file, word, unit = name.rpartition(" in ")
    return (file, unit) if word else (name, "")


@lru_cache(maxsize=64)
def _scene_bodies(path: str, unit: str, changed: int) -> tuple[Body, ...]:
    return open_scene(path, Options(unit=unit or None)).scene().bodies


def _bodies(scene: Scene, name: str) -> tuple[Body, ...]:
    file, unit = _with_unit(name)
    path = Path(scene.source).parent / file
    found = _scene_bodies(str(path), unit, _changed(path))
    if not any(len(b.mesh.faces) for b in found):
        raise BrightfieldError(f"A shape must have a surface; there is none. ({path})")
    return found


@lru_cache(maxsize=64)
def _scene_materials(path: str, changed: int) -> tuple[Material, ...]:
    return open_scene(path).materials()


def _materials(path: Path) -> tuple[Material, ...]:
    return _scene_materials(str(path), _changed(path))


CHOICES: Mapping[str, Callable[[Scene, str, str, Scene], Scene]] = {
    "material": _material,
    "shape": _shape,
    "profile": _profile,
}
OF_OBJECTS = ("material", "shape")
