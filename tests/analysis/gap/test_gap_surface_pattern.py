"""What other views show of a material's pattern: plate of the bench, two cameras, 112 x 84 px."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from analysis.gap.compared.conditions import Condition
from analysis.gap.compared.laid import laid, parts
from analysis.gap.compared.state import State
from analysis.gap.corrected.painted import patterns
from analysis.gap.search.model import Model
from analysis.gap.terms.left import LAMP
from analysis.gap.terms.material import GRID, SEEN_TWICE, SHARED, material_terms
from analysis.gap.terms.surface_pattern import SIZES, pattern_fields
from interchange.captures import Tolerances
from interchange.effects.texture import WAVES, painted
from realtime.renderers.rasterizer import Rasterizer
from tests.analysis.gap.bench import Rig, of_their_own

BASE = "/World/Materials/base"
HEIGHT = 0.2


@pytest.fixture(scope="module")
def plain(rig: Rig) -> list[Condition]:
    return of_their_own(rig, 5)[0]


def wave(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.sin(x) * np.sin(y + 0.3 * x)


def on_the_surface(c: Condition) -> np.ndarray:
    """(H, W): nine waves along the plate and across it."""
    out = np.zeros(c.mean.shape[:2])
    for _, own, u, v in laid(State(c), BASE):
        out[own] = wave(9 * 2 * np.pi * u, 9 * 2 * np.pi * v)
    return out


def on_the_image(c: Condition) -> np.ndarray:
    """(H, W): about as fine."""
    row, column = np.indices(c.mean.shape[:2])
    shown = c.shown.passes["material_id"] == c.shown.scene.material_names.index(BASE)
    return np.where(shown, wave(0.6 * column, 0.6 * row), 0)


def having(c: Condition, pattern: np.ndarray) -> Condition:
    return replace(c, mean=c.mean + HEIGHT * pattern[..., None] * State(c).signal)


def left(captured: list[Condition], held: list[Condition]) -> float:
    """Of the plate's mean square residual in ``held``, what the best weights, told from ``captured``, leave."""
    fields = pattern_fields(captured, [BASE])[BASE]
    if not fields:
        return 1.0

    def system(c: Condition) -> tuple[np.ndarray, np.ndarray]:
        state = State(c)
        own = state.usable & (c.shown.passes["material_id"] == c.shown.scene.material_names.index(BASE))
        found = [field(state) for field in fields]
        columns = [np.zeros(int(own.sum()) * 3) if x is None else x[own].reshape(-1) for x in found]
        return np.stack(columns, axis=1), state.residual[own].reshape(-1)

    X, r = (np.concatenate(both) for both in zip(*map(system, captured), strict=True))
    weights = np.linalg.lstsq(X, r, rcond=None)[0]
    X, r = (np.concatenate(both) for both in zip(*map(system, held), strict=True))
    return float(np.mean((r - X @ weights) ** 2) / np.mean(r**2))


def test_a_fine_pattern_is_told_by_the_other_camera(plain: list[Condition]) -> None:
    """In captures that were not looked at, too. Nine waves on the plate are some 6 px each: most of them is told."""
    found = [having(c, on_the_surface(c)) for c in plain if c.lamps]
    assert len({c.camera.name for c in found}) == 2
    assert left(found, found) < 0.5
    assert left(found[1:], found[:1]) < 0.5


def test_what_stays_with_the_image_is_none(plain: list[Condition]) -> None:
    found = [having(c, on_the_image(c)) for c in plain if c.lamps]
    assert left(found, found) > 0.9


def test_noise_has_none(plain: list[Condition]) -> None:
    """Detail of a view is told without its own noise, which therefore stays: weights take off what chance does."""
    found = [c for c in plain if c.lamps]
    assert left(found, found) > 0.99


def test_of_the_coarsest_detail_lamps_leave_what_their_flat_field_may(plain: list[Condition]) -> None:
    found = [having(c, on_the_surface(c)) for c in plain if c.lamps]
    target = f"{BASE}{SEEN_TWICE}"
    terms = [t for t in material_terms(found, Tolerances(flat_field=0.01)) if t.target == target]
    assert [t.spike for t in terms] == pytest.approx([SHARED] * (len(SIZES) - 2) + [LAMP * 0.01])


def test_one_view_has_none(plain: list[Condition]) -> None:
    first = plain[0].camera.name
    found = [having(c, on_the_surface(c)) for c in plain if c.lamps and c.camera.name == first]
    assert pattern_fields(found, [BASE])[BASE] == []


def test_one_camera_sees_two_where_the_body_moves(plain: list[Condition]) -> None:
    first = next(c for c in plain if c.lamps)
    scene = first.shown.scene
    turned = np.diag([-1.0, -1.0, 1.0, 1.0])
    bodies = tuple(
        replace(b, world_from_body=turned @ b.world_from_body) if b.material.name == BASE else b
        for b in scene.bodies
    )
    there = replace(first, rendered=replace(first.shown, scene=replace(scene, bodies=bodies)))
    assert pattern_fields([having(first, on_the_surface(first)), there], [BASE])[BASE]


def test_sizes_have_the_rms_of_one(plain: list[Condition]) -> None:
    """Where they are known, over the plate as both cameras see it: their pixels are not the texels, 20 %."""
    found = [having(c, on_the_surface(c)) for c in plain if c.lamps]
    fields = pattern_fields(found, [BASE])[BASE]
    assert len(fields) == len(SIZES) - 1
    for field in fields:
        seen = []
        for c in found:
            share = field(State(c)) / np.maximum(State(c).signal, 1e-9)
            seen.append(share[share != 0])
        assert np.sqrt(np.mean(np.concatenate(seen) ** 2)) == pytest.approx(1, rel=0.2)


def test_what_is_seen_of_a_body(plain: list[Condition]) -> None:
    """As many texels as pixels where it is seen largest, more or less: its corner is cut by the image."""
    part = parts(plain, [BASE])[BASE]["/World/base"]
    assert (part.low >= 0).all()
    assert (part.high <= 1).all()
    assert (part.high > part.low).all()
    pixels = max(len(u) for c in plain for _, _, u, _ in laid(State(c), BASE))
    assert 0.5 < np.prod(part.shape) / pixels < 3


@pytest.mark.parametrize("kind", ["waves", "places"])
def test_what_was_fitted_is_laid_out_and_drawn_again(
    plain: list[Condition], rasterizer: Rasterizer, kind: str
) -> None:
    """The scene with the pattern on it, rendered anew, has the change that the terms say; some 10 % of it are lost to
    texels, and at edges of the plate, which terms know and textures do not."""
    lit = [c for c in plain if c.lamps]
    terms = tuple(t for t in material_terms(lit, Tolerances()) if t.cause == "texture")
    causes = {
        "waves": [("texture", BASE)],
        "places": [("texture", f"{BASE}, in places")],
    }[kind]
    own = [t.candidate in causes for t in terms]
    assert sum(own) == (len(WAVES) if kind == "waves" else GRID[0] * GRID[1])
    theta = np.where(own, 0.1 * np.cos(0.4 * np.arange(len(terms))), 0.0)
    model = Model(terms, theta, np.zeros(len(terms)))
    fitted = SimpleNamespace(terms=terms, after=model, best=SimpleNamespace(causes=causes))
    found = patterns(lit, fitted)  # type: ignore[arg-type]
    assert list(found) == [BASE]
    c = lit[0]
    scene = painted(c.scene, BASE, found[BASE])
    new, old = (rasterizer.render(s, c.camera, samples=64).pixels for s in (scene, c.scene))
    said = model.simulated(c) - c.simulated().dn
    drawn = State(c).per_radiance * (new - old)
    assert np.sqrt(np.mean((drawn - said) ** 2)) < 0.25 * np.sqrt(np.mean(said**2))
    assert float((drawn * said).sum() / (said**2).sum()) == pytest.approx(1, abs=0.1)


@pytest.mark.filterwarnings("error")
def test_what_leaves_nothing_has_no_pattern(plain: list[Condition]) -> None:
    """As of a plan of captures, which are what the scene shows: it ended in NaN, and a warning on the screen."""
    names = list(dict.fromkeys(b.material.name for c in plain for b in c.shown.scene.bodies))
    exact = [replace(c, mean=c.simulated().dn) for c in plain]
    assert all(fields == [] for fields in pattern_fields(exact, names).values())
