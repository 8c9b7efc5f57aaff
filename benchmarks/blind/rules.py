"""When an answer is right, and how many are: exact intervals, calibration, coverage.

An answer is right where the effects said are those that are there, no more and no fewer, and nothing is called
unknown beside them. Causes outside the catalogue are right where something is called unknown (or by the one name of
the contract that fits) and no effect of the catalogue is. A case that failed, or was not run, is wrong. Effects that no
capture tells apart (``TIED``) are counted strictly, and once more as one.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.stats import beta

from benchmarks.blind.apart.proposals import OUTSIDE as APART_OUTSIDE
from benchmarks.blind.proposals import ALSO, TIED
from benchmarks.blind.proposals import OUTSIDE as FIRST_OUTSIDE
from benchmarks.blind.results import Answer

OUTSIDE = frozenset({*FIRST_OUTSIDE, *APART_OUTSIDE})

CONFIDENT = 0.9
BINS = 15
ABOVE = 0.05  # of χ², a gap that can be closed at all


def interval(k: int, n: int, level: float = 0.95) -> tuple[float, float]:
    """Clopper and Pearson 1934: the exact interval of a share k of n."""
    if n == 0:
        return 0.0, 1.0
    tail = (1 - level) / 2
    low = float(beta.ppf(tail, k, n - k + 1)) if k > 0 else 0.0
    high = float(beta.ppf(1 - tail, k + 1, n - k)) if k < n else 1.0
    return low, high


def there(label: dict[str, Any]) -> frozenset[str]:
    return frozenset(e["name"] for e in label["effects"])


def outside(label: dict[str, Any]) -> bool:
    return any(n in OUTSIDE for n in there(label))


def merged(names: frozenset[str]) -> frozenset[str]:
    """Tied names under the first of theirs."""
    return frozenset(next((t[0] for t in TIED if n in t), n) for n in names)


def right(label: dict[str, Any], a: Answer, tied: bool = False) -> bool:
    if a.failed:
        return False
    truth, said = there(label), a.named
    if outside(label):
        also = {x for n in truth for x in ALSO.get(n, ())}
        known = {n for n in truth if n not in OUTSIDE}
        return said - also == known and (a.unknown or bool(said & also))
    if tied:
        truth, said = merged(truth), merged(said)
    return truth == said and not a.unknown


def alarmed(a: Answer) -> bool:
    return a.failed or bool(a.named) or a.unknown


def confidently_wrong(label: dict[str, Any], a: Answer) -> list[str]:
    """Effects called with more than ``CONFIDENT`` that are not there, nor tied to one that is."""
    truth = there(label) | {x for n in there(label) for x in ALSO.get(n, ())}
    bound = merged(frozenset(truth))
    return sorted(
        n for n, p in a.said.items() if p > CONFIDENT and next(iter(merged(frozenset({n})))) not in bound
    )


def calibration(pairs: Sequence[tuple[float, bool]]) -> float:
    """Expected calibration error with ``BINS`` bins of as many answers each (Naeini et al. 2015, adaptive)."""
    if not pairs:
        return float("nan")
    mixed = [pairs[i] for i in np.random.default_rng(0).permutation(len(pairs))]  # equal ones in no order
    ordered = sorted(mixed, key=lambda x: x[0])
    groups = np.array_split(np.arange(len(ordered)), min(BINS, len(ordered)))
    error = 0.0
    for g in groups:
        p = np.mean([ordered[i][0] for i in g])
        hit = np.mean([ordered[i][1] for i in g])
        error += len(g) / len(ordered) * abs(p - hit)
    return float(error)


def calibration_by_chance(pairs: Sequence[tuple[float, bool]], draws: int = 200) -> tuple[float, float]:
    """What the same error would be, mean and 95th percentile, if each call were right as often as it says: bins of a
    few answers are off by chance."""
    rng = np.random.default_rng(0)
    p = np.array([p for p, _ in pairs])
    found = [calibration(list(zip(p, rng.random(len(p)) < p, strict=True))) for _ in range(draws)]
    return float(np.mean(found)), float(np.percentile(found, 95))


def chi2_of_nulls(nulls: Sequence[dict[str, Any]], answers: dict[str, Answer]) -> dict[str, float]:
    """Median χ² by scene of what is left of its nulls: the sensor's noise, and the other engine's own."""
    found: dict[str, list[float]] = {}
    for label in nulls:
        if chi := answers[label["case"]].chi:
            found.setdefault(label["scene"], []).append(chi[1] ** 2)
    return {scene: float(np.median(x)) for scene, x in found.items()}


def closed_beyond(cases: Sequence[tuple[str, Answer]], floor: dict[str, float]) -> list[float]:
    """Of cases (scene, answer), the share of the gap above the ``floor`` (χ² by scene) that is closed; none where the
    gap is not ``ABOVE`` it, nor where the scene has no null."""
    out = []
    for scene, a in cases:
        if a.chi and a.chi[0] ** 2 - floor.get(scene, np.inf) > ABOVE:
            out.append((a.chi[0] ** 2 - a.chi[1] ** 2) / (a.chi[0] ** 2 - floor[scene]))
    return out


def covered(labels: Sequence[dict[str, Any]], answers: dict[str, Answer]) -> tuple[int, int, list[float]]:
    """Of parameters that mean the same on both sides: how many 95 % intervals hold the truth, of how many; errors."""
    hits, count, errors = 0, 0, []
    for label in labels:
        a = answers[label["case"]]
        for effect in label["effects"]:
            found = (a.parameters or {}).get(effect["name"], {})
            for name, value in of_all(effect["parameters"], found).items():
                if name in found:
                    estimate, sigma = found[name]
                    count += 1
                    hits += abs(estimate - value) <= 1.96 * sigma
                    size = (
                        abs(value - 1)
                        if name.endswith(("scale", "red", "blue", " R", " G", " B"))
                        else abs(value)
                    )
                    errors.append(abs(estimate - value) / max(size, 1e-9))
    return hits, count, errors


def of_all(truth: dict[str, float], found: dict[str, tuple[float, float]]) -> dict[str, float]:
    """``truth`` under the names of ``found``: what is alike for several lamps ("LED0 x", "LED1 x") is one number, "x",
    where it was told as that of all."""
    out: dict[str, float] = {}
    for name, value in truth.items():
        last = name.rsplit(" ", 1)[-1]
        alike = [x for n, x in truth.items() if n.rsplit(" ", 1)[-1] == last]
        out[last if last in found and name not in found and min(alike) == max(alike) else name] = value
    return out


CLAIMS = {
    "sure": "that it says it finds whatever they are about",
    "easy": "that it says it finds where they are easy",
    "none": "that it says it does not find",
}


def findable(label: dict[str, Any], a: Answer) -> str | None:
    """Which of ``CLAIMS`` the diagnosis makes of the effects of ``label``, the least of them, each told as if it were
    alone; None where it says nothing of one."""
    claims = [_claim(effect, a) for effect in label["effects"]]
    return next((c for c in (None, "none", "easy", "sure") if c in claims), None)


def _claim(effect: dict[str, Any], a: Answer) -> str | None:
    if effect["name"] not in (a.smallest or {}):
        return None
    told = (a.smallest or {})[effect["name"]]
    severity = float(effect["severity"] or 0)
    if told["hardest"] is not None and severity >= told["hardest"]:
        return "sure"
    return "easy" if told["easiest"] is not None and severity >= told["easiest"] else "none"


def called(labels: Sequence[dict[str, Any]], answers: dict[str, Answer]) -> list[tuple[float, bool]]:
    """Probability of every effect said, and whether it is there."""
    return [
        (p, merged(frozenset({n})) <= merged(there(x)))
        for x in labels
        for n, p in answers[x["case"]].said.items()
    ]
