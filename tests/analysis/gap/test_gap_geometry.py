"""What calibration leaves of a lens and a camera's own numbers, against closed forms."""

from types import SimpleNamespace

import numpy as np
import pytest

from analysis.gap.terms.geometry import _farthest, _undone
from interchange.camera import Camera, Lens, Sensor

WIDTH, HEIGHT = 64, 48
CAMERA = Camera(
    "c", lens=Lens(focal_length=0.02), sensor=Sensor(resolution=(WIDTH, HEIGHT), pixel_pitch=(5e-5, 5e-5))
)


@pytest.fixture(scope="module")
def flows() -> dict[str, np.ndarray]:
    """(2, h, w) px by the term's name."""
    grid = np.meshgrid(np.arange(WIDTH, dtype=float), np.arange(HEIGHT, dtype=float))
    state = SimpleNamespace(camera=CAMERA, grid=grid)
    terms = _undone("c", _farthest(SimpleNamespace(camera=CAMERA)), 0.03)
    return {t.parameter: np.stack(t.flow(state)) for t in terms}


def test_what_is_told_is_a_pixel_at_the_corner(flows: dict[str, np.ndarray]) -> None:
    """The middle of the corner's pixel lies 31.5 and 23.5 of 32 and 24 px from the axis."""
    for name in ("focal length", "aspect", "skew"):
        assert np.hypot(*flows[name][:, 0, 0]) == pytest.approx(np.hypot(31.5, 23.5) / 40)
    radial = np.hypot(*flows["zone of the lens"])
    assert radial.max() == pytest.approx(1, abs=0.01)
    assert radial[0, 0] < 0.2


def test_intrinsics_and_a_turn_about_the_axis_are_all_that_is_linear(flows: dict[str, np.ndarray]) -> None:
    """Any map of places that is linear in them, such as two focal lengths that differ and a skew, with the turn (y, -x)
    that a pose has."""
    x, y = flows["focal length"]
    spanned = np.stack([*(flows[n] for n in ("focal length", "aspect", "skew")), np.stack([y, -x])])
    A = np.random.default_rng(0).standard_normal((2, 2))
    wanted = np.einsum("ij,jhw->ihw", A, np.stack([x, y]))
    X = spanned.reshape(4, -1).T
    found = np.linalg.lstsq(X, wanted.reshape(-1), rcond=None)[0]
    assert X @ found == pytest.approx(wanted.reshape(-1), abs=1e-9)
