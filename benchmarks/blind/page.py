"""The page of a set: tables of its scores with exact binomial intervals, and every miss by itself.

Of cases made by apart/ no form, place or parameter is printed; where a set has both kinds of cases, a table has the
main scores of both.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks.blind.results import Answer, Results
from benchmarks.blind.rules import (
    BINS,
    CLAIMS,
    alarmed,
    calibration,
    calibration_by_chance,
    called,
    chi2_of_nulls,
    closed_beyond,
    confidently_wrong,
    covered,
    findable,
    interval,
    right,
    there,
)


def share(k: int, n: int) -> str:
    low, high = interval(k, n)
    return f"{k}/{n} | {100 * k / n:.1f} % | {100 * low:.1f}–{100 * high:.1f} %" if n else "0/0 | – | –"


def _wanted(label: dict[str, Any]) -> float:
    return float(max((e["wanted"] for e in label["effects"]), default=0.0))


def _truth(label: dict[str, Any]) -> str:
    words = []
    for e in label["effects"]:
        if label.get("apart"):
            words.append(f"{e['name']} (apart, {100 * (e['severity'] or 0):.2f} %)")
            continue
        place = f" of {e['place']}" if e["place"] else ""
        words.append(f"{e['name']}{place} ({e['form']}, {100 * (e['severity'] or 0):.2f} %)")
    return " + ".join(words) or "none"


def _said(a: Answer) -> str:
    if a.failed:
        return "no answer"
    words = [f"{n} ({p:.2f})" for n, p in sorted(a.said.items(), key=lambda x: -x[1])]
    return " + ".join([*words, *(["unknown"] if a.unknown else [])]) or "none"


SIDES: tuple[tuple[str, Any, Any], ...] = (  # score, the cases that it is about, when one counts
    ("nulls: false alarm", lambda x: x["stratum"] == "null", lambda x, a: alarmed(a)),
    ("one effect, exact", lambda x: x["stratum"] == "single", lambda x, a: right(x, a)),
    ("one effect, exact, tied as one", lambda x: x["stratum"] == "single", lambda x, a: right(x, a, True)),
    ("one effect of one camera, exact", lambda x: x["stratum"] == "camera", lambda x, a: right(x, a)),
    ("pair, exact", lambda x: x["stratum"] == "pair", lambda x, a: right(x, a)),
    ("triple, exact", lambda x: x["stratum"] == "triple", lambda x, a: right(x, a)),
    ("outside the catalogue: flagged unknown", lambda x: x["stratum"] == "outside", lambda x, a: a.unknown),
    (
        "outside the catalogue: and no effect called",
        lambda x: x["stratum"] == "outside",
        lambda x, a: right(x, a),
    ),
    ("confident (p > 0.9) and wrong", lambda x: True, lambda x, a: bool(confidently_wrong(x, a))),
)


def by_claim(what: str, cases: Sequence[dict[str, Any]], answers: dict[str, Answer]) -> list[str]:
    """Lines of a table: of each severity, what the diagnosis says that its captures would show of the effects, each by
    itself, and what it found."""
    if not cases:
        return []
    lines = [
        "",
        f"| {what} | {' | '.join(f'of those {w}' for w in CLAIMS.values())} | of which it says nothing |",
    ]
    lines.append("|---|" + "---|" * (len(CLAIMS) + 1))
    for severity in sorted({_wanted(x) for x in cases}):
        cells = []
        for claim in [*CLAIMS, None]:
            of = [x for x in cases if _wanted(x) == severity and findable(x, answers[x["case"]]) == claim]
            cells.append(f"{sum(right(x, answers[x['case']], True) for x in of)}/{len(of)}" if of else "–")
        lines.append(f"| {100 * severity:g} % | {' | '.join(cells)} |")
    return lines


def side_by_side(labels: Sequence[dict[str, Any]], answers: dict[str, Answer]) -> list[str]:
    """Lines of a table of both kinds of cases; none where all are of one."""
    kinds = [[x for x in labels if bool(x.get("apart")) == apart] for apart in (False, True)]
    if not all(kinds):
        return []
    lines = ["", "| score | first way | share | 95 % interval | apart | share | 95 % interval |"]
    lines.append("|---|---|---|---|---|---|---|")
    for name, about, hit in SIDES:
        of = [[x for x in kind if about(x)] for kind in kinds]
        if any(of):
            cells = [share(sum(hit(x, answers[x["case"]]) for x in some), len(some)) for some in of]
            lines.append(f"| {name} | {' | '.join(cells)} |")
    inside = [share(*covered(kind, answers)[:2]) for kind in kinds]
    lines.append(f"| parameters inside their 95 % interval | {' | '.join(inside)} |")
    pairs = [called(kind, answers) for kind in kinds]
    cells = [f"{len(p)} called | {calibration(p):.3f} | –" if p else "0 called | – | –" for p in pairs]
    return [*lines, f"| calibration error of probabilities | {' | '.join(cells)} |"]


def table(labels: Sequence[dict[str, Any]], answers: dict[str, Answer]) -> str:
    """The whole page, Markdown."""
    by = {s: [x for x in labels if x["stratum"] == s] for s in dict.fromkeys(x["stratum"] for x in labels)}
    lines = ["| score | cases | share | 95 % interval |", "|---|---|---|---|"]

    def line(name: str, of: Sequence[dict[str, Any]], hit: Any) -> None:
        if of:
            lines.append(f"| {name} | {share(sum(bool(hit(x, answers[x['case']])) for x in of), len(of))} |")

    nulls = by.get("null", [])
    line("nulls: false alarm, any effect or unknown", nulls, lambda x, a: alarmed(a))
    line("nulls: false alarm, an effect with p > 0.5", nulls, lambda x, a: a.failed or bool(a.named))
    for stratum, word in (
        ("single", "one effect, exact"),
        ("camera", "one effect of one camera, exact"),
        ("pair", "pair, exact"),
        ("triple", "triple, exact"),
    ):
        of = by.get(stratum, [])
        for s in sorted({_wanted(x) for x in of}):
            some = [x for x in of if _wanted(x) == s]
            line(f"{word}, {100 * s:g} %", some, lambda x, a: right(x, a))
            line(f"{word}, {100 * s:g} %, tied as one", some, lambda x, a: right(x, a, True))
    found = by.get("single", [])
    several = [*by.get("pair", []), *by.get("triple", [])]
    for of, what in ((found, "one effect"), (several, "several effects")):
        for claim, words in CLAIMS.items():
            some = [x for x in of if findable(x, answers[x["case"]]) == claim]
            line(f"{what}, of those {words}, exact", some, lambda x, a: right(x, a))
    line("one effect: named, whatever else is", found, lambda x, a: there(x) <= a.named)
    line("one effect: called unknown", found, lambda x, a: a.unknown)
    beyond = by.get("outside", [])
    for s in sorted({_wanted(x) for x in beyond}):
        some = [x for x in beyond if _wanted(x) == s]
        line(f"outside the catalogue, {100 * s:g} %: flagged unknown", some, lambda x, a: a.unknown)
        line(f"outside the catalogue, {100 * s:g} %: and no effect called", some, lambda x, a: right(x, a))
    stress = by.get("stress", [])
    filtered = {x["case"] for x in stress if x["filter"] != "box"}
    for word, of in (
        ("errors twice as large as declared", [x for x in stress if x["case"] not in filtered]),
        ("another filter of pixels", [x for x in stress if x["case"] in filtered]),
    ):
        still = [x for x in of if not x["effects"]]
        line(f"{word}: false alarm, any effect or unknown", still, lambda x, a: alarmed(a))
        line(f"{word}: false alarm, an effect with p > 0.5", still, lambda x, a: a.failed or bool(a.named))
        line(f"{word}: exact", [x for x in of if x["effects"]], lambda x, a: right(x, a))
    line("noise alone, exact", by.get("noise", []), lambda x, a: right(x, a, True))
    line("confident (p > 0.9) and wrong, all cases", labels, lambda x, a: bool(confidently_wrong(x, a)))
    line("no answer", labels, lambda x, a: a.failed)

    said = called(labels, answers)
    strong = [
        (x["scene"], a)
        for x in labels
        if (a := answers[x["case"]]).explained is not None
        and x["stratum"] in ("single", "camera", "pair", "triple")
        and x["severity"] >= 0.009
    ]
    closed = [a.explained for _, a in strong if a.explained is not None]
    beyond_nulls = closed_beyond(strong, chi2_of_nulls(nulls, answers))
    hits, count, errors = covered(labels, answers)
    lines += ["", "| figure | value |", "|---|---|"]
    if said:
        bins = min(BINS, len(said))
        chance, high = calibration_by_chance(said)
        lines.append(
            f"| calibration error of probabilities, {bins} bins | {calibration(said):.3f}; as many calls that "
            f"are right as often as they say have {chance:.3f}, and {high:.3f} or less in 95 % |"
        )
    if closed:
        median, tenth = np.percentile(closed, [50, 10])
        lines.append(
            f"| share of the removable gap closed, from 1 % | median {median:.3f}, p10 {tenth:.3f} |"
        )
    if beyond_nulls:
        median, tenth = np.percentile(beyond_nulls, [50, 10])
        lines.append(
            f"| the same, where the floor is what nulls of the scene leave, other engine's noise with them | median "
            f"{median:.3f}, p10 {tenth:.3f} |"
        )
    if count:
        lines.append(f"| parameters inside their 95 % interval | {share(hits, count).replace(' | ', ', ')} |")
        lines.append(f"| error of those parameters, median | {100 * float(np.median(errors)):.1f} % |")
    if chis := [a.chi[1] for x in nulls if (a := answers[x["case"]]).chi]:
        lines.append(f"| χ of nulls | median {np.median(chis):.3f}, highest {max(chis):.3f} |")
    if seconds := [a.seconds for a in answers.values() if a.seconds is not None]:
        lines.append(f"| time of a case | median {np.median(seconds):.0f} s, longest {max(seconds):.0f} s |")

    lines += by_claim("one effect", found, answers)
    lines += by_claim("several effects, the least of the claims", several, answers)
    lines += side_by_side(labels, answers)
    lines += ["", "| effect | exact | named | called where it is not |", "|---|---|---|---|"]
    for name in sorted(
        {n for x in labels for n in there(x)} | {n for a in answers.values() for n in a.named}
    ):
        alone = [x for x in labels if there(x) == {name} and x["stratum"] != "stress"]
        named = sum(name in answers[x["case"]].named for x in alone)
        false = sum(name in answers[x["case"]].named and name not in there(x) for x in labels)
        exact = sum(right(x, answers[x["case"]], True) for x in alone)
        lines.append(f"| {name} | {exact}/{len(alone)} | {named}/{len(alone)} | {false} |")

    lines += ["", "Every case that was not answered exactly:", ""]
    lines += ["| case | stratum | scene | truth | said | χ |", "|---|---|---|---|---|---|"]
    for x in sorted(labels, key=lambda x: (x["stratum"], x["scene"], x["case"])):
        a = answers[x["case"]]
        if not right(x, a):
            chi = f"{a.chi[0]:.2f} → {a.chi[1]:.2f}" if a.chi else "–"
            lines.append(
                f"| {x['case']} | {x['stratum']} | {x['scene']} | {_truth(x)} | {_said(a)} | {chi} |"
            )
    return "\n".join(lines) + "\n"


def heading(sets: Sequence[Results], opened: str) -> str:
    """Which sets these are, by whom they were answered, and how many cases they have."""
    lines = [
        f"Sealed set {r.name}, labels SHA-256 `{r.sha256}`, {opened}, answered by commit {r.program}: "
        f"{len(r.cases)} cases{_not_run(r.not_run)}{left_out(r.left_out)}."
        for r in sets
    ]
    if len(sets) > 1:
        lines.append(f"{sum(len(r.cases) for r in sets)} cases in all.")
    return "\n".join(lines)


def _not_run(n: int) -> str:
    return f", the first by their names, which are drawn by lot; the other {n} were not run" if n else ""


def left_out(n: int) -> str:
    return f"; {n} that were planned have no amplitude of the severity wanted" if n else ""
