"""How fast a sweep is: against as many starts of the program, and on two workers against one.

    python benchmarks/sweep.py [--frames 1000] [--starts 10] [--samples 4] [--width 160] [--truth]

A start is `brightfield render` of the same scene, camera, size and samples to the same kind of file. ``--truth``:
with everything that a sweep can write: DN, masks, COCO and BOP, and a sampled scratch in every frame.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from analysis.sweep.plan_file import read
from analysis.sweep.run import sweep

ROOT = Path(__file__).resolve().parents[1]
STATION = ROOT / "docs/examples/station.usda"
SCRATCH = """
defects:
  - {kind: scratch, on: Plate, x: {range: [-12, 2], unit: mm}, y: {range: [-8, 8], unit: mm},
     angle: {range: [0, 180], unit: deg}}
"""


def plan_of(folder: Path, frames: int, samples: int, width: int, truth: bool) -> Path:
    path = folder / "plan.yaml"
    path.write_text(
        f"scene: {STATION}\nwidth: {width}\nrenderer: {{name: realtime, samples: {samples}}}\n"
        f"sampling: {{method: sobol, count: {frames}}}\nobjects: [Plate, Plug]\n"
        f"write: {'[exr, png, coco, bop]' if truth else '[exr]'}\n"
        "parameters:\n  Led0.intensity: {range: [0.02, 0.2], unit: W/sr}\n"
        f"  Camera.pose.tx: {{range: [-8, 8], unit: mm}}\n{SCRATCH if truth else ''}",
        encoding="utf-8",
    )
    return path


def cpu() -> float:
    """s of this process and of its children that have ended."""
    own, children = (resource.getrusage(w) for w in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return own.ru_utime + own.ru_stime + children.ru_utime + children.ru_stime


def swept(plan: Path, folder: Path, workers: int) -> tuple[float, float]:
    """Seconds and processor seconds, the start of the workers included."""
    began, used = time.perf_counter(), cpu()
    done = sweep(read(plan), folder, workers=workers)
    if done.failed:
        sys.exit(f"{len(done.failed)} frames failed: {done.failed[0]}")
    return time.perf_counter() - began, cpu() - used


def started(folder: Path, starts: int, samples: int, width: int) -> tuple[float, float]:
    began, used = time.perf_counter(), cpu()
    for k in range(starts):
        words = ["render", str(STATION), "--out", str(folder / f"{k}.exr"), "--samples", str(samples)]
        command = [sys.executable, "-m", "composer", *words, "--width", str(width)]
        command += ["--passes", "depth", "object_id"]
        subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return time.perf_counter() - began, cpu() - used


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--frames", type=int, default=1000)
    parser.add_argument("--starts", type=int, default=10)
    parser.add_argument("--samples", type=int, default=4)
    parser.add_argument("--width", type=int, default=160)
    parser.add_argument("--truth", action="store_true")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        plan = plan_of(folder, args.frames, args.samples, args.width, args.truth)
        half = max(1, args.starts // 2)
        first = started(folder, half, args.samples, args.width)
        found = {workers: swept(plan, folder / f"on{workers}", workers) for workers in (1, 2)}
        second = started(folder, half, args.samples, args.width)
        wall, used = ((a + b) / (2 * half) for a, b in zip(first, second, strict=True))
    print(
        f"load average {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores; {args.frames} frames, {args.width} px wide"
    )
    print(f"a start of the program: {wall:.2f} s, {used:.2f} s of processor")
    for workers, (seconds, spent) in found.items():
        each = seconds / args.frames
        print(
            f"a sweep on {workers}: {1e3 * each:.1f} ms a frame, {args.frames / seconds:.1f} frames/s, "
            f"{1e3 * spent / args.frames:.1f} ms of processor; {wall / each:.1f} times the frames/s of starts, "
            f"{used * args.frames / spent:.1f} times by processor time"
        )
    print(f"two workers are {found[1][0] / found[2][0]:.2f} times as fast as one")


if __name__ == "__main__":
    main()
