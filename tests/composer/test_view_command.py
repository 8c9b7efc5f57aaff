"""`brightfield view` as a user runs it."""

import json

import numpy as np
import pytest
from PIL import Image as Pillow

from composer.cli import main
from interchange.camera import Camera, Lens, Sensor
from interchange.formats.usd_author import author_scene
from interchange.frames import look_at
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.mesh import Mesh
from interchange.scene import Body, Scene


def plate(width, height, z, x=0.0):
    corner = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2
    vertices = np.column_stack([corner * [width, height] + [x, 0], np.full(4, z)])
    return Mesh(vertices, np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.tile([0.0, 0, 1], (4, 1)))


@pytest.fixture
def station(tmp_path):
    """A plate of 100 mm under a camera 0.5 m above; a housing right above its left quarter."""
    bodies = (
        Body("/part", plate(0.1, 0.1, 0.0), Material("/m")),
        Body("/housing", plate(0.025, 0.2, 0.001, -0.0375), Material("/m")),
    )
    lens = Lens(focal_length=0.025, f_stop=4.0, focus_distance=0.5)
    pose = look_at(np.array([0, 0, 0.5]), np.zeros(3), (0, 1, 0))
    camera = Camera("/camera", pose, lens, Sensor((160, 120), (50e-6, 50e-6)))
    light = Light("/sun", LightKind.DISTANT, (1.0, 1, 1))
    author_scene(Scene(bodies, (light,), (camera,))).Export(str(tmp_path / "station.usda"))
    return tmp_path / "station.usda"


def test_numbers_and_pictures(station, tmp_path, capsys):
    out = tmp_path / "view"
    assert main(["view", str(station), "--of", "part", "--out", str(out)]) == 0
    about = json.loads((out / "view.json").read_text())
    assert about["working_distance_mm"] == pytest.approx(500, rel=1e-3)
    assert about["field_of_view_mm"] == pytest.approx([160, 120], rel=1e-3)
    assert about["scale_mm_per_px"]["median"] == pytest.approx(1.0, rel=1e-3)
    shares = about["share_of_facing_surface"]
    assert shares["hidden_by /World/housing"] == pytest.approx(0.25, abs=0.01)
    assert shares["seen"] == pytest.approx(0.75, abs=0.01)
    assert about["sharp_mm"]["from"] < 500 < about["sharp_mm"]["to"]
    pixels = np.asarray(Pillow.open(out / "view.png")).astype(int)
    red = (pixels[..., 0] - pixels[..., 1]) > 60
    assert red.mean() == pytest.approx(
        25 * 100 / (160 * 120), rel=0.06
    )  # the covered quarter, in pixels of a mm
    assert "seen" in capsys.readouterr().out


def test_a_body_that_is_not_there_is_one_line(station, capsys):
    assert main(["view", str(station), "--of", "prt"]) == 2
    assert 'no body "prt"' in capsys.readouterr().err
