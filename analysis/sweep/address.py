"""Every declared number of a scene under one address: ``/World/Lamp.intensity``, ``/World/Camera.pose.tx``,
``/Materials/steel.roughness``, ``/World/Camera.sensor.t_exp``, ``/Materials/paint.weight[0].R``.

    PRIM . GROUP . NAME       PRIM: a prim path, its end, or its last part;  GROUP: analysis.sweep.groups
                              NAME[k]: entry k of a list (a lobe);  NAME.R: one channel, NAME.x: one component

A name may end in its unit, ``tx_mm``.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from analysis.sweep.groups import Group, of_camera, of_light, of_material, of_object
from interchange.parameter import Kind, Parameter
from interchange.problems import BrightfieldError, did_you_mean
from interchange.scene import Scene

LETTERS: Mapping[Kind, tuple[str, ...]] = {Kind.COLOR: ("R", "G", "B"), Kind.VECTOR: ("x", "y", "z")}
PATTERN = re.compile(
    r"(?P<prim>/?[^.\[\]]+)\.(?:(?P<group>[^.\[\]]+)\.)?(?P<name>[^.\[\]]+)"
    r"(?:\[(?P<entry>\d+)\])?(?:\.(?P<letter>[RGBxyz]))?"
)


@dataclass(frozen=True)
class Knob:
    """One number that can be set. ``unit`` is the one that its address names, else ""."""

    address: str
    about: Parameter
    value: float  # the scene's own; of a colour as a whole its largest channel
    prim: str  # path
    group: str
    field: str
    entry: int | None
    letter: str
    unit: str = ""


def knob(scene: Scene, address: str) -> Knob:
    """Raises BrightfieldError where the scene has no such prim, group or number."""
    match = PATTERN.fullmatch(address)
    if match is None:
        raise BrightfieldError(f'An address must be PRIM.NAME or PRIM.GROUP.NAME; got "{address}".')
    part, name, letter = match["group"] or "", match["name"], match["letter"] or ""
    entry = None if match["entry"] is None else int(match["entry"])
    prim, groups = groups_of(scene, match["prim"])
    if part not in groups and part and name in LETTERS[Kind.COLOR] + LETTERS[Kind.VECTOR]:
        part, name, letter = "", part, name  # "paint.diffuse.R" has no group
    if part not in groups:
        words = [p for p in groups if p]
        what = f'no group "{part}"' if part else "no number of its own"
        hint = did_you_mean(part, words) or f" Its groups are {', '.join(words)}."
        raise BrightfieldError(f"{prim} has {what}.{hint}")
    field, unit = _field(prim, part, groups, name)
    group = groups[part]
    about, value = group.declared[field], np.asarray(group.values[field], np.float64)
    if about.per_lobe:
        if entry is None or entry >= len(value):
            raise BrightfieldError(
                f"{prim}: {field} is a list of {len(value)}; name an entry, {field}[0] say, to {len(value) - 1}."
            )
        value = value[entry]
    elif entry is not None:
        raise BrightfieldError(f"{prim}: {field} is no list; leave out [{entry}].")
    letters = LETTERS.get(about.kind, ())
    if letter and letter not in letters:
        known = f"it has {', '.join(letters)}" if letters else "it is one number"
        raise BrightfieldError(f'{prim}: {field} has no "{letter}"; {known}.')
    if about.kind is Kind.VECTOR and not letter:
        raise BrightfieldError(f"{prim}: {field} is a vector; name a component, {field}.x say.")
    now = float(value[letters.index(letter)] if letter else value.max())
    return Knob(address, about, now, prim, part, field, entry, letter, unit)


def _field(prim: str, part: str, groups: Mapping[str, Group], name: str) -> tuple[str, str]:
    """The field of that name, with or without its unit behind it; the unit."""
    declared = groups[part].declared
    if name in declared:
        return name, ""
    field, _, unit = name.rpartition("_")
    if field in declared:
        return field, unit
    words = {(f"{p}.{n}" if p else n): None for p, g in groups.items() for n in g.declared}
    given = f"{part}.{name}" if part else name
    hint = did_you_mean(given, words) or f" {part or 'It'} has {', '.join(declared)}."
    raise BrightfieldError(f'{prim} has no parameter "{given}".{hint}')


def set_values(scene: Scene, values: Mapping[str, float]) -> Scene:
    """The scene with other numbers, in the declared units. Raises BrightfieldError for one that cannot be."""
    gathered: dict[tuple[str, str], list[tuple[Knob, float]]] = {}
    for address, value in values.items():
        found = knob(scene, address)
        gathered.setdefault((found.prim, found.group), []).append((found, value))
    for (prim, part), turned in gathered.items():
        group = groups_of(scene, prim)[1][part]
        changed: dict[str, np.ndarray] = {}
        for one, value in turned:
            new = changed.setdefault(one.field, np.array(group.values[one.field], np.float64))
            letters = LETTERS.get(one.about.kind, ())
            place: Any = (
                *(() if one.entry is None else (one.entry,)),
                *((letters.index(one.letter),) if one.letter else ()),
                ...,
            )
            new[place] = value
        try:
            scene = group.put(scene, {name: _plain(v) for name, v in changed.items()})
        except BrightfieldError as error:
            raise BrightfieldError(f"{prim}: {error}") from None
    return scene


def _plain(value: np.ndarray) -> Any:
    return tuple(map(_plain, value)) if value.ndim else float(value)


def groups_of(scene: Scene, prim: str) -> tuple[str, dict[str, Group]]:
    """The whole path of a prim, and its groups. Raises BrightfieldError where the scene lacks it."""
    for camera in scene.cameras:
        if is_named(camera.name, prim):
            return camera.name, of_camera(camera)
    for light in scene.lights:
        if is_named(light.name, prim):
            return light.name, of_light(light)
    for name in scene.object_names:
        if is_named(name, prim):
            return name, of_object(name)
    for body in scene.bodies:
        if is_named(body.material.name, prim):
            return body.material.name, of_material(body.material)
    known = [*(c.name for c in scene.cameras), *(x.name for x in scene.lights)]
    known += [*scene.object_names, *scene.material_names]
    words = [*known, *(k.rsplit("/", 1)[-1] for k in known)]
    hint = did_you_mean(prim, words) or f" There are {', '.join(known[:12])}."
    raise BrightfieldError(f'The scene has no camera, lamp, object or material "{prim}".{hint}')


def is_named(name: str, prim: str) -> bool:
    """Whether ``prim`` is the path ``name`` or its end."""
    return name == prim or name.endswith("/" + prim.lstrip("/"))
