"""How much better a search for a set-up is than random search with the same budget, over several seeds.

    python docs/optimise/station.py --out out/station
    python benchmarks/optimise.py out/station/plan.yaml [--seeds 5] [--trials 60] [--keep out/optimise_seeds]

Hypervolumes are shares of one box, between the ideal and the nadir point of all searches' fronts and a tenth beyond.
With ``--keep`` a run that was broken off goes on.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.stats import wilcoxon

from analysis.optimise.plan_file import read
from analysis.optimise.search import Judge, hypervolumes, search
from analysis.optimise.session import drawn
from interchange.formats.document import open_scene
from realtime.renderers.rasterizer import Rasterizer


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("plan", type=Path)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--trials", type=int, default=60)
    parser.add_argument("--methods", nargs="+", default=["tpe", "random"])
    parser.add_argument("--keep", type=Path)
    args = parser.parse_args()
    plan = replace(read(args.plan), trials=args.trials)
    names = [(method, seed) for seed in range(args.seeds) for method in args.methods]
    with Rasterizer() as rasterizer:
        judge, render = (
            Judge(plan, open_scene(plan.scene).scene(), rasterizer),
            drawn(rasterizer, plan.samples),
        )
        done = []
        for method, seed in names:
            kept = args.keep / f"{method}{seed}.jsonl" if args.keep else None
            # random search draws other points than the search's own random start
            own = seed + 1000 if method == "random" else seed
            done.append(search(judge, render, method, own, keep=kept))
            print(
                f"{method} {seed}: {done[-1].feasible} of {len(done[-1].trials)} keep the limits", flush=True
            )
    volumes = dict(zip(names, hypervolumes(plan, done), strict=True))
    feasible = {n: s.feasible for n, s in zip(names, done, strict=True)}
    print("| | trials that keep the limits | hypervolume, mean ± sd | least .. most | seed by seed |")
    print("|---|---|---|---|---|")
    for method in args.methods:
        v = np.array([volumes[method, s][-1] for s in range(args.seeds)])
        f = np.mean([feasible[method, s] for s in range(args.seeds)])
        each = ", ".join(f"{x:.3f}" for x in v)
        print(
            f"| {method} | {f:.1f} of {plan.trials} | {v.mean():.3f} ± {v.std(ddof=1):.3f} "
            f"| {v.min():.3f} .. {v.max():.3f} | {each} |"
        )
    first, last = args.methods[0], args.methods[-1]
    pairs = [(volumes[first, s][-1], volumes[last, s][-1]) for s in range(args.seeds)]
    wins = sum(a > b for a, b in pairs)
    p = wilcoxon(*zip(*pairs, strict=True), alternative="greater").pvalue
    reached = [_reached(volumes[first, s], volumes[last, s][-1]) for s in range(args.seeds)]
    print(f"{first} is ahead of {last} with {wins} of {args.seeds} seeds (Wilcoxon, one-sided p = {p:.3f});")
    print(f"trials after which it is where {last} ends: {', '.join(map(str, reached))}")


def _reached(course: np.ndarray, level: float) -> int | str:
    beyond = np.flatnonzero(course >= level)
    return int(beyond[0]) + 1 if len(beyond) else "never"


if __name__ == "__main__":
    main()
