"""Scores diagnoses against labels: tables with exact binomial intervals, and every miss by itself.

    python benchmarks/blind/score.py --labels DIR/labels.json --runs DIR [--out docs/blind.md]
    python benchmarks/blind/score.py --sealed NAME --vault FILE --runs DIR [--out FILE]
    python benchmarks/blind/score.py --kept NAME [NAME …] --out docs/blind.md

What a sealed set said is kept in results/NAME.json when it is opened; sets that one program answered add up.

An answer is right where the effects said are those that are there, no more and no fewer, and nothing is called
unknown beside them. Causes outside the catalogue are right where something is called unknown (or by the one name of
the contract that fits) and no effect of the catalogue is. A case that failed, or was not run, is wrong. Effects that no
capture tells apart (``TIED``) are counted strictly, and once more as one. Of cases made by apart/ no form, place or
parameter is printed; where a set has both kinds of cases, a table has the main scores of both.
"""

import argparse
import itertools
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import beta

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1]))

from benchmarks.blind import results, sealing  # noqa: E402
from benchmarks.blind.apart.proposals import OUTSIDE as APART_OUTSIDE  # noqa: E402
from benchmarks.blind.proposals import ALSO, TIED  # noqa: E402
from benchmarks.blind.proposals import OUTSIDE as FIRST_OUTSIDE  # noqa: E402
from benchmarks.blind.results import Answer, Results, answer  # noqa: E402

OUTSIDE = frozenset({*FIRST_OUTSIDE, *APART_OUTSIDE})

CONFIDENT = 0.9
BINS = 15


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


def covered(labels: Sequence[dict[str, Any]], answers: dict[str, Answer]) -> tuple[int, int, list[float]]:
    """Of parameters that mean the same on both sides: how many 95 % intervals hold the truth, of how many; errors."""
    hits, count, errors = 0, 0, []
    for label in labels:
        a = answers[label["case"]]
        for effect in label["effects"]:
            found = (a.parameters or {}).get(effect["name"], {})
            for name, value in effect["parameters"].items():
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


def share(k: int, n: int) -> str:
    low, high = interval(k, n)
    return f"{k}/{n} | {100 * k / n:.1f} % | {100 * low:.1f}–{100 * high:.1f} %" if n else "0/0 | – | –"


CLAIMS = {
    "sure": "that it says it finds whatever they are about",
    "easy": "that it says it finds where they are easy",
    "none": "that it says it does not find",
}


def findable(label: dict[str, Any], a: Answer) -> str | None:
    """Which of ``CLAIMS`` the diagnosis makes of the one effect of ``label``; None where it says nothing of it."""
    (effect,) = label["effects"]
    if effect["name"] not in (a.smallest or {}):
        return None
    told = (a.smallest or {})[effect["name"]]
    severity = float(effect["severity"] or 0)
    if told["hardest"] is not None and severity >= told["hardest"]:
        return "sure"
    return "easy" if told["easiest"] is not None and severity >= told["easiest"] else "none"


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


def by_claim(singles: Sequence[dict[str, Any]], answers: dict[str, Answer]) -> list[str]:
    """Lines of a table: of each severity, what the diagnosis says that its captures would show, and what it found."""
    if not singles:
        return []
    lines = [
        "",
        f"| one effect | {' | '.join(f'of those {w}' for w in CLAIMS.values())} | of which it says nothing |",
    ]
    lines.append("|---|" + "---|" * (len(CLAIMS) + 1))
    for severity in sorted({_wanted(x) for x in singles}):
        cells = []
        for claim in [*CLAIMS, None]:
            of = [x for x in singles if _wanted(x) == severity and findable(x, answers[x["case"]]) == claim]
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


def called(labels: Sequence[dict[str, Any]], answers: dict[str, Answer]) -> list[tuple[float, bool]]:
    """Probability of every effect said, and whether it is there."""
    return [
        (p, merged(frozenset({n})) <= merged(there(x)))
        for x in labels
        for n, p in answers[x["case"]].said.items()
    ]


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
    for claim, words in CLAIMS.items():
        some = [x for x in found if findable(x, answers[x["case"]]) == claim]
        line(f"one effect, of those {words}, exact", some, lambda x, a: right(x, a))
    line("one effect: named, whatever else is", found, lambda x, a: there(x) <= a.named)
    line("one effect: called unknown", found, lambda x, a: a.unknown)
    beyond = by.get("outside", [])
    for s in sorted({_wanted(x) for x in beyond}):
        some = [x for x in beyond if _wanted(x) == s]
        line(f"outside the catalogue, {100 * s:g} %: flagged unknown", some, lambda x, a: a.unknown)
        line(f"outside the catalogue, {100 * s:g} %: and no effect called", some, lambda x, a: right(x, a))
    stress = by.get("stress", [])
    line("undeclared errors: false alarm", [x for x in stress if not x["effects"]], lambda x, a: alarmed(a))
    line("undeclared errors: exact", [x for x in stress if x["effects"]], lambda x, a: right(x, a))
    line("noise alone, exact", by.get("noise", []), lambda x, a: right(x, a, True))
    line("confident (p > 0.9) and wrong, all cases", labels, lambda x, a: bool(confidently_wrong(x, a)))
    line("no answer", labels, lambda x, a: a.failed)

    said = called(labels, answers)
    closed = [
        a.explained
        for x in labels
        if (a := answers[x["case"]]).explained is not None
        and x["stratum"] in ("single", "camera", "pair", "triple")
        and x["severity"] >= 0.009
    ]
    hits, count, errors = covered(labels, answers)
    lines += ["", "| figure | value |", "|---|---|"]
    if said:
        bins = min(BINS, len(said))
        lines.append(f"| calibration error of probabilities, {bins} bins | {calibration(said):.3f} |")
    if closed:
        median, tenth = np.percentile(closed, [50, 10])
        lines.append(
            f"| share of the removable gap closed, from 1 % | median {median:.3f}, p10 {tenth:.3f} |"
        )
    if count:
        lines.append(f"| parameters inside their 95 % interval | {share(hits, count).replace(' | ', ', ')} |")
        lines.append(f"| error of those parameters, median | {100 * float(np.median(errors)):.1f} % |")
    if chis := [a.chi[1] for x in nulls if (a := answers[x["case"]]).chi]:
        lines.append(f"| χ of nulls | median {np.median(chis):.3f}, highest {max(chis):.3f} |")
    if seconds := [a.seconds for a in answers.values() if a.seconds is not None]:
        lines.append(f"| time of a case | median {np.median(seconds):.0f} s, longest {max(seconds):.0f} s |")

    lines += by_claim(found, answers)
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
        f"{len(r.cases)} cases{_not_run(r.not_run)}{_left_out(r.left_out)}."
        for r in sets
    ]
    if len(sets) > 1:
        lines.append(f"{sum(len(r.cases) for r in sets)} cases in all.")
    return "\n".join(lines)


def _not_run(n: int) -> str:
    return f", the first by their names, which are drawn by lot; the other {n} were not run" if n else ""


def _left_out(n: int) -> str:
    return f"; {n} that were planned have no amplitude of the severity wanted" if n else ""


def program_of(runs: Path) -> str:
    file = runs / "program.txt"
    return file.read_text().strip() if file.is_file() else "unknown"


def main() -> None:
    p = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    p.add_argument("--labels", type=Path, help="of a rehearsal set")
    p.add_argument("--sealed", default="", metavar="NAME", help="of a sealed set, as in seals.json")
    p.add_argument(
        "--kept", nargs="+", default=[], metavar="NAME", help="sealed sets that were opened before"
    )
    p.add_argument(
        "--programs-differ", action="store_true", help="of --kept: the page says whose answers they are"
    )
    p.add_argument("--vault", type=Path, help="the sealed set's labels")
    p.add_argument("--again", action="store_true", help="score a sealed set once more; the page says so")
    p.add_argument("--runs", type=Path, help="what run.py wrote")
    p.add_argument("--out", type=Path, help="Markdown (default: printed)")
    p.add_argument(
        "--run-only",
        action="store_true",
        help="leave out what was not run; of a sealed set all after the first by name that was not",
    )
    args = p.parse_args()
    if [bool(args.labels), bool(args.sealed), bool(args.kept)].count(True) != 1:
        p.error("give one of --labels, --sealed and --kept")
    if not args.kept and args.runs is None:
        p.error("give --runs, what run.py wrote")
    if args.sealed and args.vault is None:
        p.error("a sealed set needs --vault, its labels")
    if args.kept:
        sets = [results.read(results.FOLDER / f"{name}.json") for name in args.kept]
        labels, answers = results.together(sets, args.programs_differ)
        head = heading(sets, "opened once")
    elif args.sealed:
        data, before = sealing.opened(args.vault, HERE / "seals.json", args.sealed, args.again)
        sha = json.loads((HERE / "seals.json").read_text())[args.sealed]["sha256"]
        labels, out = _parted(data)
        planned = len(labels)
        if args.run_only:
            labels = _first(labels, args.runs)
            last = labels[-1]["case"] if labels else ""
            out = [x for x in out if x["case"] < last]
        answers = _answers(args.runs, labels)
        cases = tuple((x, answers[x["case"]]) for x in labels)
        found = Results(args.sealed, sha, program_of(args.runs), len(out), cases, planned - len(labels))
        head = heading([found], f"opened {before + 1} times: no longer blind" if before else "opened once")
        if not before:
            print(f"{results.write(found)} written: commit it.", file=sys.stderr)
    else:
        labels, out = _parted(json.loads(args.labels.read_text()))
        if args.run_only:
            labels = [x for x in labels if _was_run(x, args.runs)]
        answers = _answers(args.runs, labels)
        head = f"Rehearsal set: its labels were open. {len(labels)} cases{_left_out(len(out))}."
    page = f"{head}\n\n{table(labels, answers)}"
    if args.out:
        sealing.write_atomic(args.out, page.encode())
    else:
        print(page)


def _parted(data: dict[str, Any]) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Labels of the cases that there are, and of those that could not be made."""
    return [x for x in data["cases"] if "left out" not in x], [x for x in data["cases"] if "left out" in x]


def _was_run(label: dict[str, Any], runs: Path) -> bool:
    return any((runs / label["case"] / f).is_file() for f in ("diagnosis.json", "failed.txt"))


def _first(labels: Sequence[dict[str, Any]], runs: Path) -> list[dict[str, Any]]:
    """Those before the first by name that was not run: names are drawn by lot, so that these are a fair part."""
    ordered = sorted(labels, key=lambda x: str(x["case"]))
    return list(itertools.takewhile(lambda x: _was_run(x, runs), ordered))


def _answers(runs: Path, labels: Sequence[dict[str, Any]]) -> dict[str, Answer]:
    return {x["case"]: answer(runs / x["case"] / "diagnosis.json") for x in labels}


if __name__ == "__main__":
    main()
