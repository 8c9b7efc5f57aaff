"""Many frames, each described by data alone, on the workers of a Dask scheduler.

Every Dask worker process keeps one warm Cycles worker. A worker that crashes or is killed costs its frame, which is
given to another one. A finished frame is a file with the job's digest in its header, so a batch that was broken
off goes on where it stopped.
"""

import os
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Protocol, Self, TypeVar

from interchange.formats.base import Options
from interchange.problems import BrightfieldError
from offline.job import FrameJob, is_done, work
from offline.settings import CyclesSettings

TRIES = 3  # workers that may die under one frame before the frame is given up
WINDOW = 4  # frames a worker that are handed out ahead


class BatchJob(Protocol):
    """What a batch is made of: data that say which file is to be made. ``key`` names all that decides it."""

    @property
    def out(self) -> str: ...

    @property
    def key(self) -> str: ...

    def with_threads(self, threads: int) -> Self: ...


J = TypeVar("J", bound=BatchJob)


@dataclass(frozen=True)
class Progress:
    done: int  # rendered now or found finished
    failed: int
    total: int
    skipped: int  # found finished
    left: float | None  # s until the end, None before the first frame

    def __str__(self) -> str:
        left = "" if self.left is None else f", {self.left:.0f} s left"
        return f"{self.done}/{self.total}{f', {self.failed} failed' if self.failed else ''}{left}"


@dataclass(frozen=True)
class Report:
    done: tuple[str, ...]  # files rendered now
    skipped: tuple[str, ...]  # files that were there
    failed: tuple[tuple[str, str], ...] = ()  # file and reason
    seconds: float = 0.0
    render_seconds: float = field(default=0.0, compare=False)  # of all frames together


def run(
    jobs: Sequence[J],
    scheduler: str | None = None,
    workers: int = 0,
    progress: Callable[[Progress], None] = lambda p: None,
    work: Callable[[J], float] = work,  # type: ignore[assignment]  # the jobs' own
    is_done: Callable[[J], bool] = is_done,  # type: ignore[assignment]
    together: int = 1,
) -> Report:
    """Render what is not finished yet.

    ``scheduler``: address of a Dask scheduler, whose workers need this program and the same paths; None starts a
    cluster of ``workers`` processes here (0: one for every four processor threads), which share the threads.
    Frames that fail are in the report with their reason; the others go on. After Ctrl-C the finished frames stay.
    ``work`` makes a job's file in a worker process and returns the seconds it took; ``is_done`` says whether the file
    is there, of this very job. ``together``: frames that are handed out at once, for those that take milliseconds;
    where a worker dies under them, each is tried alone.
    """
    began = time.monotonic()
    outs = [job.out for job in jobs]
    if len(set(outs)) < len(outs):
        twice = next(o for o in outs if outs.count(o) > 1)
        raise BrightfieldError(f"Every frame needs a file of its own; {twice} is named twice.")
    skipped = [job for job in jobs if is_done(job)]
    finished = {job.out for job in skipped}
    todo = [job for job in jobs if job.out not in finished]
    done: list[str] = []
    failed: list[tuple[str, str]] = []
    spent = 0.0

    def tell() -> None:
        count = len(done) + len(failed)
        left = (time.monotonic() - began) / count * (len(todo) - count) if count else None
        progress(Progress(len(done) + len(skipped), len(failed), len(jobs), len(skipped), left))

    tell()
    if todo:
        for job, result in _results(todo, scheduler, workers, work, together):
            if isinstance(result, float):
                done.append(job.out)
                spent += result
            else:
                failed.append((job.out, result))
            tell()
    return Report(tuple(done), tuple(sorted(finished)), tuple(failed), time.monotonic() - began, spent)


def _each(work: Callable[[J], float], jobs: Sequence[J]) -> list[float | str]:
    """Seconds or reason of every job, in a worker."""
    found: list[float | str] = []
    for job in jobs:
        try:
            found.append(float(work(job)))
        except BrightfieldError as error:
            found.append(str(error))
        except Exception as error:  # a frame's own: told with it, the others go on
            found.append(f"{type(error).__name__}: {error}")
    return found


def _results(
    jobs: Sequence[J], scheduler: str | None, workers: int, work: Callable[[J], float], together: int
) -> Iterator[tuple[J, float | str]]:
    """(job, seconds or reason) as they come, in no order."""
    import dask
    import distributed

    library: Any = distributed  # without annotations
    Client, LocalCluster, as_completed = library.Client, library.LocalCluster, library.as_completed

    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    count = workers or max(1, cores // 4)
    threads = max(1, cores // count)
    settings = {
        "distributed.scheduler.allowed-failures": TRIES - 1,
        "distributed.admin.tick.limit": "1h",  # a frame may hold a worker's loop for long
        "logging.distributed": "critical",
    }
    with dask.config.set(settings):
        cluster = None
        if scheduler is None:
            cluster = LocalCluster(
                n_workers=count, threads_per_worker=1, processes=True, memory_limit=0, dashboard_address="127.0.0.1:0",
                silence_logs=50,
            )  # fmt: skip
            jobs = [job.with_threads(threads) for job in jobs]
        try:
            with Client(cluster or scheduler, timeout=60 if cluster else 5) as client:
                waiting = deque(jobs[k : k + together] for k in range(0, len(jobs), together))
                handed: dict[Any, Sequence[J]] = {}

                def hand() -> Any:
                    if not waiting:
                        return None
                    some = waiting.popleft()
                    name = f"frames-{len(some)}-{some[0].key}-{some[0].out}"
                    future = client.submit(_each, work, some, key=name, pure=False)
                    handed[future.key] = some
                    return future

                ahead = WINDOW * max(count, len(client.scheduler_info()["workers"]))
                first = [future for future in (hand() for _ in range(ahead)) if future is not None]
                queue = as_completed(first)
                for future in queue:
                    some = handed.pop(future.key)
                    error = future.exception() if future.status == "error" else None
                    if future.status == "finished":
                        yield from zip(some, future.result(), strict=True)
                    elif len(some) > 1:
                        waiting.extend([job] for job in some)
                    elif isinstance(error, library.KilledWorker):
                        yield some[0], f"its worker died {TRIES} times"
                    else:
                        yield some[0], f"{type(error).__name__}: {error}"
                    following = hand()
                    if following is not None:
                        queue.add(following)
        except OSError as error:
            raise BrightfieldError(f"No Dask scheduler answers at {scheduler}: {error}") from None
        finally:
            if cluster is not None:
                with suppress(TimeoutError):  # workers are killed by then; a busy machine is late to tell
                    cluster.close()


def frame_jobs(
    path: str,
    cameras: Sequence[str],
    times: Sequence[float],
    settings: CyclesSettings,
    name: Callable[[str, float], str],
    passes: Sequence[str] = (),
    per_light: bool = False,
    width: int = 0,
    options: Options = Options(),  # noqa: B008  frozen
) -> list[FrameJob]:
    """A job for every camera and time code. ``name(camera, time)`` is the file that it is to write.

    For pass ``motion`` each job knows the scene's frame after its own, rendered or not.
    """
    from interchange.formats.document import open_scene

    document = open_scene(path, options)
    jobs = []
    for camera in cameras:
        for time_code in times:
            jobs.append(
                FrameJob(
                    scene=os.path.abspath(path),
                    digest=document.digest,
                    camera=camera,
                    time=time_code,
                    out=name(camera, time_code),
                    settings=settings,
                    passes=tuple(passes),
                    per_light=per_light,
                    width=width,
                    next_time=document.following(time_code) if {"motion", "all"} & set(passes) else None,
                    options=options,
                )
            )
    return jobs
