"""A plan's file, YAML, read strictly against its scene: every problem at once, each with the file and the key."""

from pathlib import Path
from typing import Any

from analysis.sweep.address import knob, objects_named
from analysis.sweep.axis_file import is_number, read_axis
from analysis.sweep.choice_file import read_choice
from analysis.sweep.choices import digest_of, is_choice
from analysis.sweep.constraint import Constraint
from analysis.sweep.constraint_file import read_constraints
from analysis.sweep.defect_file import declared_of, read_defects
from analysis.sweep.findings import Findings
from analysis.sweep.placing import PREFIX
from analysis.sweep.plan import RENDERERS, SAMPLES, WRITES, Moving, Plan, PlannedDefect, Rendering
from analysis.sweep.sampling import Axis, Method
from analysis.sweep.strict_yaml import load
from interchange.formats import bop
from interchange.formats.document import open_scene
from interchange.parameter import Parameter
from interchange.problems import BrightfieldError, FileError, did_you_mean
from interchange.scene import Scene

HEAD = {
    "scene", "cameras", "times", "width", "renderer", "sampling", "parameters", "defects", "constraints", "objects",
    "write", "noise",
}  # fmt: skip
MAX_COUNT = 10_000_000
DEFAULT_COUNT = 64


def read(path: Path | str) -> Plan:
    """Raises FileError with every problem of the plan, its scene included."""
    path = Path(path)
    text, data = load(path)
    wrong = Findings(path)
    wrong.strange(data, HEAD, "")
    scene_path, scene, times = _scene(path, data, wrong)
    cameras = _cameras(data, scene, wrong)
    objects = _objects(data, scene, wrong)
    rendering = _rendering(data.get("renderer", "realtime"), wrong)
    method, count, seed = _sampling(data.get("sampling", {}), wrong)
    parameters = data.get("parameters", {}) or {}
    if not isinstance(parameters, dict):
        wrong("parameters", "Parameters must be addresses with what each of them is to be.")
        parameters = {}
    axes: list[Axis] = []
    fixed: dict[str, float | str] = {}
    files: dict[str, str] = {}
    moving: list[Moving] = []
    units: dict[str, str] = {}

    def take(address: str, spec: Any, about: Parameter, unit: str, key: str) -> None:
        if address in units:
            wrong(key, f"{address} must be said once; it stands here and with its defect.")
            return
        units[address] = about.unit
        axis = read_axis(address, spec, about, unit, key, wrong, method)
        if isinstance(axis, Axis):
            axes.append(axis)
        elif isinstance(axis, float):
            fixed[address] = axis
        elif axis is not None:
            moving.append(axis)

    def take_name(scene: Scene, address: str, spec: Any, key: str) -> None:
        units[address] = ""
        found = read_choice(scene, address, spec, key, wrong)
        names = found.names if isinstance(found, Axis) else [] if found is None else [found]
        if isinstance(found, Axis):
            axes.append(found)
        elif found is not None:
            fixed[address] = found
        for name in names:
            if digest := digest_of(scene, address, name):
                files[name] = digest

    defects: tuple[PlannedDefect, ...] = ()
    constraints: tuple[Constraint, ...] = ()
    if scene is not None:
        constraints = read_constraints(data.get("constraints", []), scene, wrong)
        defects = read_defects(data.get("defects", []), scene, wrong, take)
        for address, spec in parameters.items():
            key = f"parameters.{address}"
            try:
                if str(address).startswith(PREFIX):
                    take(str(address), spec, declared_of(str(address), defects), "", key)
                elif is_choice(scene, str(address)):
                    take_name(scene, str(address), spec, key)
                else:
                    found = knob(scene, str(address))
                    take(str(address), spec, found.about, found.unit, key)
            except BrightfieldError as error:
                wrong(key, str(error))
    if method is Method.LIST and len({a.size for a in axes}) > 1:
        sizes = ", ".join(f"{a.address} has {a.size}" for a in axes)
        wrong("parameters", f"With sampling by list all lists must be equally long; {sizes}.")
    shaped = [a for a in units if a.endswith(".shape") and not a.startswith(PREFIX)]
    writes, notes = _writes(data, scene, cameras, shaped, wrong)
    axes.sort(key=lambda axis: axis.address.startswith(PREFIX))  # the scene's own first
    width, noise = wrong.number(data, "width", "", 8, 65536, 0), wrong.flag(data, "noise", "", True)
    if wrong.problems:
        raise FileError(wrong.problems)
    return Plan(
        path, scene_path, cameras, times, rendering, method, count, seed, tuple(axes), fixed, tuple(moving), defects,
        constraints, objects, units, writes, width, noise, text, notes, files,
    )  # fmt: skip


def _scene(path: Path, data: dict[str, Any], wrong: Findings) -> tuple[Path, Scene | None, tuple[float, ...]]:
    """The scene's file, the scene at the plan's first time, and the times. None where it cannot be read."""
    name = data.get("scene")
    if not isinstance(name, str) or not name:
        wrong("scene", f"The scene's file must be named; got {name!r}.")
        return path, None, (0.0,)
    try:
        document = open_scene(path.parent / name)
        times = _times(data.get("times"), document.times, wrong)
        return path.parent / name, document.scene(times[0]), times
    except FileError as error:
        for problem in error.problems:
            wrong("scene", str(problem))
        return path.parent / name, None, (0.0,)


def _times(given: Any, known: list[float], wrong: Findings) -> tuple[float, ...]:
    if given is None:
        return (known[0],)
    if given == "all":
        return tuple(known)
    listed = given if isinstance(given, list) else [given]
    if not listed or not all(is_number(t) for t in listed):
        wrong("times", f'Times must be time codes, [0, 5, 10] say, or "all"; got {given!r}.')
        return (known[0],)
    return tuple(dict.fromkeys(float(t) for t in listed))


def _cameras(data: dict[str, Any], scene: Scene | None, wrong: Findings) -> tuple[str, ...]:
    if scene is None:
        return ()
    given = data.get("cameras", [])
    names = given if isinstance(given, list) else [given]
    if names == ["all"]:
        names = [c.name for c in scene.cameras]
    found = []
    for name in names or [""]:
        try:
            found.append(scene.camera(str(name)).name)
        except BrightfieldError as error:
            wrong("cameras", str(error))
    return tuple(dict.fromkeys(found))


def _objects(data: dict[str, Any], scene: Scene | None, wrong: Findings) -> tuple[str, ...]:
    if scene is None:
        return ()
    given = data.get("objects", "all")
    try:
        return scene.object_names if given == "all" else objects_named(scene, given)
    except BrightfieldError as error:
        wrong("objects", str(error))
        return ()


def _rendering(given: Any, wrong: Findings) -> Rendering:
    data = {"name": given} if isinstance(given, str) else given
    if not isinstance(data, dict):
        wrong("renderer", f"It must be {' or '.join(RENDERERS)}, or a mapping with a name; got {given!r}.")
        return Rendering()
    wrong.strange(data, {"name", "samples", "bounces", "denoise"}, "renderer")
    name = data.get("name", "realtime")
    if name not in RENDERERS:
        hint = did_you_mean(str(name), RENDERERS)
        wrong("renderer", f'The renderer must be {" or ".join(RENDERERS)}; got "{name}".{hint}')
        name = "realtime"
    return Rendering(
        name,
        wrong.number(data, "samples", "renderer", 1, 2**20, SAMPLES[name]),
        wrong.number(data, "bounces", "renderer", 0, 128, 6),
        wrong.flag(data, "denoise", "renderer", False),
    )


def _sampling(given: Any, wrong: Findings) -> tuple[Method, int, int]:
    data = {"method": given} if isinstance(given, str) else given
    if not isinstance(data, dict):
        wrong("sampling", f"It must be a method, or a mapping with one; got {given!r}.")
        return Method.GRID, 0, 0
    wrong.strange(data, {"method", "count", "seed"}, "sampling")
    word, known = data.get("method", "grid"), [str(m) for m in Method]
    if word not in known:
        wrong(
            "sampling.method",
            f'It must be one of {", ".join(known)}; got "{word}".{did_you_mean(str(word), known)}',
        )
        word = "grid"
    method = Method(word)
    if "count" in data and not method.counts:
        wrong("sampling.count", f"A {method} has as many samples as its axes give; leave out the count.")
    count = wrong.number(data, "count", "sampling", 1, MAX_COUNT, DEFAULT_COUNT)
    return method, count, wrong.number(data, "seed", "sampling", 0, 2**31 - 1, 0)


def _writes(
    data: dict[str, Any], scene: Scene | None, cameras: tuple[str, ...], shaped: list[str], wrong: Findings
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """What is written, and what is not although nobody said so."""
    given = data.get("write", list(WRITES))
    listed = given if isinstance(given, list) else [given]
    for word in listed:
        if word not in WRITES:
            wrong(
                "write", f'It must be of {", ".join(WRITES)}; got "{word}".{did_you_mean(str(word), WRITES)}'
            )
    notes: tuple[str, ...] = ()
    why = [reason for c in cameras if scene is not None and (reason := bop.can_hold(scene.camera(c)))]
    why += [f"{address} is no one model" for address in shaped]
    if why and "bop" in listed:
        if "write" in data:
            wrong("write", f"BOP cannot be written: {'; '.join(why)}.")
        notes = (f"BOP is not written: {'; '.join(why)}.",)
        listed = [w for w in listed if w != "bop"]
    return tuple(w for w in WRITES if w in listed), notes
