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


@pytest.fixture(scope="module")
def flea3():
    from benchmarks import twin_flea3

    return twin_flea3


def flea3_assets() -> Path:
    return FILE.parents[1] / "assets/flea3"


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


def numbers(line: str) -> list[float | None]:
    cells = [c.strip() for c in line.strip("|").split("|")]
    return [float(c) if c and c.lstrip("+-").replace(".", "").isdigit() else None for c in cells]


@pytest.mark.slow
def test_printed_discs_have_the_edges_and_the_dn_that_their_neighbours_foretell(flea3):
    """The data sheet's focal length; edges to 0.2 px, paper to 1 % of its DN and ink to half a DN (green sites)."""
    lines, panel = flea3.discs(flea3_assets())
    rows = {line.strip("| ").split(" |")[0]: numbers(line) for line in lines if line.startswith("|")}
    assert rows["centres of 15 discs, px"][3] < 0.2
    _, _, _, off, mean = rows["360 edges, px outwards"]
    assert off < 0.2
    assert abs(mean) < 0.06
    _, real, twin, off, _ = rows["paper, green sites, DN"]
    assert 200 < real < 250
    assert twin == pytest.approx(real, rel=0.005)
    assert off < 0.01 * real
    assert rows["ink, green sites, DN"][3] < 0.6
    assert panel.shape == (340, 3 * 408)


def test_a_colorcheckers_patches_have_the_dn_of_its_published_reflectances(flea3):
    """Twelve patches that nothing was fitted to: within a tenth of their spread, under 550 nm a sixth."""
    lines, _ = flea3.checker(flea3_assets())
    rows = [line.strip("|").split("|") for line in lines if " ms | " in line]
    assert [r[0].split()[0] for r in rows] == ["450", "450", "550", "650"]
    for row in rows:
        off, spread, correlation = (float(c) for c in row[5:8])
        assert off < (0.18 if row[0].startswith(" 550") else 0.15) * spread
        assert correlation > 0.99
