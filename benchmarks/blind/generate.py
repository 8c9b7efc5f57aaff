"""Makes the cases of the blind benchmark.

    python benchmarks/blind/generate.py --set rehearsal --cases 100 --seed 1 --out DIR
    python benchmarks/blind/generate.py --set sealed --name NAME --cases 400 --out DIR --vault FILE

DIR/cases/ID/ holds captures.json, scene.usda and images. Labels of a rehearsal set stand in DIR/labels.json. Those of
a sealed set go to FILE, outside of what the diagnosis is given; its seed is drawn, never shown, and the hash of the
labels is written to seals.json, to be committed before the run. What was made is not made again.
"""

import argparse
import json
import os
import secrets
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1]))

from benchmarks.blind import sealing  # noqa: E402
from benchmarks.blind.strata import SCENES, SEVERITIES, Plan, plans  # noqa: E402


def _one(plan: Plan, settings: Any, folder: Path, labels: Path) -> tuple[str, float, str]:
    from benchmarks.blind.case import made
    from benchmarks.blind.severity import OutOfReach

    began = time.monotonic()
    try:
        label = made(plan, settings, folder)
    except OutOfReach as error:
        label = {"case": plan.case, "stratum": plan.stratum, "left out": str(error)}
    sealing.write_atomic(labels, sealing.text_of(label), 0o600)
    return plan.case, time.monotonic() - began, label.get("left out", "")


def main() -> None:
    p = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    p.add_argument("--set", choices=("rehearsal", "sealed"), required=True)
    p.add_argument("--name", default="", help="of a sealed set, in seals.json")
    p.add_argument("--cases", type=int, required=True)
    p.add_argument("--seed", type=int, default=None, help="of a rehearsal set")
    p.add_argument("--out", type=Path, required=True)
    p.add_argument("--vault", type=Path, help="where a sealed set's labels are kept")
    p.add_argument("--cache", type=Path, help="where renderings are kept (default: OUT/cache)")
    p.add_argument(
        "--severities", type=float, nargs="+", default=[100 * s for s in SEVERITIES], help="per cent"
    )
    p.add_argument(
        "--counts", nargs="+", default=[], metavar="STRATUM=N", help="in place of --cases' proportions"
    )
    p.add_argument(
        "--worlds", type=int, default=2, help="draws of the calibration errors that are rendered, a scene"
    )
    p.add_argument("--scenes", nargs="+", choices=SCENES, default=SCENES)
    p.add_argument("--size", type=int, nargs=2, help="px of all captures (default: each scene's own)")
    p.add_argument("--samples", type=int, default=25, help="of a ninth of a pixel; a square number")
    p.add_argument(
        "--apart", type=float, default=0.0, metavar="SHARE", help="of cases with errors and forms of apart/"
    )
    p.add_argument(
        "--still",
        action="store_true",
        help="scenes stand as written: errors are of the images alone, as in the sample captures",
    )
    p.add_argument(
        "--made",
        action="store_true",
        help="make no more: a set is the first cases by name, as far as all are made",
    )
    p.add_argument("--workers", type=int, default=1)
    p.add_argument("--nice", type=int, default=10)
    args = p.parse_args()
    os.nice(args.nice)
    sealed = args.set == "sealed"
    if sealed and (args.vault is None or not args.name or args.seed is not None):
        p.error("a sealed set needs --vault and --name, and draws its own seed")
    if not sealed and args.seed is None:
        p.error("a rehearsal set needs --seed")
    parts = args.vault.with_suffix(".parts") if sealed else args.out / "labels"
    secret = parts / "seed"
    if sealed and not secret.is_file():
        sealing.write_atomic(secret, str(secrets.randbits(62)).encode(), 0o600)
    seed = int(secret.read_text()) if sealed else args.seed

    from benchmarks.blind.case import Settings

    settings = Settings(
        args.cache or args.out / "cache",
        seed,
        tuple(args.size) if args.size else None,
        args.samples,
        still=args.still,
    )
    given = {k: int(n) for k, n in (x.split("=") for x in args.counts)}
    try:
        todo = plans(
            args.cases,
            seed,
            args.worlds,
            tuple(s / 100 for s in args.severities),
            given or None,
            tuple(args.scenes),
            args.apart,
        )
    except ValueError as error:
        p.error(str(error))
    todo.sort(key=lambda x: x.case)  # names are drawn by lot: the first of them are a sample of all
    work = [x for x in todo if not (parts / f"{x.case}.json").is_file()]
    if args.made and work:
        todo, work = todo[: todo.index(work[0])], []
    print(f"{len(todo)} cases, {len(work)} to make", flush=True)
    with ProcessPoolExecutor(args.workers) as pool:
        jobs = [
            pool.submit(_one, x, settings, args.out / "cases" / x.case, parts / f"{x.case}.json")
            for x in work
        ]
        for k, job in enumerate(jobs):
            case, seconds, why = job.result()
            print(f"{k + 1}/{len(work)} {case} {seconds:.0f} s {'left out' if why else ''}", flush=True)
            if not sealed:
                _gather(todo, parts, args.out, seed)
    labels = _gather(todo, parts, args.out, seed, write=not sealed)
    if sealed:
        print(f"{args.name}: sha256 {sealing.seal(labels, args.vault, HERE / 'seals.json', args.name)}")


def _gather(todo: list[Plan], parts: Path, out: Path, seed: int, write: bool = True) -> dict[str, Any]:
    there = [parts / f"{x.case}.json" for x in todo]
    labels = {"seed": seed, "cases": [json.loads(f.read_text()) for f in there if f.is_file()]}
    if write:
        sealing.write_atomic(out / "labels.json", sealing.text_of(labels))
    return labels


if __name__ == "__main__":
    main()
