"""Every declared number of a scene under one address: ``/World/Lamp.intensity``, ``/World/Camera.pose.tx``,
``/Materials/steel.roughness``, ``/World/Camera.sensor.t_exp``, ``/Materials/paint.weight[0].R``.

    PRIM . GROUP . NAME       PRIM: a prim path, its end, or its last part;  GROUP: analysis.sweep.groups
                              NAME[k]: entry k of a list (a lobe);  NAME.R: one channel, NAME.x: one component

A name may end in its unit, ``tx_mm``.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
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
    """The whole path of a prim, and its groups. Raises BrightfieldError where the scene lacks it, and where a path's
    end fits several."""
    known: dict[str, Callable[[], dict[str, Group]]] = {}
    for body in scene.bodies:
        known[body.material.name] = partial(of_material, body.material)
    for name in scene.object_names:
        known[name] = partial(of_object, name)
    for light in scene.lights:
        known[light.name] = partial(of_light, light)
    for camera in scene.cameras:
        known[camera.name] = partial(of_camera, camera)
    fits = [prim] if prim in known else [name for name in known if is_named(name, prim)]
    if len(fits) == 1:
        return fits[0], known[fits[0]]()
    if fits:
        raise BrightfieldError(f'"{prim}" must be one prim; it fits {" and ".join(sorted(fits))}.')
    words = [*known, *(k.rsplit("/", 1)[-1] for k in known)]
    hint = did_you_mean(prim, words) or f" There are {', '.join(sorted(known)[:12])}."
    raise BrightfieldError(f'The scene has no camera, lamp, object or material "{prim}".{hint}')


def is_named(name: str, prim: str) -> bool:
    """Whether ``prim`` is the path ``name`` or its end."""
    return name == prim or name.endswith("/" + prim.lstrip("/"))


def objects_named(scene: Scene, words: Any) -> tuple[str, ...]:
    """The objects of these paths, or ends of paths; ``words`` is one or a list. Raises BrightfieldError with all that
    the scene lacks."""
    found: dict[str, None] = {}
    missing = []
    for word in words if isinstance(words, list) else [words]:
        fits = [n for n in scene.object_names if is_named(n, str(word))]
        if not fits:
            known = [w for n in scene.object_names for w in (n, n.rsplit("/", 1)[-1])]
            hint = did_you_mean(str(word), known) or f" There are {', '.join(scene.object_names[:12])}."
            missing.append(f'The scene has no object "{word}".{hint}')
        found |= dict.fromkeys(fits)
    if missing:
        raise BrightfieldError(" ".join(missing))
    return tuple(found)
