"""A plan carried out: its samples, their frames on the workers of a Dask scheduler, and the datasets of what is there.

A sweep that was broken off goes on where it stopped: a frame is done when its record is there, of this very job.
"""

import os
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from analysis.sweep.checking import Checker
from analysis.sweep.datasets import write_datasets
from analysis.sweep.job import SweepJob, is_done, read_record, work
from analysis.sweep.plan import Plan
from analysis.sweep.sampling import points, weights
from interchange.formats.document import open_scene
from interchange.problems import BrightfieldError
from offline import batch


@dataclass(frozen=True, eq=False)
class Design:
    """``rows`` (N, P): values of the plan's axes; ``weights`` (N,); ``rejected``: how many samples each constraint
    turned away, the first that did."""

    rows: np.ndarray
    weights: np.ndarray
    rejected: dict[str, int] = field(default_factory=dict)

    @property
    def drawn(self) -> int:
        return len(self.rows) + sum(self.rejected.values())


@dataclass(frozen=True)
class Swept:
    """What became of a plan. ``failed``: file and reason."""

    frames: int
    skipped: int
    failed: tuple[tuple[str, str], ...]
    seconds: float
    summary: dict[str, Any]


def design(plan: Plan) -> Design:
    """The samples that keep every constraint: as many as the plan asks for, where its method has always more.

    Raises BrightfieldError where too few keep them.
    """
    kept: list[np.ndarray] = []
    rejected: Counter[str] = Counter()
    check = Checker(plan)
    for row in points(plan.axes, plan.method, plan.count, plan.seed):
        why = check(row)
        if why:
            rejected[why] += 1
        else:
            kept.append(row)
        if plan.method.goes_on and (len(kept) == plan.count or _hopeless(len(kept), rejected, plan.count)):
            break
    check.close()
    if not kept or (plan.method.goes_on and len(kept) < plan.count):
        told = ", ".join(f"{name} rejected {n}" for name, n in rejected.items())
        raise BrightfieldError(
            f"Enough samples must keep the constraints; {len(kept)} of {len(kept) + sum(rejected.values())} did: "
            f"{told}. ({plan.file})"
        )
    rows = np.array(kept).reshape(len(kept), len(plan.axes))
    return Design(rows, weights(plan.axes, rows), dict(rejected))


def _hopeless(kept: int, rejected: Counter[str], count: int) -> bool:
    """Fewer than one in a hundred are kept, after enough to tell."""
    drawn = kept + sum(rejected.values())
    return drawn >= max(1000, 10 * count) and kept < 0.01 * drawn


def jobs_of(plan: Plan, rows: np.ndarray, folder: Path, digest: str) -> list[SweepJob]:
    """A job for every sample, time and camera, in this order."""
    jobs: list[SweepJob] = []
    for sample, row in enumerate(rows):
        for time in plan.times:
            values = tuple(plan.values_at(row, time).items())
            for number, camera in enumerate(plan.cameras):
                jobs.append(
                    SweepJob(
                        str(plan.scene.resolve()), digest, camera, time, len(jobs), sample, values, plan.defects,
                        plan.objects, plan.rendering, plan.seed, plan.noise, plan.width, plan.writes,
                        str(folder.resolve()), number,
                    )
                )  # fmt: skip
    return jobs


def sweep(
    plan: Plan,
    folder: Path,
    scheduler: str | None = None,
    workers: int = 0,
    progress: Callable[[batch.Progress], None] = lambda p: None,
) -> Swept:
    """Carry a plan out into ``folder``. Frames that fail are told with their reason; the others go on.

    ``workers`` 0: one for each processor thread in real time, one for every four for path tracing.
    """
    digest = open_scene(plan.scene).digest
    made = design(plan)
    folder.mkdir(parents=True, exist_ok=True)
    jobs = jobs_of(plan, made.rows, folder, digest)
    live = plan.rendering.name == "realtime"
    count = workers or (min(_cores(), max(1, len(jobs) // 8)) if live else 0)
    report = batch.run(jobs, scheduler, count, progress, work, is_done)
    records = [record for job in jobs if (record := read_record(job)) is not None]
    summary = write_datasets(plan, made, records, folder, report)
    return Swept(len(records), len(report.skipped), report.failed, report.seconds, summary)


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
