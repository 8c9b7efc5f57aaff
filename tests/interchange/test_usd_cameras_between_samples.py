"""A camera between two time samples of a matrix is rigid, half-way there; one that a sample stretches is an error."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom

from interchange.camera import Camera
from interchange.formats.document import Document, open_scene
from interchange.formats.usd_author import author_scene
from interchange.frames import look_at
from interchange.problems import FileError
from interchange.scene import Scene


def turned(degrees: float) -> Scene:
    a = np.radians(degrees)
    eye = 0.5 * np.array([np.cos(a), np.sin(a), 0.4])
    return Scene(cameras=(Camera("/World/Top", look_at(eye, np.zeros(3))),))


@pytest.fixture
def file(tmp_path: Path) -> Path:
    frames = [replace(turned(d), time=float(k)) for k, d in enumerate((0.0, 40.0))]
    path = tmp_path / "turning.usda"
    Document(author_scene(frames[0], frames=frames[1:]), path).save(path)
    return path


def test_a_camera_that_turns_is_rigid_between_its_samples(file: Path) -> None:
    document = open_scene(file)
    first, last = document.times[0], document.times[-1]
    assert last > first
    for share in (0.0, 0.25, 0.5, 1.0):
        pose = document.scene(first + share * (last - first)).cameras[0].world_from_camera
        np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-12)
    middle = document.scene((first + last) / 2).cameras[0].world_from_camera
    np.testing.assert_allclose(middle[:3, :3], turned(20.0).cameras[0].world_from_camera[:3, :3], atol=1e-6)


def test_a_sample_that_stretches_a_camera_is_an_error(file: Path) -> None:
    stage = Usd.Stage.Open(str(file))
    camera = UsdGeom.Xformable(stage.GetPrimAtPath("/World/Top"))
    camera.GetOrderedXformOps()[0].Set(Gf.Matrix4d().SetScale((1, 2, 1)), 0.0)
    stage.Save()
    document = open_scene(file)
    with pytest.raises(FileError, match="must not stretch one axis"):
        document.scene(document.times[0])
