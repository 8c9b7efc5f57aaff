"""How fast a sweep is: against as many starts of the program, and on two workers against one.

    python benchmarks/sweep.py [--frames 1000] [--starts 10] [--pieces 1] [--samples 4] [--width 160] [--truth]

``--pieces``: starts, the sweep on one worker and the sweep on two take turns that many times. Beside each stands how
much of the machine's processors other programs had. A start is `brightfield render` of the same scene, camera, size and
samples to the same kind of file. ``--truth``: with everything that a sweep can write: DN, masks, COCO and BOP, and a
sampled scratch in every frame.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
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


def busy() -> float:
    """s that all processors of the machine have worked since it started, for whomever."""
    ticks = [int(x) for x in Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:]]
    return (sum(ticks) - ticks[3] - ticks[4]) / os.sysconf("SC_CLK_TCK")  # but idle and waiting for disks


class Watched:
    """Times pieces of one kind, and what others had of the processors meanwhile."""

    def __init__(self, name: str) -> None:
        self.name, self.pieces = name, list[tuple[int, float, float, float]]()

    def piece(self, count: int, work: Callable[[], tuple[float, float]]) -> None:
        began, all_before, own_before = time.perf_counter(), busy(), cpu()
        seconds, used = work()
        passed = time.perf_counter() - began
        others = max(busy() - all_before - (cpu() - own_before), 0.0) / passed
        self.pieces.append((count, seconds, used, others))
        print(
            f"{self.name}: {count} in {seconds:.1f} s, {used:.1f} s of processor; others had {others:.2f} processors",
            flush=True,
        )

    @property
    def wall(self) -> float:
        """s of each."""
        return sum(p[1] for p in self.pieces) / sum(p[0] for p in self.pieces)

    @property
    def used(self) -> float:
        return sum(p[2] for p in self.pieces) / sum(p[0] for p in self.pieces)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--frames", type=int, default=1000)
    parser.add_argument("--starts", type=int, default=10)
    parser.add_argument("--pieces", type=int, default=1)
    parser.add_argument("--samples", type=int, default=4)
    parser.add_argument("--width", type=int, default=160)
    parser.add_argument("--truth", action="store_true")
    args = parser.parse_args()
    start, one, two = Watched("starts"), Watched("sweep, 1 worker"), Watched("sweep, 2 workers")
    frames, starts = max(1, args.frames // args.pieces), max(1, args.starts // args.pieces)
    for k in range(args.pieces):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            plan = plan_of(folder, frames, args.samples, args.width, args.truth)
            start.piece(starts, lambda f=folder: started(f, starts, args.samples, args.width))  # type: ignore[misc]
            for workers, watched in ((1, one), (2, two))[:: 1 if k % 2 == 0 else -1]:
                watched.piece(frames, lambda f=folder, p=plan, w=workers: swept(p, f / f"on{w}", w))  # type: ignore[misc]
    print(
        f"{os.cpu_count()} cores; {args.frames} frames, {args.width} px wide; workers' starts are counted in"
    )
    print(f"a start of the program: {start.wall:.2f} s, {start.used:.2f} s of processor")
    for watched in (one, two):
        print(
            f"{watched.name}: {1e3 * watched.wall:.1f} ms a frame, {1 / watched.wall:.1f} frames/s, "
            f"{1e3 * watched.used:.1f} ms of processor; {start.wall / watched.wall:.1f} times the frames/s of starts, "
            f"{start.used / watched.used:.1f} times by processor time"
        )
    ratios = [a[1] / b[1] for a, b in zip(one.pieces, two.pieces, strict=True)]
    print(f"two workers are {', '.join(f'{r:.2f}' for r in ratios)} times as fast as one, by pieces")


if __name__ == "__main__":
    main()
