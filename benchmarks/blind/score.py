"""Scores diagnoses against labels: tables with exact binomial intervals, and every miss by itself.

    python benchmarks/blind/score.py --labels DIR/labels.json --runs DIR [--out docs/blind.md]
    python benchmarks/blind/score.py --sealed NAME --vault FILE --runs DIR [--out FILE]
    python benchmarks/blind/score.py --kept NAME [NAME …] --out docs/blind.md

What a sealed set said is kept in results/NAME.json when it is opened; sets that one program answered add up.
When an answer is right stands in rules.py.
"""

import argparse
import itertools
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1]))

from benchmarks.blind import results, sealing  # noqa: E402
from benchmarks.blind.page import heading, left_out, table  # noqa: E402
from benchmarks.blind.results import Answer, Results, answer  # noqa: E402


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
    try:
        head, labels, answers = _scored(args)
    except sealing.SealError as error:
        p.error(str(error))
    page = f"{head}\n\n{table(labels, answers)}"
    if args.out:
        sealing.write_atomic(args.out, page.encode())
    else:
        print(page)


def _scored(args: argparse.Namespace) -> tuple[str, list[dict[str, Any]], dict[str, Answer]]:
    """The page's heading, and labels and answers by case. Raises SealError."""
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
        head = f"Rehearsal set: its labels were open. {len(labels)} cases{left_out(len(out))}."
    return head, labels, answers


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
