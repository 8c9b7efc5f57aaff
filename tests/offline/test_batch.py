"""Batches: frames from a file, killed workers, resumption, failures that do not stop the rest."""

import os
import signal
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import psutil
import pytest
from distributed import LocalCluster

from interchange.formats import exr
from interchange.problems import BrightfieldError
from offline.batch import Progress, frame_jobs, run
from offline.job import is_done
from offline.settings import CyclesSettings

SCENE = """#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Z"
    startTimeCode = 0
    endTimeCode = 9
    defaultPrim = "World"
)
def Xform "World" {
    def Mesh "Ground" {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    }
    def SphereLight "Lamp" {
        float inputs:intensity = 10
        bool inputs:normalize = true
        float inputs:radius = 0
        double3 xformOp:translate = (0.2, 0, 1)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Camera "Camera" {
        float focalLength = 0.25
        float horizontalAperture = 0.2
        float verticalAperture = 0.15
        float2 clippingRange = (0.01, 100)
        int2 sensor:resolution = (32, 24)
        double3 xformOp:translate.timeSamples = { 0: (0, 0, 1), 9: (0.9, 0, 1) }
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
}
"""
QUICK = CyclesSettings(samples=2, max_bounces=1)


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    path = tmp_path / "scene.usda"
    path.write_text(SCENE)
    return path


def plan(scene: Path, times: list[float], settings: CyclesSettings = QUICK, passes=()):
    out = scene.parent / "out"
    return frame_jobs(
        str(scene), ["/World/Camera"], times, settings, lambda camera, t: str(out / f"{t:04.0f}.exr"), passes
    )


def test_batch_renders_resumes_and_reports(scene: Path):
    jobs = plan(scene, [0.0, 1.0, 2.0, 9.0], passes=["motion", "depth"])
    told: list[Progress] = []
    report = run(jobs, workers=1, progress=told.append)
    assert sorted(report.done) == [j.out for j in jobs]
    assert not report.failed
    assert told[0].left is None
    assert (told[-1].done, told[-1].total, told[-1].left) == (4, 4, 0)
    image = exr.read(jobs[1].out)
    assert image.made_by["job"] == jobs[1].key
    assert image.passes["depth"].min() == pytest.approx(1, rel=1e-5)
    assert image.passes["motion"][..., 0].mean() == pytest.approx(
        -0.1 * 40, rel=1e-4
    )  # f/pitch = 40 px at 1 m
    before = [os.stat(j.out).st_mtime_ns for j in jobs]
    Path(jobs[2].out).write_bytes(Path(jobs[2].out).read_bytes()[:300])  # broken off in the middle
    other = plan(scene, [3.0])
    again = run([*jobs, *other], workers=1)
    assert sorted(again.done) == [jobs[2].out, other[0].out]
    assert len(again.skipped) == 3
    assert [os.stat(jobs[k].out).st_mtime_ns for k in (0, 1, 3)] == [before[k] for k in (0, 1, 3)]
    changed = plan(scene, [0.0], CyclesSettings(samples=3, max_bounces=1))
    assert not is_done(changed[0])
    assert not list(scene.parent.glob("out/.*"))


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    """A cluster that was there before, as on several machines."""
    with LocalCluster(n_workers=1, threads_per_worker=1, memory_limit=0, dashboard_address=None) as cluster:
        yield cluster.scheduler_address


@pytest.mark.slow
def test_killed_workers_cost_their_frame_only(scene: Path, scheduler: str):
    """After the first frame the Cycles process is killed in the next one, after the third the Dask worker with it."""
    jobs = plan(scene, [float(t) for t in range(5)], CyclesSettings(samples=800, max_bounces=2))
    killed: list[int] = []
    others = {p.pid for p in psutil.Process().children()}  # renderers of other tests, which no cluster owns

    def kill(progress: Progress) -> None:
        if progress.done in (1, 3) and len(killed) == progress.done // 2:
            (blender,) = [
                p
                for p in psutil.Process().children(recursive=True)
                if p.pid not in others and "offline.worker" in p.cmdline()
            ]
            victim = blender if progress.done == 1 else blender.parent()
            killed.append(victim.pid)
            os.kill(victim.pid, signal.SIGKILL)

    report = run(jobs, scheduler, progress=kill)
    assert len(killed) == 2
    assert not report.failed
    assert sorted(report.done) == [j.out for j in jobs]
    assert all(is_done(j) for j in jobs)


def test_one_bad_frame_does_not_stop_the_others(scene: Path, scheduler: str):
    good, bad = plan(scene, [0.0, 1.0])
    report = run([good, replace(bad, camera="/World/Camra")], scheduler)
    assert report.done == (good.out,)
    assert 'Did you mean "/World/Camera"?' in report.failed[0][1]


def test_changed_scene_and_doubled_file_are_refused(scene: Path, scheduler: str):
    jobs = plan(scene, [0.0])
    scene.write_text(SCENE.replace("intensity = 10", "intensity = 11"))
    assert "it has changed" in run(jobs, scheduler).failed[0][1]
    with pytest.raises(BrightfieldError, match="named twice"):
        run([*jobs, *jobs], scheduler)
    with pytest.raises(BrightfieldError, match="No Dask scheduler answers at"):
        run(jobs, scheduler="tcp://127.0.0.1:9")
