"""What a lens moves is where it images points, near and far."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from analysis.gap.compared import lens_flow
from analysis.gap.search.model import Model
from analysis.gap.terms.base import NUISANCE
from analysis.gap.terms.geometry import _lens
from interchange.camera import Camera, Lens
from interchange.distortion import LensModel
from interchange.sensor import Sensor

FAR = (-0.29, 0.1, 0.001, -0.0005)  # of a wide lens (docs/real_gap.md)
WRITTEN = (-0.1, 0.02, 0.0, 0.0, 0, 0, 0, 0)
RATIONAL = (-0.1, 0.02, 0.0, 0.0, 0, 0.15, -0.03, 0)


def _camera(distortion: tuple[float, ...] = ()) -> Camera:
    return Camera("C", np.eye(4), Lens(4e-3, 8, 1.0, distortion), Sensor((80, 60), (6e-5, 6e-5)))


def _with(camera: Camera, more: tuple[float, ...]) -> Camera:
    own = np.array((*camera.lens.distortion, *(0.0,) * 8)[:8])
    own[:4] += more
    return replace(camera, lens=replace(camera.lens, distortion=tuple(own)))


@pytest.mark.parametrize("written", [(), WRITTEN, RATIONAL])
def test_what_a_lens_moves_is_where_it_images_points(written: tuple[float, ...]) -> None:
    """Points are projected by OpenCV's formula, without and with; the flow is looked up where they lie with it,
    bilinear between pixels (off by less than a hundredth where it goes over 10 px)."""
    camera = _camera(written)
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, 21), np.linspace(-0.35, 0.35, 15))
    points = np.stack([x, y, np.ones_like(x)], axis=-1)
    before, after = camera.project(points), _with(camera, FAR).project(points)
    moved = lens_flow.flow(camera, FAR)
    column, row = after[..., 0], after[..., 1]
    i, j = np.floor(row).astype(int), np.floor(column).astype(int)
    inside = (i >= 0) & (j >= 0) & (i < 59) & (j < 79)
    i, j, v, u = i[inside], j[inside], (row % 1)[inside][:, None], (column % 1)[inside][:, None]
    found = (1 - v) * ((1 - u) * moved[i, j] + u * moved[i, j + 1]) + v * (
        (1 - u) * moved[i + 1, j] + u * moved[i + 1, j + 1]
    )
    assert np.abs((after - before)[inside]).max() > 3
    np.testing.assert_allclose(found, (after - before)[inside], atol=0.01)


@pytest.mark.parametrize("written", [WRITTEN, RATIONAL])
@pytest.mark.parametrize("number", range(4))
def test_a_unit_moves_what_a_pixel_shows(number: int, written: tuple[float, ...]) -> None:
    """Where the lens stands far from what is written: the difference of two projections of what each pixel shows."""
    camera = _camera(written)
    moved = lens_flow.flow(camera, FAR)
    grid = np.stack(np.meshgrid(np.arange(80.0), np.arange(60.0)), axis=-1)
    source = grid - moved
    state = SimpleNamespace(camera=camera, source=(source[..., 0], source[..., 1]))
    _, rays = camera.rays(source)
    step = 1e-4
    more = tuple(x + step * (k == number) for k, x in enumerate(FAR))
    there = _with(camera, more).project(rays) - _with(camera, FAR).project(rays)
    np.testing.assert_allclose(np.stack(lens_flow.unit_flow(state, number), axis=-1), there / step, atol=0.02)


def test_what_a_lens_does_not_image_stays() -> None:
    """One that folds in the corners."""
    moved = lens_flow.flow(_camera(), (-0.9, 0.0, 0.0, 0.0))
    assert np.isfinite(moved).all()
    assert not moved[0, 0].any()


def test_a_fisheye_has_no_numbers_of_browns() -> None:
    """Beside a camera that has, what all cameras share moves that alone; by itself its lens is calibration's."""
    camera = _camera()
    fisheye = replace(camera, lens=Lens(4e-3, model=LensModel.FISHEYE))
    shared, own = (_lens(SimpleNamespace(camera=c), 0.1) for c in (camera, fisheye))
    assert [t.cause for t in shared] == [lens_flow.CAUSE] * 4
    assert [t.cause for t in own] == [NUISANCE] * 4
    assert shared[0].flow(SimpleNamespace(camera=fisheye)) is None
    here = np.zeros((1, 1)), np.zeros((1, 1))
    assert own[0].flow(SimpleNamespace(camera=fisheye, source=here)) is not None
    model = Model(tuple(shared), np.full(4, 0.1), np.full(4, 0.1))
    assert model.lens(SimpleNamespace(camera=camera)) == (0.1,) * 4
    assert model.lens(SimpleNamespace(camera=fisheye)) == (0.0,) * 4


@pytest.mark.parametrize(("k2", "folded"), [(-0.0225, True), (0.0335, False), (0.1004, False)])
def test_a_lens_folds_where_its_image_height_turns_back(k2: float, folded: bool) -> None:
    """h = r (1 + k1 r² + k2 r⁴) of the chessboard's lens at full size: its corners lie at h = 0.75, which with
    k2 = -0.0225 is more than the 0.716 that it reaches."""
    camera = Camera("C", np.eye(4), Lens(5.36e-3), Sensor((640, 480), (1e-5, 1e-5)))
    assert lens_flow.folds(camera, (-0.2636, k2, 0.0, 0.0)) is folded
