"""Light by way of surfaces where lobes change: between knots, and in a term's DN; bench of 128 x 96 px.

The rasteriser stands for paths: a tenth of what a scene shows directly has met another surface first, so that what
changes directly changes by a tenth more on the way there.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.gap.compared.conditions import Condition
from analysis.gap.compared.state import State
from analysis.gap.light.knots import SPOTS, Knots
from analysis.gap.light.radiance import Paths, Rendered, render_all
from analysis.gap.light.reflections import STEPS, Reflections, Weighted, around
from analysis.gap.terms.base import Term
from analysis.gap.terms.knot import knot_terms
from interchange.camera import Camera
from interchange.captures import Tolerances
from interchange.effects.anisotropy import Anisotropy
from interchange.effects.base import Effect
from interchange.effects.gloss import Gloss
from interchange.effects.object_pose import ObjectPose
from interchange.image import Image
from interchange.scene import Scene
from realtime.renderers.rasterizer import Rasterizer

METAL, PLASTIC = "/World/Materials/metal", "/World/Materials/plastic"
SETTINGS = {"renderer": "a rasteriser with bounces", "indirect": True}
BOUNCED = 0.1
SHOTS = {0: "Camera0", 6: "Camera0", 16: "Camera1"}


@pytest.fixture(scope="module")
def traced(rasterizer: Rasterizer):
    def render(
        scene: Scene, camera: Camera, passes: Sequence[str], per_light: bool, parts: int, paths: Paths
    ) -> Image:
        wanted = [p for p in passes if p != "indirect"]
        image = rasterizer.render(scene, camera, wanted, per_light, SPOTS)
        if paths is Paths.REFLECTED:
            lamps = {k: v for k, v in image.passes.items() if k.startswith("light:")}
            image.passes.update({k.replace("light:", "indirect:"): BOUNCED * v for k, v in lamps.items()})
            render.times += 1
        return image

    render.times = 0
    return render


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("reflections")


@pytest.fixture(scope="module")
def condition(folder: Path, small_bench, traced) -> Condition:
    c = small_bench(folder, SHOTS, SPOTS)[1]
    (shown,) = render_all([(c.scene, c.camera)], traced, SETTINGS, folder / "traced")
    return replace(c, rendered=shown)


@pytest.fixture(scope="module")
def reflections(folder: Path, traced) -> Reflections:
    return Reflections(traced, SETTINGS, folder / "cache")


def _added(shown: Rendered, parts: Weighted) -> np.ndarray:
    size = shown.camera.sensor.resolution
    ones = {name: np.ones(3) for name in shown.lamps}
    return np.sum([share * change.radiance(ones, size) for share, change in parts], axis=0)


@pytest.mark.parametrize(
    ("x", "ends"), [(0, (0, 1)), (0.3, (0, 1)), (-0.3, (0, -1)), (1, (1, 2)), (-3, (-2, -4)), (1e4, (16, 32))]
)
def test_knots_are_each_twice_as_far(x: float, ends: tuple[int, int]) -> None:
    assert around(x) == ends


def test_at_a_knot_it_is_what_paths_have_there(condition, reflections, rasterizer) -> None:
    """A level is linear in the light that bounces once, as here: by its own value, whatever the knots, within what a
    grid three times coarser blurs (a tenth of the change's rms)."""
    shown = condition.shown
    for gloss in (Gloss(level=1.1), Gloss(level=1.3), Gloss(level=0.8), Gloss(level=0.25, width=1.4)):
        said = _added(shown, reflections.changes(shown, ((gloss, METAL),)))
        scenes = shown.scene, gloss.on_scene(shown.scene, METAL)
        before, after = (rasterizer.render(s, shown.camera, (), False, SPOTS).pixels for s in scenes)
        real = BOUNCED * (after - before)
        assert float((said * real).sum() / (real**2).sum()) == pytest.approx(1, abs=0.05)
        assert np.sqrt(np.mean((said - real) ** 2)) < 0.35 * np.sqrt(np.mean(real**2))


@pytest.mark.parametrize(
    ("effect", "parameter", "more"),
    [
        (Gloss(width=1.05), "width", Gloss(width=1.07)),
        (Gloss(width=1.44), "width", Gloss(width=1.46)),
        (Gloss(width=0.7, level=0.3), "width", Gloss(width=0.71, level=0.3)),
        (Gloss(width=0.7, level=0.3), "level", Gloss(width=0.7, level=0.31)),
        (Anisotropy(), "split", Anisotropy(split=0.01)),
        (Anisotropy(split=0.03, cross=0.02), "split", Anisotropy(split=0.031, cross=0.02)),
        (Anisotropy(split=-0.01, cross=0.02), "cross", Anisotropy(split=-0.01, cross=0.021)),
        (Anisotropy(ratio=1.2, diagonal=0.1), "diagonal", Anisotropy(ratio=1.2, diagonal=0.11)),
        (Anisotropy(ratio=1.2, diagonal=0.1), "ratio", Anisotropy(ratio=1.2 + 1e-4, diagonal=0.1)),
    ],
    ids=str,
)
def test_a_slope_is_the_change_of_changes(
    effect: Effect, parameter: str, more: Effect, condition, reflections
) -> None:
    """Exactly, up to the first knot and on one line between two."""
    shown = condition.shown
    here, there = (reflections.changes(shown, ((e, METAL),)) for e in (effect, more))
    step = getattr(more, parameter) - getattr(effect, parameter)
    slope = _added(shown, reflections.slope(shown, effect, METAL, parameter))
    difference = _added(shown, there) - (_added(shown, here) if here else 0.0)
    assert np.abs(slope).max() > 0
    assert step * slope == pytest.approx(difference, abs=2e-3 * np.abs(difference).max())


def test_a_grain_may_run_any_way(condition, reflections, rasterizer) -> None:
    """Between the ways that are traced, too: as a sum of the two beside it, which is 2 % more at most."""
    shown = condition.shown
    for split, cross in ((0.06, 0.0), (0.03, 0.05), (-0.02, 0.045), (-0.05, -0.03)):
        effect = Anisotropy(split=split, cross=cross)
        said = _added(shown, reflections.changes(shown, ((effect, METAL),)))
        scenes = shown.scene, effect.on_scene(shown.scene, METAL)
        before, after = (rasterizer.render(s, shown.camera, (), False, SPOTS).pixels for s in scenes)
        real = BOUNCED * (after - before)
        assert float((said * real).sum() / (real**2).sum()) == pytest.approx(1, abs=0.1)


def test_beyond_a_bound_the_last_knot_is_gone_on_from(condition, reflections) -> None:
    """A level is 0 at least: between the knots of -0.8 and -1.6 there is the first alone."""
    shown = condition.shown
    near = _added(shown, reflections.changes(shown, ((Gloss(level=0.2), METAL),)))
    said = _added(shown, reflections.changes(shown, ((Gloss(level=0.1), METAL),)))
    assert said == pytest.approx(near * 0.9 / 0.8, abs=1e-6 + 1e-3 * np.abs(near).max())


def test_what_moves_has_none_and_what_was_traced_is_kept(
    condition, reflections, folder: Path, traced
) -> None:
    shown = condition.shown
    assert reflections.changes(shown, ((ObjectPose(x=1.0), "/World/pin"),)) == ()
    told = _added(shown, reflections.changes(shown, ((Gloss(level=1.1), METAL),)))
    times = traced.times
    again = Reflections(traced, SETTINGS, folder / "cache")
    assert _added(shown, again.changes(shown, ((Gloss(level=1.1), METAL),))) == pytest.approx(told)
    assert traced.times == times


def test_a_term_has_the_light_by_way_of_surfaces(condition, folder: Path, rasterizer, reflections) -> None:
    """A tenth more than of a renderer that draws none, within what few spots and coarse edges leave."""
    plain = Knots(folder / "knots", lambda: rasterizer)
    both = Knots(folder / "knots", lambda: rasterizer, reflections)
    s = State(condition)
    for key in (("gloss", METAL, "level"), ("anisotropy", METAL, "split")):
        direct, more = (np.asarray(_term(condition, k, key).field(s)) for k in (plain, both))
        assert float((direct * (more - direct)).sum() / (direct**2).sum()) == pytest.approx(BOUNCED, rel=0.15)


def test_what_is_in_force_has_it_too(condition, folder: Path, rasterizer, reflections) -> None:
    gloss = Gloss(level=1.0 + 2 * STEPS["level"])
    plain, both = (
        State(condition, scene=((gloss, METAL),), knots=k).radiance
        for k in (
            Knots(folder / "knots", lambda: rasterizer),
            Knots(folder / "knots", lambda: rasterizer, reflections),
        )
    )
    weights = {n: float(w[0]) for n, w in condition.shown.weights(condition.scene).items()}
    size = condition.camera.sensor.resolution
    told = sum(
        share * change.radiance({n: np.full(3, w) for n, w in weights.items()}, size)
        for share, change in reflections.changes(condition.shown, ((gloss, METAL),))
    )
    assert np.abs(told).max() > 0
    assert both - plain == pytest.approx(told, abs=1e-3 * np.abs(told).max())


def _term(condition: Condition, knots: Knots, key: tuple[str, str, str]) -> Term:
    return next(t for t in knot_terms([condition], Tolerances(), knots) if t.key == key)
