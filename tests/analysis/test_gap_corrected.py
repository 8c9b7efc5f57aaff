"""What a corrected scene can say, and what it cannot."""

import numpy as np
import pytest

from analysis.gap.corrected import Change, changed
from interchange.brdf.lafortune import Lafortune
from interchange.material import Material
from interchange.mesh import Grained, Mesh
from interchange.problems import BrightfieldError
from interchange.scene import Body, Scene

STEEL = Lafortune((0.1,) * 3, ((0.6,) * 3,), ((-1, -1, 1),), (20.0,))
MESH = Mesh(np.eye(3), np.array([[0, 1, 2]]), np.tile([0.0, 0.0, 1.0], (3, 1)))
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
