"""The constraints of a plan's file."""

from typing import Any

from analysis.sweep.address import objects_named
from analysis.sweep.axis_file import is_number
from analysis.sweep.constraints import MODELS, Constraint
from analysis.sweep.findings import Findings
from analysis.sweep.units import factor
from interchange.parameter import parameters
from interchange.problems import BrightfieldError, did_you_mean
from interchange.scene import Scene


def read_constraints(given: Any, scene: Scene, wrong: Findings) -> tuple[Constraint, ...]:
    """In the order in which they are asked."""
    if not isinstance(given, list):
        wrong("constraints", f"Constraints must be a list; got {given!r}.")
        return ()
    found = []
    for k, data in enumerate(given):
        key = f"constraints[{k}]"
        if not isinstance(data, dict):
            wrong(key, f"A constraint must be a mapping with its kind; got {data!r}.")
            continue
        kind = data.get("kind")
        if kind not in MODELS:
            hint = did_you_mean(str(kind), MODELS) or f" There are {', '.join(MODELS)}."
            wrong(f"{key}.kind", f'There is no constraint "{kind}".{hint}')
            continue
        model = MODELS[kind]
        declared = parameters(model)
        wrong.strange(data, {"kind", "of", "unit", *declared, *([model.word] if model.word else [])}, key)
        before = len(wrong.problems)
        of = _objects(data.get("of"), scene, f"{key}.of", wrong)
        against = (
            _objects(data[model.word], scene, f"{key}.{model.word}", wrong) if model.word in data else ()
        )
        numbers = {}
        for name, about in declared.items():
            if name not in data:
                continue
            scale = 1.0
            if about.unit != "1" and "unit" not in data:
                wrong(key, f"It must say the unit of its {name}, {about.unit} say; nothing is guessed.")
            elif "unit" in data:
                try:
                    scale = factor(str(data["unit"]), about.unit)
                except BrightfieldError as error:
                    wrong(f"{key}.unit", str(error))
            if not is_number(data[name]):
                wrong(f"{key}.{name}", f"It must be a number; got {data[name]!r}.")
            else:
                numbers[name] = scale * data[name]
        if len(wrong.problems) > before:
            continue
        try:
            found.append(model(of, against, **numbers))
        except BrightfieldError as error:
            wrong(key, str(error))
    return tuple(sorted(found, key=lambda c: c.cost))


def _objects(given: Any, scene: Scene, key: str, wrong: Findings) -> tuple[str, ...]:
    try:
        return objects_named(scene, given)
    except BrightfieldError as error:
        wrong(key, str(error))
        return ()
