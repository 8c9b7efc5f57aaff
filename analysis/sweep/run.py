"""A plan carried out: its samples, their frames on the workers of a Dask scheduler, and the datasets of what is there.

A sweep that was broken off goes on where it stopped: a frame is done when its record is there, of this very job.
"""

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from analysis.sweep.datasets import write_datasets
from analysis.sweep.design import Told, kept_design
from analysis.sweep.job import SweepJob, is_done, of_another, read_record, work
from analysis.sweep.plan import Plan
from interchange.formats.document import open_scene
from interchange.problems import BrightfieldError
from offline import batch

TOGETHER = 16  # real-time frames that a worker is handed at once: a second or so


@dataclass(frozen=True)
class Swept:
    """What became of a plan. ``failed``: file and reason."""

    frames: int
    skipped: int
    failed: tuple[tuple[str, str], ...]
    seconds: float
    summary: dict[str, Any]


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
                        str(folder.resolve()), number, files=tuple(plan.files.items()),
                    )
                )  # fmt: skip
    return jobs


def sweep(
    plan: Plan,
    folder: Path,
    scheduler: str | None = None,
    workers: int = 0,
    progress: Callable[[batch.Progress], None] = lambda p: None,
    drawing: Told = lambda kept, count: None,
) -> Swept:
    """Carry a plan out into ``folder``. Frames that fail are told with their reason; the others go on.

    ``workers`` 0: one for each processor thread in real time, one for every four for path tracing.
    """
    digest = open_scene(plan.scene).digest
    folder.mkdir(parents=True, exist_ok=True)
    made = kept_design(plan, folder, digest, drawing)
    jobs = jobs_of(plan, made.rows, folder, digest)
    if others := of_another(folder, jobs):
        raise BrightfieldError(
            f"The folder must be empty or hold frames of this very plan and scene; {others} are of another. "
            f"Name another with --out, or remove it. ({folder})"
        )
    live = plan.rendering.name == "realtime"
    count = workers or (min(_cores(), max(1, len(jobs) // 8)) if live else 0)
    together = max(1, min(TOGETHER, len(jobs) // (4 * max(count, 1)))) if live else 1
    report = batch.run(jobs, scheduler, count, progress, work, is_done, together)
    records = [record for job in jobs if (record := read_record(job)) is not None]
    summary = write_datasets(plan, made, records, folder, report)
    return Swept(len(records), len(report.skipped), report.failed, report.seconds, summary)


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
