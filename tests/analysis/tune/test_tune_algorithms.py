"""Algorithms against images whose edges, circles and places are known in closed form."""

import numpy as np
import pytest
from scipy.special import ndtr

from analysis.tune.algorithms import MODELS, algorithm
from analysis.tune.algorithms.canny import Canny
from analysis.tune.algorithms.circle_gauge import CircleGauge, fit_circle
from analysis.tune.algorithms.line_gauge import LineGauge
from analysis.tune.algorithms.subpixel_edges import SubpixelEdges
from analysis.tune.algorithms.template_match import Pattern, TemplateMatch
from analysis.tune.algorithms.threshold_blobs import ThresholdBlobs
from analysis.tune.found import Circle, Line
from interchange.parameter import parameters, settings
from interchange.problems import BrightfieldError

SIZE = 96
Y, X = np.mgrid[:SIZE, :SIZE].astype(np.float64)


def step(angle: float, offset: float, blur: float = 0.8) -> np.ndarray:
    """A straight edge blurred by ``blur`` px rms, at ``offset`` px from the middle along its normal."""
    d = (X - SIZE / 2) * np.cos(angle) + (Y - SIZE / 2) * np.sin(angle) - offset
    return (40 + 160 * ndtr(d / blur)).astype(np.float32)


def disc(middle: tuple[float, float], radius: float, blur: float = 0.8) -> np.ndarray:
    r = np.hypot(X - middle[0], Y - middle[1])
    return (200 - 160 * ndtr((radius - r) / blur)).astype(np.float32)


def test_every_algorithm_declares_a_source_what_it_finds_and_parameters() -> None:
    assert len(MODELS) >= 6
    for name, model in MODELS.items():
        assert model.source, name
        assert model.finds is not type(None), name
        assert parameters(model) or settings(model), name


@pytest.mark.parametrize("angle", [0.0, 0.3, 0.9, 1.4])
@pytest.mark.parametrize("offset", [-0.4, 0.0, 0.3])
def test_sub_pixel_edges_lie_on_the_edge(angle: float, offset: float) -> None:
    found = SubpixelEdges().run(step(angle, offset)).points
    across = (found[:, 0] - SIZE / 2) * np.cos(angle) + (found[:, 1] - SIZE / 2) * np.sin(angle) - offset
    assert len(found) > 0.8 * SIZE
    # the slope is a Gaussian up to the pixels' sampling of its blur; the image's border adds the largest of these
    assert np.abs(across).max() < 0.01
    assert abs(across.mean()) < 0.002


def test_canny_is_one_pixel_wide_and_silent_on_a_ramp() -> None:
    found = Canny().run(step(0.0, 0.2)).points
    assert len(np.unique(found[:, 1])) == len(found) == SIZE - 4  # one a row, none in the two outer rows
    assert not len(Canny(high=20.0).run((X * 0.5).astype(np.float32)).points)


def test_a_circle_gauge_finds_middle_and_radius_from_off_its_place() -> None:
    true = Circle((47.3, 46.8), 21.4)
    found = CircleGauge(reach=6.0).run(disc(true.middle, true.radius), Circle((49.0, 45.5), 21.4))
    assert found is not None
    assert np.hypot(found.middle[0] - 47.3, found.middle[1] - 46.8) < 0.02
    # an edge blurred by s on a circle of radius r seems s²/(2 r) = 0.015 px (0.04 px with the gauge's own blur) inside
    assert abs(found.radius - 21.4) < 0.06


def test_a_circle_through_points_on_an_arc_is_their_own() -> None:
    t = np.linspace(0.2, 1.7, 25)
    found = fit_circle(np.stack([10 + 7 * np.cos(t), -3 + 7 * np.sin(t)], -1))
    assert found.middle == pytest.approx((10, -3), abs=1e-6)
    assert found.radius == pytest.approx(7, abs=1e-6)


def test_a_line_gauge_finds_the_line_and_leaves_out_a_blemish() -> None:
    angle, offset = 0.25, 0.35
    image = step(angle, offset)
    image[30:36, 40:60] = 40  # hides a part of the edge
    along = np.array([-np.sin(angle), np.cos(angle)])
    middle = np.array([SIZE / 2, SIZE / 2]) + offset * np.array([np.cos(angle), np.sin(angle)])
    true = Line(tuple(middle - 30 * along), tuple(middle + 30 * along))
    near = Line(tuple(np.add(true.start, (1.2, 0))), tuple(np.add(true.end, (1.2, 0))))
    found = LineGauge().run(image, near)
    assert found is not None
    assert np.abs(found.across(np.array([true.start, true.end]))).max() < 0.06


def test_gauges_find_nothing_where_nothing_is() -> None:
    flat = np.full((SIZE, SIZE), 80.0, np.float32)
    assert CircleGauge().run(flat, Circle((48, 48), 20)) is None
    assert LineGauge().run(flat, Line((20, 48), (70, 48))) is None
    assert TemplateMatch().run(flat, Pattern(disc((12.0, 12.0), 6)[:24, :24], (48, 48))) is None


def test_a_template_is_found_to_a_tenth_of_a_pixel_and_within_reach_alone() -> None:
    pattern = disc((12.0, 11.0), 6)[:24, :24]
    image = disc((50.3, 44.8), 6)
    found = TemplateMatch().run(image, Pattern(pattern, (45.0, 45.0)))
    assert found is not None
    # the template's own middle is (11.5, 11.5), its disc's (12, 11)
    assert np.add(found.middle, (0.5, -0.5)) == pytest.approx((50.3, 44.8), abs=0.1)
    assert TemplateMatch(reach=5.0).run(image, Pattern(pattern, (25.0, 45.0))) is None


def test_blobs_are_what_differs_from_its_surroundings() -> None:
    image = np.full((SIZE, SIZE), 100.0, np.float32) + X.astype(np.float32) * 0.5
    image[20:28, 20:28] += 60
    image[60:66, 60:72] -= 60
    image[80, 10] += 60  # a single pixel
    both = ThresholdBlobs(area=12.0, sigma=0.5).run(image).labels
    assert both.max() == 2
    assert ThresholdBlobs(area=12.0, sigma=0.5, polarity=1).run(image).labels[60:66, 60:72].max() == 0
    assert ThresholdBlobs(area=12.0, sigma=0.5, polarity=-1).run(image).labels[20:28, 20:28].max() == 0


def test_an_unknown_algorithm_is_told_with_what_was_meant() -> None:
    with pytest.raises(BrightfieldError, match='Did you mean "canny"'):
        algorithm("cany")
    assert algorithm("circle-gauge") is CircleGauge
