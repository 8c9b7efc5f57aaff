"""A real picture of a known target and its rendered twin agree in px and DN, as docs/twin.md says."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

FILE = Path(__file__).parents[2] / "benchmarks/twin.py"


@pytest.fixture(scope="module")
def twin():
    spec = importlib.util.spec_from_file_location("twin_benchmark", FILE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_an_unseen_pictures_twin_has_its_edges_and_its_dn(twin):
    """Corners to the real detector's scatter (0.2 px), edges to 0.2 px and 0.05 in the mean, squares to some DN."""
    pictures = sorted((twin.ASSETS / "calibration").glob("left*.jpg"))
    lines, panels = twin.chessboards(pictures[0:8:2], pictures[3:4])
    name, corners, edges, mean, width, white, black, gap = (
        c.strip() for c in lines[-1].strip("|").split("|")
    )
    assert name == "left04.jpg"
    assert float(corners) < 0.3
    assert float(edges) < 0.3
    assert abs(float(mean)) < 0.05
    real, own = (float(x) for x in width.split(","))
    assert own == pytest.approx(real, rel=0.2)
    assert float(white.split(",")[1]) < 3
    assert float(black.split(",")[1]) < 4
    assert float(gap) < 4
    assert panels.shape[1] == 3 * 320


def test_edges_are_found_where_they_are(twin):
    """A twin shifted by a third of a pixel, by its camera: edges along columns show it, to 0.03 px (8 bits)."""
    from dataclasses import replace

    from interchange.camera import Camera, Lens, Sensor
    from interchange.frames import look_at

    pose = look_at(np.array([0.1, -0.06, 0.5]), np.array([0.1, -0.0625, 0.0]), up=(0, 1, 0))
    camera = Camera("c", pose, Lens(16e-3), Sensor((320, 240), (3e-5, 3e-5)))
    image = twin.frame(camera, np.array([200.0, 0, 0]), 10.0, 0.8)
    assert twin.edges(image, camera).offset == pytest.approx(0, abs=0.03)
    K = camera.K
    moved = replace(camera, principal_point=(K[0, 2] + 1 / 3, K[1, 2]))
    offset = twin.edges(image, moved).offset
    upright = twin.BOARD.rows - 2
    across = offset[upright * (twin.BOARD.columns - 1) :]
    assert np.abs(across) == pytest.approx(1 / 3, abs=0.03)
