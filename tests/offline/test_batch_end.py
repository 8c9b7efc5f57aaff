"""A batch whose frames are done is done, however late its workers end."""

import time
from dataclasses import dataclass

import distributed
import pytest

from offline.batch import run


@dataclass(frozen=True)
class Note:
    out: str
    key: str = "k"

    def with_threads(self, threads: int) -> "Note":
        return self


def write(job: Note) -> float:
    with open(job.out, "w") as file:
        file.write("done")
    return 0.5


def test_workers_that_end_late_cost_no_frame(tmp_path, monkeypatch: pytest.MonkeyPatch):
    """As on a machine so busy that a killed process is gone only after Dask's patience: closing raises TimeoutError."""
    closed = []

    class Late(distributed.LocalCluster):
        def __init__(self, **options):
            super().__init__(**{**options, "processes": False})  # threads: nothing is left over

        def close(self, timeout=None):
            if not closed:
                closed.append(time.monotonic())
                super().close(timeout)
                raise TimeoutError

    monkeypatch.setattr(distributed, "LocalCluster", Late)
    jobs = [Note(str(tmp_path / f"{k}.txt")) for k in range(5)]
    report = run(jobs, None, 1, lambda p: None, write, lambda job: False, 2)
    assert closed
    assert sorted(report.done) == [job.out for job in jobs]
    assert (report.failed, report.render_seconds) == ((), 2.5)
