"""`brightfield sweep PLAN.yaml`: image series over declared parameters, with ground truth, as datasets."""

import argparse
import sys
from collections import Counter
from pathlib import Path

from composer.progress import duration, progress_line
from interchange.problems import BrightfieldError

HELP = "render a series over any declared parameters, defects included, to BOP, COCO and EXR with a manifest"


def configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("plan", type=Path, metavar="PLAN.yaml")
    parser.add_argument("--out", type=Path, metavar="DIR", help="(default: the plan's name, beside it)")
    where = parser.add_argument_group("where it runs")
    where.add_argument("--workers", type=int, default=0, help="worker processes on this machine")
    where.add_argument(
        "--scheduler", metavar="ADDRESS", help="a running Dask scheduler, when one machine is not enough"
    )
    parser.add_argument(
        "--check", action="store_true", help="read the plan and draw its samples, render nothing"
    )


def run(args: argparse.Namespace) -> int:
    from analysis.sweep.design import design
    from analysis.sweep.plan_file import read
    from analysis.sweep.run import sweep
    from composer.contact_sheet import write_contact_sheet
    from interchange.formats import parquet

    if args.workers < 0:
        raise BrightfieldError(f"--workers must be 0 or more; got {args.workers}.")
    plan = read(args.plan)
    for note in plan.notes:
        print(note, file=sys.stderr)
    if args.check:
        made = design(plan)
        frames = len(made.rows) * len(plan.times) * len(plan.cameras)
        print(f"{len(made.rows)} samples, {frames} frames.")
        _told(made.rejected, made.drawn)
        return 0
    out = args.out or args.plan.with_suffix("")
    done = sweep(
        plan,
        out,
        args.scheduler,
        args.workers,
        lambda p: progress_line(p.done, p.total, p.left, p.failed),
        _drawing if plan.constraints or plan.defects else lambda kept, count: None,
    )
    rows, _ = parquet.read(out / "manifest.parquet")
    if rows and "file.image" in rows[0]:
        varying = [*(a.address for a in plan.axes), *(m.address for m in plan.moving)]
        write_contact_sheet(out / "contact_sheet.png", out, rows, varying)
    s = done.summary
    print(f"{s['samples']} samples, {done.frames} frames in {out}, {duration(done.seconds)}.")
    if done.skipped:
        print(f"{done.skipped} frames were there already.")
    _told(s["rejected"], s["drawn"])
    for reason, count in Counter(reason for _, reason in done.failed).items():
        file = next(f for f, r in done.failed if r == reason)
        others = f" and {count - 1} others" if count > 1 else ""
        print(f"brightfield: {file}{others}: {reason}", file=sys.stderr)
    return 2 if done.failed else 0


def _drawing(kept: int, count: int) -> None:
    if sys.stderr.isatty() or kept == count:
        progress_line(kept, count, None, what="samples")


def _told(rejected: dict[str, int], drawn: int) -> None:
    for name, count in rejected.items():
        print(f"{count} of {drawn} samples were rejected: {name}.")
