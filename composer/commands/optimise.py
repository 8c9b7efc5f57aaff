"""`brightfield optimise PLAN.yaml`: the best set-up under mechanical limits, its front, the winner as a scene."""

import argparse
import shutil
import sys
from pathlib import Path
from typing import Any

from interchange.problems import BrightfieldError

HELP = "search camera, lens, lamps and exposure under mechanical limits; Pareto front, winner as a scene"


def configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("plan", type=Path, metavar="PLAN.yaml")
    parser.add_argument("--out", type=Path, metavar="DIR", help="(default: the plan's name, beside it)")
    parser.add_argument("--trials", type=int, metavar="N", help="in place of the plan's")
    parser.add_argument("--seed", type=int, metavar="N", help="in place of the plan's")
    parser.add_argument(
        "--confirm", type=int, metavar="N", help="path-traced set-ups, in place of the plan's; 0: none"
    )


def run(args: argparse.Namespace) -> int:
    from dataclasses import replace

    from analysis.optimise.plan_file import read
    from analysis.optimise.record import write
    from analysis.optimise.session import drawn, optimise
    from interchange.formats.document import open_scene
    from offline.renderers.cycles import Cycles
    from realtime.renderers.rasterizer import Rasterizer

    plan = read(args.plan)
    for name, low in (("trials", 2), ("seed", 0), ("confirm", 0)):
        value = getattr(args, name)
        if value is not None:
            if value < low:
                raise BrightfieldError(f"--{name} must be {low} or more; got {value}.")
            plan = replace(plan, **{name: value})
    out = args.out or args.plan.with_suffix("")
    document = open_scene(plan.scene)
    base = document.scene()
    with Rasterizer() as rasterizer:
        done = optimise(plan, base, rasterizer, Cycles, _told, out / "trials")
        _clear()
        picture = drawn(rasterizer, max(plan.samples, 16))
        lost = write(out, done, document, lambda scene, camera: picture(scene, camera, 0))
    if args.plan.resolve() != (out / "plan.yaml").resolve():
        shutil.copyfile(args.plan, out / "plan.yaml")
    _print(done)
    for problem in lost:
        print(f"brightfield: {problem}", file=sys.stderr)
    print(f"Written to {out}: winner.usda, optimise.json, front.png, course.png, winner.png, trials.csv.")
    return 0


def _print(done: Any) -> None:
    plan = done.plan
    if resumed := done.found.resumed + done.random.resumed:
        print(f"{resumed} trials were there already.")
    best = done.candidates[done.winner]
    columns = [("as it stands", done.as_it_stands), ("winner, real-time", best.live)]
    if best.confirmed is not None:
        columns.append(("winner, path-traced", best.confirmed))
    rows = [("", "unit", *(name for name, _ in columns))]
    for k, (name, measure) in enumerate(plan.objectives.items()):
        rows.append((name, measure.unit, *(_number(t.values[k], t.broken) for _, t in columns)))
    wide = [max(len(r[k]) for r in rows) for k in range(len(rows[0]))]
    for row in rows:
        print(
            "  ".join(
                f"{v:>{w}}" if k else f"{v:{w}}" for k, (v, w) in enumerate(zip(row, wide, strict=True))
            )
        )
    for _, trial in columns:
        if trial.broken:
            print(f"limit broken: {trial.broken}")
    for address, value in best.live.parameters.items():
        unit = plan.units[address]
        print(f"  {address} = {value:.5g}{'' if unit == '1' else ' ' + unit}")
    for s, volume in ((done.found, done.volumes[0]), (done.random, done.volumes[1])):
        name = "random search" if s is done.random else s.method.upper()
        print(f"{name}: {s.feasible} of {len(s.trials)} keep the limits, hypervolume {volume[-1]:.3f}")


def _number(value: float, broken: str) -> str:
    return "-" if broken else f"{value:.4g}"


def _told(what: str, done: int, total: int) -> None:
    if sys.stderr.isatty():
        print(f"\r{what} {done}/{total}\033[K", end="", file=sys.stderr, flush=True)


def _clear() -> None:
    if sys.stderr.isatty():
        print("\r\033[K", end="", file=sys.stderr)
