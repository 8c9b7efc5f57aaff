"""The samples of a plan: points of its design that keep every constraint, drawn once and kept beside the frames."""

import hashlib
import json
import os
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from analysis.sweep.checking import Checker
from analysis.sweep.plan import Plan
from analysis.sweep.sampling import points, weights
from interchange.formats.atomic import written_beside
from interchange.problems import BrightfieldError

FILE = "samples.json"
Told = Callable[[int, int], None]  # samples that are kept, and how many there are to be (0: not known)


@dataclass(frozen=True, eq=False)
class Design:
    """``rows`` (N, P): values of the plan's axes; ``weights`` (N,); ``rejected``: how many samples each constraint
    turned away, the first that did."""

    rows: np.ndarray
    weights: np.ndarray
    rejected: dict[str, int] = field(default_factory=dict)

    @property
    def drawn(self) -> int:
        return len(self.rows) + sum(self.rejected.values())


def design(plan: Plan, told: Told = lambda kept, count: None) -> Design:
    """The samples that keep every constraint: as many as the plan asks for, where its method has always more.

    Raises BrightfieldError where too few keep them.
    """
    kept: list[np.ndarray] = []
    rejected: Counter[str] = Counter()
    check = Checker(plan)
    for row in points(plan.axes, plan.method, plan.count, plan.seed):
        why = check(row)
        if why:
            rejected[why] += 1
        else:
            kept.append(row)
        told(len(kept), plan.count if plan.method.counts else 0)
        if plan.method.goes_on and (len(kept) == plan.count or _hopeless(len(kept), rejected, plan.count)):
            break
    check.close()
    if not kept or (plan.method.goes_on and len(kept) < plan.count):
        which = ", ".join(f"{name} rejected {n}" for name, n in rejected.items())
        raise BrightfieldError(
            f"Enough samples must keep the constraints; {len(kept)} of {len(kept) + sum(rejected.values())} did: "
            f"{which}. ({plan.file})"
        )
    rows = np.array(kept).reshape(len(kept), len(plan.axes))
    return Design(rows, weights(plan.axes, rows), dict(rejected))


def _hopeless(kept: int, rejected: Counter[str], count: int) -> bool:
    """Fewer than one in a hundred are kept, after enough to tell."""
    drawn = kept + sum(rejected.values())
    return drawn >= max(1000, 10 * count) and kept < 0.01 * drawn


def kept_design(plan: Plan, folder: Path, digest: str, told: Told) -> Design:
    """The design of an earlier run of this very plan and scene in ``folder``, else a new one, which is kept there."""
    about = " ".join([plan.text, digest, *plan.files.values()])
    key = hashlib.sha256(about.encode()).hexdigest()
    path = folder / FILE
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        if data["key"] == key:
            rows = np.array(data["rows"], np.float64).reshape(-1, len(plan.axes))
            return Design(rows, weights(plan.axes, rows), dict(data["rejected"]))
    except (OSError, ValueError, KeyError, TypeError):
        pass  # there is none that can be read
    made = design(plan, told)
    beside = written_beside(path)
    beside.write_text(
        json.dumps({"key": key, "rejected": made.rejected, "rows": made.rows.tolist()}), encoding="utf-8"
    )
    os.replace(beside, path)
    return made
