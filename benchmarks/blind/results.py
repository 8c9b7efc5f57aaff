"""What sealed sets said, kept: label and answer of every case, so that sets add up to one table.

``results/NAME.json`` is written when a set is opened, and committed: a machine that made and ran a set may be gone
with all its cases, and 400 of them take a small one longer than it is lent for. The set's seed is not in it.
"""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from benchmarks.blind import sealing

FOLDER = Path(__file__).resolve().parent / "results"
DIGITS = 5


@dataclass(frozen=True)
class Answer:
    """``said`` {name: probability} of named effects; ``unknown`` whether something is called unknown; ``failed``: none
    was given; ``smallest`` {name: {"easiest", "hardest"}}: severities that the diagnosis claims to find, None for
    never; ``chi`` before and after; ``structure``: of what is left, over what a twin leaves that is nearly right."""

    said: dict[str, float]
    unknown: bool = False
    failed: bool = False
    explained: float | None = None
    parameters: dict[str, dict[str, tuple[float, float]]] | None = None
    chi: tuple[float, float] | None = None
    seconds: float | None = None
    smallest: dict[str, dict[str, float | None]] | None = None
    structure: float | None = None

    @property
    def named(self) -> frozenset[str]:
        """What is called: the likeliest of several that captures do not tell apart may be so with less than 0.5."""
        return frozenset(self.said)


@dataclass(frozen=True)
class Results:
    """Of one set: ``program`` is the commit that answered, ``sha256`` that of the labels; ``cases``: label and answer
    of each; ``left_out``: how many were planned and have no amplitude of the severity wanted; ``not_run``: how many
    there was no time for, the last by name."""

    name: str
    sha256: str
    program: str
    left_out: int
    cases: tuple[tuple[dict[str, Any], Answer], ...]
    not_run: int = 0


def answer(file: Path) -> Answer:
    """What ``diagnosis.json`` says; a failure where there is none."""
    if not file.is_file():
        return Answer({}, failed=True)
    d = json.loads(file.read_text())
    gap = d["gap"]
    return Answer(
        {e["name"]: float(e["probability"]) for e in d["effects"]},
        "unknown" in d["verdict"],
        False,
        float(gap["explained"]),
        {e["name"]: {k: (v["value"], v["sigma"]) for k, v in e["parameters"].items()} for e in d["effects"]},
        (float(gap["before"]), float(gap["after"])),
        float(d["seconds"]),
        d.get("smallest", {}),
        _structure(d.get("left") or {}),
    )


def _structure(left: dict[str, Any]) -> float | None:
    expected = left.get("expected")
    return float(left["structure"]["2 px"]) / expected if expected else None


def write(results: Results, folder: Path = FOLDER) -> Path:
    """Of what a diagnosis claims to find, that of the case's own effects alone is kept."""
    cases = []
    for label, a in results.cases:
        own = {e["name"] for e in label["effects"]}
        told = {n: x for n, x in (a.smallest or {}).items() if n in own}
        kept = {k: v for k, v in {**asdict(a), "smallest": told}.items() if v is not None and v is not False}
        cases.append({"label": {k: v for k, v in label.items() if k != "seed"}, "answer": kept})
    head = {k: v for k, v in asdict(results).items() if k != "cases"}
    file = folder / f"{results.name}.json"
    text = json.dumps({**head, "cases": _rounded(cases)}, sort_keys=True)
    sealing.write_atomic(file, (text.replace('{"answer"', '\n{"answer"') + "\n").encode())
    return file


def read(file: Path) -> Results:
    """Raises SealError where no such set is kept."""
    if not file.is_file():
        known = ", ".join(sorted(x.stem for x in file.parent.glob("*.json"))) or "none"
        raise sealing.SealError(f"Nothing is kept of a set {file.stem}; kept are: {known}.")
    d = json.loads(file.read_text())
    cases = tuple((c["label"], _read_answer(c["answer"])) for c in d["cases"])
    return Results(d["name"], d["sha256"], d["program"], d["left_out"], cases, d["not_run"])


def _read_answer(d: dict[str, Any]) -> Answer:
    pairs = {e: {k: (v[0], v[1]) for k, v in p.items()} for e, p in d.get("parameters", {}).items()}
    chi = (d["chi"][0], d["chi"][1]) if "chi" in d else None
    return Answer(**{"said": {}, **d, "parameters": pairs, "chi": chi})


def together(
    sets: Sequence[Results], may_differ: bool = False
) -> tuple[list[dict[str, Any]], dict[str, Answer]]:
    """Labels and answers of all cases. Raises SealError where a case stands twice, or where another program answered
    and ``may_differ`` is not set."""
    programs = sorted({s.program for s in sets})
    if len(programs) > 1 and not may_differ:
        raise sealing.SealError(f"Sets add up that one program answered; these are of {', '.join(programs)}.")
    labels = [label for s in sets for label, _ in s.cases]
    answers = {label["case"]: a for s in sets for label, a in s.cases}
    if len(answers) != len(labels):
        raise sealing.SealError("A case stands in two of the sets.")
    return labels, answers


def _rounded(thing: Any) -> Any:
    if isinstance(thing, float):
        return float(f"{thing:.{DIGITS}g}")
    if isinstance(thing, dict):
        return {k: _rounded(v) for k, v in thing.items()}
    if isinstance(thing, list | tuple):
        return [_rounded(v) for v in thing]
    return thing
