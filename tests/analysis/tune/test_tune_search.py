"""Scores by hand-made results, searches with known optima, predictions that keep their promise."""

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from analysis.tune import session
from analysis.tune.algorithms.base import Algorithm
from analysis.tune.found import Blobs, Edges
from analysis.tune.frames import Frame
from analysis.tune.prediction import predict
from analysis.tune.robustness import dependence
from analysis.tune.scores import Rules, blob_scores, edge_scores, line_distance, score
from analysis.tune.search import aggregate, bounds_of, nearest_ideal, pareto, tune
from analysis.tune.truth import EdgeTruth, Truth
from analysis.tune.user_function import of_function
from interchange.camera import Camera, Sensor
from interchange.parameter import Parameter, parameter, setting
from interchange.problems import BrightfieldError

patient = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])  # of a busy machine
CAMERA = Camera(sensor=Sensor((100, 80)))


def vertical(x: float = 50.0) -> EdgeTruth:
    y = np.arange(5.0, 75.0)
    points = np.stack([np.full_like(y, x), y], -1)
    return EdgeTruth(points, np.tile([1.0, 0.0], (len(y), 1)), np.zeros(len(y), int))


def frame(image: np.ndarray | None = None, name: str = "a", **variation: float) -> Frame:
    grey = np.zeros((80, 100), np.float32) if image is None else image
    return Frame(name, grey, CAMERA, Truth(edges=vertical()), variation)


def test_edge_measures_of_a_hand_made_result() -> None:
    y = np.arange(5.0, 40.0)
    on = np.stack([np.full_like(y, 50.5), y], -1)  # half of the edge, half a pixel off
    stray = np.array([[55.0, 50.0], [56.0, 60.0]])  # in the region of interest, off the edge
    outside = np.array([[90.0, 10.0]])
    found = Edges(np.concatenate([on, stray, outside]))
    s = edge_scores(found, vertical(), frame(), Rules(roi=8.0, reach=2.0))
    assert s["edge_pixels"] == 37
    assert s["precision"] == pytest.approx(35 / 37)
    assert s["recall"] == pytest.approx(36 / 70, abs=1 / 70)  # points within 2 px of the last one count
    assert s["position"] == pytest.approx(0.5)
    assert edge_scores(Edges(np.zeros((0, 2))), vertical(), frame(), Rules())["f1"] == 0


def test_the_distance_from_the_regression_line_is_that_of_the_points_noise() -> None:
    rng = np.random.default_rng(0)
    t, sigma = np.linspace(0, 1, 4000), 0.3
    points = np.stack([10 + 70 * t, 20 + 30 * t], -1)
    points += sigma * rng.standard_normal(len(t))[:, None] * np.array([-30, 70]) / np.hypot(30, 70)
    lines = np.repeat([3, 8], 2000)
    # rms of N normal numbers: relative error 1/sqrt(2 N) = 1.1 %
    assert line_distance(points, lines, frame(), 8.0) == pytest.approx(sigma, rel=0.04)


def test_blob_measures_and_what_rejects_a_good_part() -> None:
    truth = np.zeros((40, 40), np.int32)
    truth[5:15, 5:15], truth[25:35, 25:35] = 1, 2
    found = np.zeros_like(truth)
    found[5:15, 6:16], found[0:3, 30:33] = 1, 2
    s = blob_scores(Blobs(found), truth, None)
    assert (s["precision"], s["recall"]) == (0.5, 0.5)
    assert s["position"] == pytest.approx(1.0)
    assert s["overlap"] == pytest.approx(90 / (200 + 10 + 9))
    assert s["false_accepts"] == 0
    assert np.isnan(s["false_rejects"])
    good = blob_scores(Blobs(found), np.zeros_like(truth), None)
    assert good["false_rejects"] == 1
    assert np.isnan(good["recall"])
    assert blob_scores(Blobs(np.zeros_like(truth)), truth, None)["false_accepts"] == 1


@dataclass(frozen=True)
class Bowl(Algorithm):
    """Finds the edge off by |a - 3| + |k - 2| px."""

    finds: ClassVar[type] = Edges
    source: ClassVar[str] = "made for this test"
    a: float = parameter(9.0, "a", "px", 0, 10, "offset")
    k: int = setting(5, "k", 0, 6, "another")

    def run(self, image: np.ndarray, near: Any = None) -> Edges:
        off = abs(self.a - 3) / 10 + abs(self.k - 2) / 5
        return Edges(vertical().points + np.array([off, 0]))


def test_the_search_finds_a_known_optimum_and_does_so_again() -> None:
    frames = [frame(name=str(k)) for k in range(2)]
    found = tune(Bowl, frames, ["position"], Rules(), trials=60, seed=3)
    assert found.trials[0].parameters == {"a": 9.0, "k": 5}
    assert found.best.k == 2  # type: ignore[attr-defined]
    assert abs(found.best.a - 3) < 0.5  # type: ignore[attr-defined]
    again = tune(Bowl, frames, ["position"], Rules(), trials=60, seed=3)
    assert [t.parameters for t in again.trials] == [t.parameters for t in found.trials]
    held = tune(Bowl, frames, ["position"], Rules(), trials=5, bounds={"k": (4, 4)})
    assert {t.parameters["k"] for t in held.trials} == {4}


def test_bounds_and_objectives_that_cannot_be_are_told() -> None:
    with pytest.raises(BrightfieldError, match=r"rise within \[0, 10\]"):
        bounds_of(Bowl, {"a": (-1, 3)})
    with pytest.raises(BrightfieldError, match='no parameter "b"'):
        bounds_of(Bowl, {"b": (0, 3)})
    with pytest.raises(BrightfieldError, match='Did you mean "position"'):
        tune(Bowl, [frame()], ["positon"], Rules(), trials=1)


losses = arrays(np.float64, st.tuples(st.integers(1, 12), st.just(2)), elements=st.integers(0, 5).map(float))


@patient
@given(losses)
def test_no_row_beats_the_front_and_every_other_row_is_beaten(values: np.ndarray) -> None:
    front = pareto(values)
    assert front
    for i, row in enumerate(values):
        better = (values <= row).all(axis=1) & (values < row).any(axis=1)
        if i in front:
            assert not better.any()
        else:
            assert better.any() or any((values[j] == row).all() for j in front)
    assert nearest_ideal(values, front) in front


def test_the_worst_share_of_frames_is_averaged_by_weight() -> None:
    values, weights = np.array([1.0, 0.0, 0.5, np.nan]), np.array([1.0, 1.0, 2.0, 9.0])
    assert aggregate(values, "f1", weights) == pytest.approx((1 + 0 + 1) / 4)
    assert aggregate(values, "f1", weights, 0.5) == pytest.approx((0 + 0.5) / 2)
    assert aggregate(values, "position", weights, 0.25) == 1.0


@pytest.mark.parametrize("n", [9, 19, 60])
def test_intervals_hold_as_often_as_they_say(n: int) -> None:
    rng = np.random.default_rng(n)
    held = []
    for _ in range(4000):
        drawn = rng.gamma(2.0, size=n + 1)
        p = predict("position", drawn[:n], coverage=0.8)
        held.append(p.holds(float(drawn[n])))
    # exact by exchangeability; 4000 draws tell it within 4 sqrt(0.16 / 4000) = 0.025
    assert np.mean(held) == pytest.approx(p.coverage, abs=0.025)
    assert p.coverage >= 0.8 - 2e-9 or n < 9


def test_rare_frames_sampled_often_predict_as_often_as_they_are() -> None:
    rng = np.random.default_rng(5)
    held = []
    for _ in range(3000):
        rare = rng.random(60) < 0.5  # one in ten in nature
        x = np.where(rare, 10.0, 0.0) + rng.random(60)
        weights = np.where(rare, 0.1 / 0.5, 0.9 / 0.5)
        p = predict("position", x, weights, 0.9)
        new = (10.0 if rng.random() < 0.1 else 0.0) + rng.random()
        held.append(p.holds(new))
    assert 0.88 < np.mean(held) < 0.97


def test_too_few_frames_predict_nothing() -> None:
    with pytest.raises(BrightfieldError, match="three frames"):
        predict("f1", np.array([0.5, np.nan, 0.7]))


def threshold(
    image: np.ndarray, level: Annotated[float, Parameter("t", "grey level", 1, 250, "bright")] = 80
) -> np.ndarray:
    return image > level


def nameless(image: np.ndarray, level: float = 3) -> np.ndarray:
    return image > level


def test_a_function_of_the_users_is_an_algorithm() -> None:
    model = of_function(threshold, "mine:threshold")
    assert model.finds is Blobs
    assert bounds_of(model)["level"].high == 250
    image = np.zeros((80, 100), np.float32)
    image[10:20, 10:20] = 90
    assert model().run(image).labels.max() == 1  # type: ignore[union-attr]
    assert model(level=95).run(image).labels.max() == 0  # type: ignore[call-arg, union-attr]
    with pytest.raises(BrightfieldError, match="annotated with its bounds"):
        of_function(nameless, "mine:nameless")


def test_a_session_states_before_it_asks_for_real_frames() -> None:
    order: list[str] = []
    frames = [frame(name=str(k), light=float(k)) for k in range(12)]

    def real() -> list[Frame]:
        order.append("real")
        return [frame(name="real")]

    s = session.run(
        Bowl, frames, trials=8, objectives=["position"], real=real, stated=lambda *_: order.append("stated")
    )
    assert order == ["stated", "real"]
    assert not set(s.tuned_on) & set(s.held_out)
    assert s.verified is not None
    assert s.verified.share["position"] == 1.0
    with pytest.raises(BrightfieldError, match="3 held-out frames"):
        session.run(Bowl, frames[:4], trials=1, objectives=["position"], real=real)
    rough = session.run(Bowl, frames, trials=2, objectives=["position"], registration=1.0)
    wide = {p.measure: p.high - p.low for p in rough.predictions}
    assert wide["position"] > {p.measure: p.high - p.low for p in s.predictions}["position"]


def test_what_a_score_depends_on_is_ranked() -> None:
    frames = [frame(name=str(k), light=float(k), other=float(k % 3)) for k in range(20)]
    assert next(iter(dependence(frames, np.arange(20.0) ** 2))) == "light"
    assert dependence(frames, np.arange(20.0) ** 2)["light"] == pytest.approx(1)


def test_a_frame_without_the_truth_that_is_needed_is_told() -> None:
    with pytest.raises(BrightfieldError, match="must tell the true edges"):
        score(Bowl(), Frame("a", np.zeros((80, 100), np.float32), CAMERA, Truth()), Rules())


def test_features_that_are_cut_off_by_the_border_are_not_judged() -> None:
    from analysis.tune.algorithms.circle_gauge import CircleGauge
    from analysis.tune.found import Circle

    row, column = np.mgrid[:80, :100].astype(float)
    image = (200 - 160 * (np.hypot(column - 50.3, row - 40.2) < 12)).astype(np.float32)
    whole, cut = Circle((50.3, 40.2), 12.0), Circle((96.0, 40.0), 12.0)
    both = Frame("a", image, CAMERA, Truth(circles={"whole": whole, "cut": cut}))
    alone = Frame("a", image, CAMERA, Truth(circles={"whole": whole}))
    assert score(CircleGauge(), both, Rules()) == score(CircleGauge(), alone, Rules())
    assert score(CircleGauge(), both, Rules())["position"] < 0.2
    nothing = score(CircleGauge(), Frame("a", image, CAMERA, Truth(circles={"cut": cut})), Rules())
    assert np.isnan(nothing["position"])


def test_a_tuning_that_was_broken_off_goes_on_as_if_it_had_not_been(tmp_path: Any) -> None:
    frames, file = [frame()], tmp_path / "trials.jsonl"
    whole = tune(Bowl, frames, ["f1", "position"], Rules(), 20, 1)

    class Killed(BaseException):
        pass

    def stopped(n: int, total: int) -> None:
        if n == 12:
            raise Killed

    with pytest.raises(Killed):
        tune(Bowl, frames, ["f1", "position"], Rules(), 20, 1, told=stopped, keep=file)
    again = tune(Bowl, frames, ["f1", "position"], Rules(), 20, 1, keep=file)
    assert again.resumed == 12
    assert [t.parameters for t in again.trials] == [t.parameters for t in whole.trials]
    assert [t.values for t in again.trials] == [t.values for t in whole.trials]
    assert (again.front, again.chosen) == (whole.front, whole.chosen)
    brighter = [frame(np.ones((80, 100), np.float32))]
    assert tune(Bowl, brighter, ["f1", "position"], Rules(), 20, 1, keep=file).resumed == 0
    assert tune(Bowl, frames, ["f1", "position"], Rules(reach=3), 20, 1, keep=file).resumed == 0
