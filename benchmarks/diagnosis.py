"""What a second core saves a diagnosis: the same captures on one core and on all, in turns in one run.

    python benchmarks/diagnosis.py captures.json [--turns 2] [--cache DIR]

Base renderings and sensitivities are in the cache before anything is timed. Both must come to the same diagnosis.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parents[1]


def diagnosed(captures: Path, out: Path, cache: Path, cores: set[int]) -> dict[str, Any]:
    command = [sys.executable, "-m", "composer", "diagnose", str(captures), "--no-verify"]
    subprocess.run(
        [*command, "--out", str(out), "--cache", str(cache)],
        cwd=ROOT,
        check=True,
        stdout=subprocess.DEVNULL,
        preexec_fn=lambda: os.sched_setaffinity(0, cores),
    )
    found: dict[str, Any] = json.loads((out / "diagnosis.json").read_text())
    return found


def main() -> None:
    p = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    p.add_argument("captures", type=Path)
    p.add_argument("--turns", type=int, default=2)
    p.add_argument("--cache", type=Path, help="where renderings are kept (default: made for this run)")
    args = p.parse_args()
    every = os.sched_getaffinity(0)
    ways = {"one core": {min(every)}, f"{len(every)} cores": every}
    with tempfile.TemporaryDirectory() as folder:
        cache = args.cache or Path(folder) / "cache"
        first = diagnosed(args.captures.resolve(), Path(folder) / "first", cache, every)
        told = {k: v for k, v in first.items() if k != "seconds"}
        seconds: dict[str, list[float]] = {name: [] for name in ways}
        for turn in range(args.turns):
            for name, cores in ways.items():
                found = diagnosed(args.captures.resolve(), Path(folder) / "out", cache, cores)
                seconds[name].append(found.pop("seconds"))
                if found != told:
                    raise SystemExit(f"{name}: another diagnosis than on all cores")
                print(f"turn {turn + 1}, {name}: {seconds[name][-1]:.1f} s", flush=True)
    one, all_of_them = (np.array(x) for x in seconds.values())
    print(
        f"{first['verdict']}: {np.median(one):.0f} s and {np.median(all_of_them):.0f} s;"
        f" one core over all {np.median(one / all_of_them):.2f}"
    )


if __name__ == "__main__":
    main()
