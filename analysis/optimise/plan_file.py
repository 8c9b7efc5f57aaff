"""A plan's file, YAML, read strictly against its scene: every problem at once, each with the file and the key.

scene: station.usda
camera: Camera
part: [Part]                                       # what is inspected
parameters:                                        # as in a sweep's plan: what may be set, and how far
  Camera.pose.tz: {range: [-60, 120], unit: mm}
  Camera.lens.f_stop: {range: [2, 11], law: log_uniform}
  Lamp.pose.tx: {range: [-150, 150], unit: mm}
aim: {Camera: Part, Lamp: Part}                    # turned towards it wherever they stand
focus: Part
limits: {seen: 0.98, saturated: 0.01, clearance: 30, unit: mm, clear: [Camera, Lamp]}
constraints: [{kind: no_collision, of: Housing, clearance: 2, unit: mm}]     # as in a sweep's plan
defects: [{kind: scratch, on: Part, length: {value: 8, unit: mm}, ...}]      # numbers fixed
objectives:
  defect_visibility: {clutter: 0.02}
  uncertainty: {}
search: {method: tpe, trials: 100, seed: 0}
render: {width: 160, samples: 8}
confirm: {count: 3, samples: 64}
"""

from pathlib import Path
from typing import Any

from analysis.optimise.measures import MODELS, Measure
from analysis.optimise.plan import METHODS, Limits, Plan
from analysis.sweep.address import groups_of, is_named, knob
from analysis.sweep.axis_file import read_axis
from analysis.sweep.choices import is_choice
from analysis.sweep.constraint_file import read_constraints
from analysis.sweep.defect_file import declared_of, read_defects
from analysis.sweep.findings import Findings
from analysis.sweep.laws import Choice, LogUniform, Uniform
from analysis.sweep.placing import PREFIX
from analysis.sweep.sampling import Axis, Method
from analysis.sweep.strict_yaml import load
from analysis.sweep.units import factor
from interchange.formats.document import open_scene
from interchange.parameter import Parameter, parameters
from interchange.problems import BrightfieldError, FileError, did_you_mean
from interchange.scene import Scene

HEAD = {
    "scene", "camera", "part", "parameters", "aim", "focus", "limits", "constraints", "defects", "objectives", "search",
    "render", "confirm",
}  # fmt: skip


def read(path: Path | str) -> Plan:
    """Raises FileError with every problem of the plan, its scene included."""
    path = Path(path)
    text, data = load(path)
    wrong = Findings(path)
    wrong.strange(data, HEAD, "")
    name = data.get("scene")
    if not isinstance(name, str) or not name:
        wrong("scene", f"The scene's file must be named; got {name!r}.")
        raise FileError(wrong.problems)
    try:
        scene = open_scene(path.parent / name).scene()
    except FileError as error:
        for problem in error.problems:
            wrong("scene", str(problem))
        raise FileError(wrong.problems) from None
    camera = ""
    try:
        camera = scene.camera(str(data.get("camera", ""))).name
    except BrightfieldError as error:
        wrong("camera", str(error))
    part = _objects(data.get("part"), scene, "part", wrong)
    axes: list[Axis] = []
    fixed: dict[str, float] = {}
    units: dict[str, str] = {}

    def take(address: str, spec: Any, about: Parameter, unit: str, key: str) -> None:
        units[address] = about.unit
        found = read_axis(address, spec, about, unit, key, wrong, Method.SOBOL)
        if isinstance(found, float):
            fixed[address] = found
        elif isinstance(found, Axis):
            if address.startswith(PREFIX):
                wrong(key, "A defect's number must be one value; set-ups are compared on the same defects.")
            elif not isinstance(found.law, Uniform | LogUniform | Choice):
                wrong(key, "What is searched must have a range or values; a normal law says how things vary.")
            else:
                axes.append(found)
        elif found is not None:
            wrong(key, "What is searched must not change with time.")

    defects = read_defects(data.get("defects", []), scene, wrong, take)
    given = data.get("parameters")
    if not isinstance(given, dict) or not given:
        wrong("parameters", "There must be addresses with what each of them may be.")
        given = {}
    for address, spec in given.items():
        key = f"parameters.{address}"
        try:
            if str(address).startswith(PREFIX):
                take(str(address), spec, declared_of(str(address), defects), "", key)
            elif is_choice(scene, str(address)):
                wrong(key, "It is chosen by name, which sweeps do; a set-up is searched over numbers.")
            else:
                found = knob(scene, str(address))
                take(str(address), spec, found.about, found.unit, key)
        except BrightfieldError as error:
            wrong(key, str(error))
    if given and not axes and not wrong.problems:
        wrong("parameters", "One number or more must have a range or values; nothing is left to search.")
    constraints = read_constraints(data.get("constraints", []), scene, wrong)
    objectives = _objectives(data.get("objectives"), bool(defects), wrong)
    limits = _limits(data.get("limits", {}), scene, wrong)
    aim = _aim(data.get("aim", {}), scene, wrong)
    focus = _objects(data["focus"], scene, "focus", wrong)[:1] if "focus" in data else ("",)
    search, render, confirm = (_mapping(data, word, wrong) for word in ("search", "render", "confirm"))
    wrong.strange(search, {"method", "trials", "seed"}, "search")
    wrong.strange(render, {"width", "samples"}, "render")
    wrong.strange(confirm, {"count", "samples"}, "confirm")
    method = search.get("method", "tpe")
    if method not in METHODS:
        hint = did_you_mean(str(method), METHODS)
        wrong("search.method", f'It must be {" or ".join(METHODS)}; got "{method}".{hint}')
    plan = Plan(
        path, path.parent / name, camera, part, tuple(axes), objectives, fixed, units, defects, constraints, limits,
        aim, focus[0] if focus else "", str(method),
        wrong.number(search, "trials", "search", 2, 1_000_000, 100),
        wrong.number(search, "seed", "search", 0, 2**31 - 1, 0),
        wrong.number(render, "width", "render", 16, 65536, 0),
        wrong.number(render, "samples", "render", 2, 4096, 8),
        wrong.number(confirm, "count", "confirm", 0, 1000, 3),
        wrong.number(confirm, "samples", "confirm", 1, 2**20, 64),
        text,
    )  # fmt: skip
    if wrong.problems:
        raise FileError(wrong.problems)
    return plan


def _mapping(data: dict[str, Any], word: str, wrong: Findings) -> dict[str, Any]:
    value = data.get(word, {})
    if not isinstance(value, dict):
        wrong(word, f"It must be a mapping; got {value!r}.")
        return {}
    return value


def _objects(given: Any, scene: Scene, key: str, wrong: Findings) -> tuple[str, ...]:
    names = given if isinstance(given, list) else [given]
    found: dict[str, None] = {}
    for name in names:
        fits = [n for n in scene.object_names if is_named(n, str(name))]
        if not fits:
            words = [w for n in scene.object_names for w in (n, n.rsplit("/", 1)[-1])]
            wrong(key, f'It must name objects of the scene; got "{name}".{did_you_mean(str(name), words)}')
        found |= dict.fromkeys(fits)
    return tuple(found)


def _objectives(given: Any, defects: bool, wrong: Findings) -> dict[str, Measure]:
    if isinstance(given, list):
        given = {str(name): {} for name in given}
    if not isinstance(given, dict) or not given:
        wrong("objectives", f"There must be one or more of {', '.join(MODELS)}.")
        return {}
    found = {}
    for name, numbers in given.items():
        key = f"objectives.{name}"
        if name not in MODELS:
            hint = did_you_mean(str(name), MODELS) or f" There are {', '.join(MODELS)}."
            wrong(key, f'There is no objective "{name}".{hint}')
            continue
        numbers = numbers or {}
        if not isinstance(numbers, dict):
            wrong(key, f"It must be a mapping of its parameters; got {numbers!r}.")
            continue
        wrong.strange(numbers, set(parameters(MODELS[name])), key)
        if name == "defect_visibility" and not defects:
            wrong(key, "The visibility of defects needs defects in the plan.")
        try:
            own = {k: v for k, v in numbers.items() if k in parameters(MODELS[name])}
            found[str(name)] = MODELS[name](**own)
        except BrightfieldError as error:
            wrong(key, str(error))
    return found


def _limits(given: Any, scene: Scene, wrong: Findings) -> Limits:
    if not isinstance(given, dict):
        wrong("limits", f"Limits must be a mapping; got {given!r}.")
        return Limits()
    wrong.strange(given, {"seen", "saturated", "clearance", "unit", "clear"}, "limits")
    seen = wrong.number(given, "seen", "limits", 0.0, 1.0, 0.0)
    saturated = wrong.number(given, "saturated", "limits", 0.0, 1.0, 0.01)
    clearance = wrong.number(given, "clearance", "limits", 0.0, 1e6, 0.0)
    if clearance and "unit" not in given:
        wrong("limits", "The clearance must say its unit, mm say; nothing is guessed.")
    elif clearance:
        try:
            clearance *= factor(str(given["unit"]), "m")
        except BrightfieldError as error:
            wrong("limits.unit", str(error))
    things = [*(c.name for c in scene.cameras), *(x.name for x in scene.lights)]
    clear = given.get("clear", [])
    found = []
    for name in clear if isinstance(clear, list) else [clear]:
        own = [n for n in things if is_named(n, str(name))]
        if not own:
            words = [n.rsplit("/", 1)[-1] for n in things]
            hint = did_you_mean(str(name), words)
            wrong("limits.clear", f'It must name cameras and lamps of the scene; got "{name}".{hint}')
        found += own
    if clearance and not found:
        wrong("limits.clear", "A clearance must name what must keep it, [Camera, Lamp] say.")
    return Limits(seen, saturated, clearance, tuple(dict.fromkeys(found)))


def _aim(given: Any, scene: Scene, wrong: Findings) -> dict[str, str]:
    if not isinstance(given, dict):
        wrong("aim", f"It must say what is turned towards which object; got {given!r}.")
        return {}
    found = {}
    for name, target in given.items():
        try:
            prim, groups = groups_of(scene, str(name))
        except BrightfieldError as error:
            wrong(f"aim.{name}", str(error))
            continue
        if "own" not in groups or prim in scene.object_names:
            wrong(f"aim.{name}", "Cameras and lamps that have a direction can be aimed.")
        fits = _objects(target, scene, f"aim.{name}", wrong)
        if fits:
            found[prim] = fits[0]
    return found
