"""Lamps and cameras that are off alike: what they are called, and what a unit of it does."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from analysis.gap.compared.state import State
from analysis.gap.evidence.hypotheses import best_first
from analysis.gap.evidence.likelihood import Evidence
from analysis.gap.light.knots import MANY, Knots
from analysis.gap.search.search import Search
from analysis.gap.terms.geometry import _principal_points
from analysis.gap.terms.knot import knot_terms
from analysis.gap.terms.light import light_terms, shaded
from analysis.gap.terms.mounts import ALL, lamps_of, on_one_mount
from analysis.gap.terms.normal_equations import NormalEquations
from interchange.captures import Tolerances
from interchange.effects.light_position import LightPosition

SHOTS = {0: "Camera0", 2: "Camera0", 6: "Camera0", 16: "Camera1"}
MOVED = LightPosition(x=-4.0, y=6.0, z=5.0)  # mm


def test_lamps_of_a_scene_are_one_mount_and_those_under_a_prim_another() -> None:
    ring = [f"/World/Ring/LED{k}" for k in range(3)]
    lamps = [*ring, "/World/Bar/A", "/World/Bar/B", "/World/Spot"]
    assert set(on_one_mount(lamps)) == {"", "/World/Ring", "/World/Bar"}
    assert lamps_of(lamps, "/World/Ring") == ring
    assert lamps_of(lamps, "") == lamps
    assert lamps_of(lamps, "/World/Spot") == ["/World/Spot"]


def test_one_lamp_has_no_mount_but_its_own() -> None:
    assert on_one_mount(["/World/Spot"]) == []
    assert on_one_mount(["/World/Ring/A", "/World/Ring/B"]) == [""]


@pytest.fixture(scope="module")
def found(tmp_path_factory, small_bench):
    return small_bench(tmp_path_factory.mktemp("mounts"), SHOTS, 32)


@pytest.fixture(scope="module")
def knots(kept, rasterizer) -> Knots:
    return Knots(kept, lambda: rasterizer)


@pytest.mark.parametrize("axis", "xyz")
def test_what_all_lamps_do_is_the_sum_of_what_each_does(found, knots, axis) -> None:
    """Light adds up; with and without shadows that are drawn."""
    for terms in (knot_terms(found, Tolerances(), knots), shaded(found, Tolerances())):
        own = {t.target: t for t in terms if (t.cause, t.parameter) == ("light_position", axis)}
        state = State(found[2])
        parts = [x for n, t in own.items() if n and (x := t.field(state)) is not None]
        assert len(parts) == 2
        assert own[""].field(state) == pytest.approx(np.sum(parts, axis=0), abs=1e-4 * np.abs(parts).max())
        assert own[""].form
        assert not any(t.form for n, t in own.items() if n)


def test_where_all_lamps_stand_elsewhere_each_is_told_from_there(found, knots, rasterizer) -> None:
    """A lamp's column at the place where all stand, against two renderings around it."""
    lamp = next(n for n in found[0].lamps)
    terms = {t.key: t for t in knot_terms(found, Tolerances(), knots)}
    there = State(found[0], scene=((MOVED, ""),), knots=knots)
    column = terms["light_position", lamp, "x"].field(there)
    further = replace(MOVED, x=MOVED.x + 2.0)
    images = [
        rasterizer.render(e.on_scene(found[0].scene, lamp), found[0].camera, samples=4 * MANY).pixels
        for e in (further, MOVED)
    ]
    assert len(found[0].lamps) == 1
    real = State(found[0]).per_radiance * np.subtract(*images) / 2.0
    assert np.sqrt(np.mean((column - real) ** 2)) < 0.3 * np.sqrt(np.mean(real**2))


@pytest.mark.slow
def test_all_lamps_that_moved_alike_are_one_cause(found, knots, rasterizer) -> None:
    rng = np.random.default_rng(3)
    captured = []
    for c in found:
        image = rasterizer.render(MOVED.on_scene(c.scene, ""), c.camera, samples=4 * MANY).pixels
        model = State(c)
        dn = model.simulation.dn + model.per_radiance * (image - model.radiance)
        captured.append(
            replace(c, mean=dn + np.sqrt(model.simulation.temporal) * rng.standard_normal(dn.shape))
        )
    terms = tuple(t for t in knot_terms(captured, Tolerances(), knots) if t.cause == "light_position")
    lights = tuple(t for t in light_terms(captured, Tolerances()) if not t.generic)
    search = Search(captured, (*terms, *lights), knots, lambda what, share: None)
    first = search.stand(np.zeros(search.q), {}, "", {})
    there = search.gone_on(first, "")
    assert there.best.causes == (("light_position", ""),)
    theta = there.evidence.theta(there.best)
    for t, x in zip(search.terms, theta[: search.q], strict=True):
        if t.candidate == ("light_position", ""):
            assert x == pytest.approx(getattr(MOVED, t.parameter), abs=0.5)


def test_principal_points_of_all_cameras_are_off_alike() -> None:
    """Half a pixel, as conventions differ, moves every image by as much; and none stands beside one of its own."""
    cameras = [SimpleNamespace(camera=SimpleNamespace(name=n)) for n in "ab"]
    terms = _principal_points(cameras, 0.03)
    grid = np.meshgrid(np.arange(4.0), np.arange(3.0))
    flows = {
        t.key[1:]: [t.flow(SimpleNamespace(camera=c.camera, grid=grid)) is not None for c in cameras]
        for t in terms
    }
    assert flows[ALL, "cx"] == flows[ALL, "cy"] == [True, True]
    assert flows["a", "cx"] == [True, False]
    assert [t.target for t in terms if t.form] == [ALL, ALL]
    assert not any(t.target == ALL for t in _principal_points(cameras[:1], 0.03))
    n = len(terms)
    e = NormalEquations(np.eye(n) * 1e6, np.full(n, 1e5), 1e5, 1e6, np.ones(n), 0.0, 1000)
    every = best_first(Evidence(e, terms))
    assert not any(("principal_point", ALL) in h.causes and len(h.causes) > 1 for h in every)
