"""The defects of a plan's file: what kind, on which object, where, and each of its numbers as any other parameter."""

from collections import Counter
from collections.abc import Callable
from typing import Any

from analysis.sweep.address import objects_named
from analysis.sweep.axis_file import is_number
from analysis.sweep.defects import MODELS
from analysis.sweep.findings import Findings
from analysis.sweep.plan import PlannedDefect
from analysis.sweep.surface import anchor_of
from interchange.parameter import Parameter, parameters
from interchange.problems import BrightfieldError, did_you_mean
from interchange.scene import Scene

KEYS = {"kind", "on", "at", "toward"}
Take = Callable[[str, Any, Parameter, str, str], None]  # address, what the file says, declaration, unit, key


def read_defects(given: Any, scene: Scene, wrong: Findings, take: Take) -> tuple[PlannedDefect, ...]:
    """``take`` is handed every number that the file says of a defect."""
    if not isinstance(given, list):
        wrong("defects", f"Defects must be a list; got {given!r}.")
        return ()
    count: Counter[str] = Counter()
    found = []
    for k, data in enumerate(given):
        key = f"defects[{k}]"
        if not isinstance(data, dict):
            wrong(key, f"A defect must be a mapping with its kind; got {data!r}.")
            continue
        kind = data.get("kind")
        if kind not in MODELS:
            hint = did_you_mean(str(kind), MODELS) or f" There are {', '.join(MODELS)}."
            wrong(f"{key}.kind", f'There is no defect "{kind}".{hint}')
            continue
        declared = parameters(MODELS[kind])
        wrong.strange(data, KEYS | set(declared), key)
        try:
            on = objects_named(scene, data.get("on"))
        except BrightfieldError as error:
            wrong(f"{key}.on", str(error))
            continue
        if len(on) != 1:
            wrong(f"{key}.on", f"A defect must be on one object; this is {' and '.join(on)}.")
            continue
        at, toward = (_vector(data.get(n), f"{key}.{n}", wrong) for n in ("at", "toward"))
        if toward is not None and not any(toward):
            wrong(f"{key}.toward", "A direction must not be zero.")
            continue
        anchor = anchor_of(scene, on[0], None if at is None else [1e-3 * x for x in at], toward)
        defect = PlannedDefect(str(kind), count[kind], on[0], anchor)
        count[kind] += 1
        found.append(defect)
        for name, about in declared.items():
            if name in data:
                take(f"{defect.name}.{name}", data[name], about, "", f"{key}.{name}")
    return tuple(found)


def declared_of(address: str, defects: tuple[PlannedDefect, ...]) -> Parameter:
    """The declaration of ``defects.scratch[0].depth``. Raises BrightfieldError."""
    name, _, field = address.rpartition(".")
    names = [d.name for d in defects]
    if name not in names:
        told = f" There are {', '.join(names)}." if names else " The plan has none."
        raise BrightfieldError(f'There is no defect "{name}".{did_you_mean(name, names) or told}')
    declared = parameters(MODELS[defects[names.index(name)].kind])
    if field not in declared:
        hint = did_you_mean(field, declared) or f" It has {', '.join(declared)}."
        raise BrightfieldError(f'{name} has no parameter "{field}".{hint}')
    return declared[field]


def _vector(given: Any, key: str, wrong: Findings) -> tuple[float, float, float] | None:
    if given is None:
        return None
    if not isinstance(given, list) or len(given) != 3 or not all(map(is_number, given)):
        wrong(key, f"It must be three numbers; got {given!r}.")
        return None
    return float(given[0]), float(given[1]), float(given[2])
