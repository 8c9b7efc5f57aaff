"""What no effect explains is named as unknown, with what it is fixed to; and nothing is blamed for it."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from analysis.gap.compared.conditions import Condition, conditions
from analysis.gap.compared.state import State
from analysis.gap.light.radiance import Rendered, render_all
from analysis.gap.renderers import renderer
from analysis.gap.search.fit import Fit, fit
from analysis.gap.terms.base import added
from analysis.gap.terms.generic import FOLLOWING, GATHERED, SMEAR, SPOT, WAVES, generic_terms
from analysis.gap.terms.normal_equations import BLOCK, equations, variance
from interchange.camera import Camera
from interchange.captures import Capture, Captures, Tolerances
from interchange.effects.base import Effect, Stage
from interchange.exposure import expose
from interchange.formats.document import Document, open_scene
from interchange.image import Image
from interchange.parameter import parameter
from tests.analysis.gap.bench import little_bench

WIDTH, HEIGHT = 112, 84
TIMES = (0, 1, 4, 6, 8, 10, 12)
EXPOSURE = {8: 0.25, 10: 0.5}


@dataclass(frozen=True)
class Pattern(Effect):
    """Something that the catalogue does not have: ``kind`` 1 a spot on the lens, 2 stripes, 3 light that columns gather
    as they are read out, for 0.01 s."""

    stage = Stage.OPTICS
    order = 5
    source = "this test"
    kind: float = parameter(0.0, "k", "1", 0, 3, "1 a spot, 2 stripes, 3 smear")

    def apply(self, image: Image, camera: Camera, rng: np.random.Generator | None) -> Image:
        row, column = np.indices(image.pixels.shape[:2])
        spot = 1 - 0.12 * np.exp(-((column - 70) ** 2 + (row - 30) ** 2) / 180)
        stripes = 1 + 0.03 * np.sin(2 * np.pi * row / 7)
        if self.kind == 3:
            smear = 0.01 / camera.t_exp * image.pixels.mean(axis=0, keepdims=True)
            return replace(image, pixels=(image.pixels + smear).astype(np.float32))
        factor = spot if self.kind == 1 else stripes
        return replace(image, pixels=(image.pixels * factor[..., None]).astype(np.float32))


@pytest.fixture(scope="module")
def document(tmp_path_factory: pytest.TempPathFactory) -> Document:
    file = tmp_path_factory.mktemp("unknown") / "scene.usda"
    little_bench(file, WIDTH, HEIGHT, without=("LED2", "LED3", "LED5"))
    return open_scene(file)


@pytest.fixture(scope="module")
def shown(document: Document, tmp_path_factory: pytest.TempPathFactory) -> list[Rendered]:
    views = [(s, s.camera("/World/Camera0")) for s in map(document.scene, TIMES)]
    with renderer("realtime", 16, reflected=False) as (render, settings):
        return render_all(views, render, settings, tmp_path_factory.mktemp("cache"))


def _conditions(document: Document, shown: list[Rendered], effects: list[Effect]) -> list[Condition]:
    rng = np.random.default_rng(5)
    captures = []
    for time, rendered in zip(TIMES, shown, strict=True):
        scene = document.scene(time)
        camera = scene.camera("/World/Camera0")
        camera = replace(camera, sensor=replace(camera.sensor, prnu=0.0))
        t_exp = EXPOSURE.get(time, 1.0)
        dn = expose(Image(rendered.radiance(scene)), camera, t_exp, rng=rng, effects=effects).pixels
        captures.append(Capture(f"{time}.png", camera.name, time, t_exp, dn.astype(np.float32)))
    found = conditions(Captures(document.path, document.path, tuple(captures)), document)
    return [replace(c, rendered=r) for c, r in zip(found, shown, strict=True)]


Fitted = Callable[[float], Fit]


@pytest.fixture(scope="module")
def fitted(document: Document, shown: list[Rendered]) -> Fitted:
    return lambda kind: fit(
        [c for c in _conditions(document, shown, [Pattern(kind)]) if not c.held_out], Tolerances()
    )


def test_a_spot_on_the_lens_is_unknown_and_nothing_is_blamed(fitted: Fitted) -> None:
    found = fitted(1)
    probability = {c[0]: p for c, p in found.probability.items() if p > 0.5}
    assert SPOT in probability
    named = [t.cause for t in found.terms if not t.generic]
    assert not set(probability) & set(named)
    index = list(found.evidence.members[SPOT, "/World/Camera0"])
    darkest = found.terms[index[int(np.argmin(found.theta[index]))]].parameter
    right, down = (float(x.split("%")[0]) for x in darkest.split(","))
    assert right == pytest.approx(100 * 70 / WIDTH, abs=9)  # a place is 8 x 11 % of the image
    assert down == pytest.approx(100 * 30 / HEIGHT, abs=12)


@pytest.mark.slow
def test_stripes_are_told_with_their_period(fitted: Fitted) -> None:
    causes = [c for c, p in fitted(2).probability.items() if p > 0.5]
    assert [c[0] for c in causes] == [WAVES]
    assert "period 7.0 px at 90 degrees" in causes[0][1]


@pytest.mark.slow
def test_light_that_columns_gather_is_no_glare(fitted: Fitted) -> None:
    found = fitted(3)
    assert [c for c, p in found.probability.items() if p > 0.5] == [(SMEAR[0], "")]
    index = found.evidence.members[SMEAR[0], ""]
    amount = {found.terms[i].parameter: found.theta[i] for i in index}
    assert amount[GATHERED] == pytest.approx(0.01, rel=0.15)  # two conditions of seven tell the two apart
    assert amount[FOLLOWING] == pytest.approx(0.0, abs=0.0015)


def test_smear_is_the_mean_of_a_line(document: Document, shown: list[Rendered]) -> None:
    """A share of it at every exposure, or what half the exposure has twice as much of, which is not less than nothing;
    rows as columns."""
    whole, half = (State(c) for c in _conditions(document, shown, []) if c.name in ("0.png", "10.png"))
    terms = generic_terms([whole.condition, half.condition], Tolerances())
    for axis, cause in SMEAR.items():
        field = {t.parameter: t.field for t in terms if t.cause == cause}
        for state, times in ((whole, 1.0), (half, 2.0)):
            light = np.maximum(state.simulation.dn - state.simulation.black, 0)
            mean = np.broadcast_to(light.mean(axis=axis, keepdims=True), light.shape)
            assert field[FOLLOWING](state) == pytest.approx(mean, rel=1e-5)
            assert field[GATHERED](state) == pytest.approx(times * mean, rel=1e-5)
        least = {t.parameter: (t.low, t.held) for t in terms if t.cause == cause}
        assert least == {FOLLOWING: (-np.inf, False), GATHERED: (0.0, True)}


def test_places_add_up_as_terms_with_fields_do(document: Document, shown: list[Rendered]) -> None:
    """Sparse blocks of the normal equations equal those of each place's own image."""
    condition = _conditions(document, shown, [])[3]
    terms = [t for t in generic_terms([condition], Tolerances()) if t.cause in (SPOT, "fixed to a capture")]
    state = State(condition, stride=2)
    found = equations(state, terms, np.zeros(len(terms)))
    mask = state.usable
    X = np.array([added(state, terms, e)[mask].reshape(-1) for e in np.eye(len(terms))])
    whole = equations(state, [], np.zeros(0))
    assert found.rr == pytest.approx(whole.rr, rel=1e-6)
    w = 1 / variance(state)[mask].reshape(-1).astype(np.float64)
    G = (X * w) @ X.T / (BLOCK**2 / 4)
    assert pytest.approx(G, rel=1e-4, abs=1e-6 * G.max()) == found.G  # single precision
    b = (X * w) @ state.residual[mask].reshape(-1) / (BLOCK**2 / 4)
    assert found.b == pytest.approx(b, rel=1e-3, abs=1e-4 * np.abs(b).max())
