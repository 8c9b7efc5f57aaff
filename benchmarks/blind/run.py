"""Runs the diagnosis over cases, by its command line alone: what it is given is what anyone would give it.

    python benchmarks/blind/run.py --cases DIR --out DIR [--render offline|realtime] [--workers N] [--only ID …]

``program.txt`` has the commit that answers: a set is answered by one program, and going on with another is refused.
Resumable: a case with a diagnosis.json is not run again. Renderings are kept in one place, since the cases of a scene
have one scene file; the first case of each scene fills it. ``times.jsonl`` has the seconds of each case.
"""

import argparse
import ctypes
import hashlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from queue import Queue

ROOT = Path(__file__).resolve().parents[2]
LIMIT = 3600  # s
PR_SET_PDEATHSIG = 1  # of prctl(2)


def command(case: Path, out: Path, cache: Path, render: str, more: Sequence[str] = ()) -> list[str]:
    return [
        sys.executable, "-m", "composer", "diagnose", str((case / "captures.json").resolve()),
        "--render", render, "--out", str(out.resolve()), "--cache", str(cache.resolve()), *more,
    ]  # fmt: skip


def program() -> str:
    """The commit that is checked out, and whether anything of it was changed."""

    def git(*words: str) -> str:
        done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=False)
        return done.stdout.strip()

    commit = git("rev-parse", "--short=10", "HEAD") or "unknown"
    return commit + (" with changes" if git("status", "--porcelain", "--untracked-files=no") else "")


def first_of_each_scene(cases: Sequence[Path]) -> tuple[list[Path], list[Path]]:
    """Cases whose scene file no other before them has, and the rest."""
    seen: set[str] = set()
    first, rest = [], []
    for case in cases:
        key = hashlib.sha256((case / "scene.usda").read_bytes()).hexdigest()
        (rest if key in seen else first).append(case)
        seen.add(key)
    return first, rest


def one(
    case: Path, out: Path, cache: Path, render: str, more: Sequence[str], cores: Queue[frozenset[int]]
) -> tuple[str, float, int, str]:
    """Runs a case on some of the ``cores``; its name, seconds, return code and the last line that it wrote."""
    own = cores.get()
    try:
        return _on(own, case, out, cache, render, more)
    finally:
        cores.put(own)


def shared_out(cores: Sequence[int], workers: int) -> list[frozenset[int]]:
    """Each worker's own: a case on one core alone takes 1.3 times as long as on two, and two beside each other on
    both would wait for each other's threads."""
    n = max(len(cores) // workers, 1)
    return [frozenset(cores[(k * n + i) % len(cores)] for i in range(n)) for k in range(workers)]


def _begun(cores: frozenset[int]) -> None:
    """In the case's own process: on its cores, and ended where this one is killed (Linux)."""
    os.sched_setaffinity(0, cores)
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)


def _on(
    cores: frozenset[int], case: Path, out: Path, cache: Path, render: str, more: Sequence[str]
) -> tuple[str, float, int, str]:
    out.mkdir(parents=True, exist_ok=True)
    began = time.monotonic()
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    try:
        done = subprocess.run(
            ["nice", *command(case, out, cache, render, more)],
            cwd=ROOT, env=environment, capture_output=True, text=True, timeout=LIMIT, check=False,
            preexec_fn=lambda: _begun(cores),
        )  # fmt: skip
        code, said = done.returncode, done.stderr
        (out / "said.txt").write_text(done.stdout + done.stderr)
    except subprocess.TimeoutExpired:
        code, said = 124, f"longer than {LIMIT} s"
    last = (said.strip().splitlines() or [""])[-1]
    if code:
        (out / "failed.txt").write_text(said)
    return case.name, time.monotonic() - began, code, last if code else ""


def main() -> None:
    p = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    p.add_argument("--cases", type=Path, required=True, help="a set's folder, with cases/ in it")
    p.add_argument("--out", type=Path, required=True)
    p.add_argument("--render", choices=("offline", "realtime"), default="offline")
    p.add_argument("--cache", type=Path, help="the product's renderings (default: OUT/renderings)")
    p.add_argument("--workers", type=int, default=1)
    p.add_argument("--only", nargs="*", default=[])
    p.add_argument(
        "--option", action="append", default=[], help="passed on, for example --option=--samples=64"
    )
    args = p.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    record, now = args.out / "program.txt", program()
    if record.is_file() and record.read_text().strip() != now:
        p.error(
            f"{args.out} has answers of {record.read_text().strip()}, and this is {now}: give another --out."
        )
    record.write_text(now + "\n")
    cache = args.cache or args.out / "renderings"
    cases = sorted(x.parent for x in (args.cases / "cases").glob("*/captures.json"))
    cases = [c for c in cases if not args.only or c.name in args.only]
    todo = [c for c in cases if not (args.out / c.name / "diagnosis.json").is_file()]
    print(f"{len(cases)} cases, {len(todo)} to run", flush=True)
    log = args.out / "times.jsonl"
    count = 0
    every = sorted(os.sched_getaffinity(0))
    for group, workers in zip(first_of_each_scene(todo), (1, args.workers), strict=True):
        cores: Queue[frozenset[int]] = Queue()
        for own in shared_out(every, workers):
            cores.put(own)
        with ThreadPoolExecutor(workers) as pool:
            jobs = [
                pool.submit(one, c, args.out / c.name, cache, args.render, args.option, cores) for c in group
            ]
            for job in as_completed(jobs):  # a long one holds up nobody's record
                name, seconds, code, last = job.result()
                count += 1
                with log.open("a") as file:
                    file.write(json.dumps({"case": name, "seconds": round(seconds, 1), "code": code}) + "\n")
                print(f"{count}/{len(todo)} {name} {seconds:.0f} s {last}", flush=True)


if __name__ == "__main__":
    main()
