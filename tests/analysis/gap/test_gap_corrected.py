"""What a corrected scene can say, and what it cannot."""

import numpy as np
import pytest

from analysis.gap.corrected.scene import Change, changed
from analysis.gap.sensor.expected import mean_dn
from analysis.gap.terms.saturation import lost_above
from interchange.brdf.lafortune import Lafortune
from interchange.camera import Camera, Sensor
from interchange.image import Image
from interchange.material import Material
from interchange.mesh import Grained, Mesh
from interchange.problems import BrightfieldError
from interchange.scene import Body, Scene

STEEL = Lafortune((0.1,) * 3, ((0.6,) * 3,), ((-1, -1, 1),), (20.0,))
MESH = Mesh(np.eye(3), np.array([[0, 1, 2]]), np.tile([0.0, 0.0, 1.0], (3, 1)))
SENSOR = Sensor((100, 1), (1e-6, 1e-6), responsivity=1e4, full_well=1e4, bit_depth=12, black_level=95)
EYE = Camera("/eye", sensor=SENSOR)
SCENE = Scene((Body("/b", MESH, Material("/m", STEEL)),))


def test_a_grain_along_the_tangent_or_across_it_is_written() -> None:
    for split in (0.04, -0.04):
        there = changed(SCENE, SCENE, Change("anisotropy", "/m", {"split": split, "cross": 0.003}, None))
        (body,) = there.bodies
        assert body.mesh is MESH
        assert body.material.brdf.C[0] == pytest.approx((-1 - split / 2, -1 + split / 2, 1))


def test_a_grain_that_runs_another_way_is_refused_in_words() -> None:
    with pytest.raises(BrightfieldError, match="which way a grain runs"):
        changed(SCENE, SCENE, Change("anisotropy", "/m", {"split": 0.02, "cross": 0.03}, None))


def test_a_grain_is_laid_on_the_surface_along_a_turned_axis() -> None:
    """On a face that looks along x: the turned x axis without its part along the normal, which is the y axis."""
    side = Grained(MESH.vertices, MESH.faces, np.tile([1.0, 0.0, 0.0], (3, 1)), None, np.radians(40))
    assert side.tangents == pytest.approx(np.tile([0.0, 1.0, 0.0], (3, 1)))
    top = Grained(MESH.vertices, MESH.faces, MESH.normals, None, np.radians(40))
    assert top.tangents == pytest.approx(np.tile([np.cos(np.radians(40)), np.sin(np.radians(40)), 0], (3, 1)))
    drawn = Grained(MESH.vertices, MESH.faces, MESH.normals, np.array([[0, 0], [1, 0], [0, 1.0]]), 0.3)
    straight = Mesh(MESH.vertices, MESH.faces, MESH.normals, drawn.uv)
    assert np.sum(drawn.tangents * straight.tangents, axis=1) == pytest.approx(np.cos(0.3))


def _shown(change: Change, camera: Camera = EYE) -> tuple[np.ndarray, np.ndarray]:
    """DN above black over 4000, the range, of a wedge, without the change and with it."""
    scene = Scene(SCENE.bodies, cameras=(camera,))
    (there,) = changed(scene, scene, change).cameras
    wedge = np.linspace(0, 0.9, 100, dtype=np.float32).reshape(1, 100, 1)
    before, after = ((mean_dn(Image(wedge.repeat(3, 2)), c)[0, :, 0] - 95) / 4000 for c in (camera, there))
    return before, after


def test_a_well_that_fills_up_softly_is_a_response_with_knees() -> None:
    x, y = _shown(Change("saturation", "", {lost_above(0.5): 0.1, lost_above(0.7): 0.3}, {}))
    wanted = x - 0.1 * np.maximum(x - 0.5, 0) - 0.3 * np.maximum(x - 0.7, 0)
    assert x.max() > 0.85
    assert y == pytest.approx(wanted, abs=2e-4)


def test_a_smaller_well_ends_the_response_and_leaves_the_gain() -> None:
    x, y = _shown(Change("saturation", "", {"full_well": 6e3}, None))
    assert y == pytest.approx(np.minimum(x, 0.6), abs=5e-4)


def test_a_shutter_that_is_open_longer_is_written() -> None:
    """By 20 ms, where 0.2 s are set: a tenth more."""
    eye = Camera("/eye", sensor=SENSOR, t_exp=0.2)
    x, y = _shown(Change("exposure", "", {"delay": 0.02}, {"delay": 0.0}), eye)
    assert y == pytest.approx(1.1 * x, abs=2e-4)


def test_a_response_that_falls_is_refused() -> None:
    with pytest.raises(BrightfieldError, match="falls"):
        _shown(Change("saturation", "", {lost_above(0.5): 1.2}, {}))
