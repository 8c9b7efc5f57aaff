"""Terms that must be rendered, against renderings of the changed scene; bench of 128 x 96 px."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.gap.conditions import Condition, conditions
from analysis.gap.knot_terms import knot_terms
from analysis.gap.knots import MANY, SPOTS, Knots
from analysis.gap.radiance import render_all
from analysis.gap.state import State
from analysis.gap.terms import Term
from interchange.camera import Camera
from interchange.captures import Tolerances
from interchange.effects.anisotropy import Anisotropy
from interchange.effects.base import Effect
from interchange.effects.geometry import Geometry
from interchange.effects.gloss import Gloss
from interchange.effects.light_size import LightSize
from interchange.effects.shadow import Shadow
from interchange.formats import captures as captures_file
from interchange.formats import images
from interchange.formats.document import open_scene
from interchange.image import Image
from interchange.scene import Scene
from realtime.renderers.rasterizer import Rasterizer

BENCH = Path(__file__).parents[2] / "assets/bench_sample/scene.usda"
WIDTH, HEIGHT = 128, 96
SHOTS = ((0, "Camera0"), (6, "Camera0"), (16, "Camera1"))
METAL, BRACKET, LED = "/World/Materials/metal", "/World/bracket", "/World/LED0"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("knots")
    (folder / "scene.usda").write_text(BENCH.read_text().replace("(480, 360)", f"({WIDTH}, {HEIGHT})"))
    for time, _ in SHOTS:
        images.write(folder / f"{time}.png", np.zeros((HEIGHT, WIDTH, 3), np.uint16))
    entries = [
        {"image": f"{time}.png", "camera": f"/World/{camera}", "time": time, "exposure": 1.0}
        for time, camera in SHOTS
    ]
    (folder / "captures.json").write_text(json.dumps({"scene": "scene.usda", "captures": entries}))
    return folder


@pytest.fixture(scope="module")
def rasterizer() -> Iterator[Rasterizer]:
    with Rasterizer() as rasterizer:
        yield rasterizer


@pytest.fixture(scope="module")
def found(folder: Path, rasterizer: Rasterizer) -> list[Condition]:
    """Two lamps of the bench's six."""

    def render(scene: Scene, camera: Camera, passes: Sequence[str], per_light: bool) -> Image:
        return rasterizer.render(scene, camera, passes, per_light, SPOTS)

    bare = conditions(captures_file.read(folder / "captures.json"), open_scene(folder / "scene.usda"))
    bare = [replace(c, scene=replace(c.scene, lights=c.scene.lights[0:3:2])) for c in bare]
    views = [(c.scene, c.camera) for c in bare]
    shown = render_all(views, render, {"renderer": "rasterizer", "samples": SPOTS}, folder / "cache")
    return [replace(c, rendered=r) for c, r in zip(bare, shown, strict=True)]


@pytest.fixture(scope="module")
def knots(folder: Path, rasterizer: Rasterizer) -> Knots:
    return Knots(folder / "cache", lambda: rasterizer)


@pytest.fixture(scope="module")
def terms(found: list[Condition], knots: Knots) -> dict[tuple[str, str, str], Term]:
    return {t.key: t for t in knot_terms(found, Tolerances(), knots)}


def _real(
    condition: Condition, rasterizer: Rasterizer, effect: Effect, target: str, spots: int
) -> np.ndarray:
    """(H, W, C) DN that the effect changes, by rendering the condition's own scene anew."""
    scene = effect.on_scene(condition.scene, target)
    before, after = (
        rasterizer.render(s, condition.camera, samples=spots).pixels for s in (condition.scene, scene)
    )
    return State(condition).per_radiance * (after - before)


CASES = [
    (("light_size", "", "spread"), LightSize(6.0), 6.0, 0.5),
    (("light_size", LED, "spread"), LightSize(6.0), 6.0, 0.5),
    (("gloss", METAL, "width"), Gloss(width=1.05), 0.05, 0.15),
    (("gloss", METAL, "level"), Gloss(level=1.05), 0.05, 0.01),
    (("anisotropy", METAL, "ratio"), Anisotropy(1.1), 0.1, 0.08),
    (("geometry", BRACKET, "scale"), Geometry(1.02), 0.02, 0.5),
    (("shadow", "", "share"), Shadow(0.3), 0.3, 0.01),
    (("shadow", LED, "share"), Shadow(0.3), 0.3, 0.01),
]


@pytest.mark.parametrize(("key", "effect", "theta", "miss"), CASES, ids=lambda x: str(x)[:40])
def test_a_term_predicts_a_new_rendering(key, effect, theta, miss, found, terms, rasterizer) -> None:
    """In amount within 12 %, and pixel by pixel within ``miss`` of the change's rms. Steps differ: of a gloss half of
    their difference is left; penumbrae and outlines move by parts of a pixel."""
    state = State(found[1])
    real = _real(found[1], rasterizer, effect, key[1], 2 * (MANY if key[0] == "light_size" else SPOTS))
    said = theta * np.asarray(terms[key].field(state))
    assert np.abs(real).max() > 1
    assert np.sqrt(np.mean((said - real) ** 2)) < miss * np.sqrt(np.mean(real**2))
    assert float((said * real).sum() / (real**2).sum()) == pytest.approx(1, abs=0.12)


def test_a_lamp_that_is_off_shows_nothing(
    found: list[Condition], terms: dict[tuple[str, str, str], Term]
) -> None:
    states = [State(c) for c in found]
    assert terms["shadow", LED, "share"].field(states[0]) is not None
    assert terms["shadow", LED, "share"].field(states[2]) is None


def test_all_lamps_alike_are_the_sum_of_each(
    found: list[Condition], terms: dict[tuple[str, str, str], Term]
) -> None:
    state = State(found[1])
    alone = [t.field(state) for k, t in terms.items() if k[0] == "light_size" and k[1]]
    assert len(alone) == 2
    assert sum(alone) == pytest.approx(terms["light_size", "", "spread"].field(state), abs=1e-2)


def test_what_was_rendered_is_read_from_disk(
    folder: Path, found: list[Condition], terms: dict[tuple[str, str, str], Term], knots: Knots
) -> None:
    for term in terms.values():
        term.field(State(found[0]))
    assert knots.rendered

    def never() -> Rasterizer:
        raise AssertionError("what the cache holds must not be rendered")

    again = Knots(folder / "cache", never)
    for term in knot_terms(found, Tolerances(), again):
        a, b = term.field(State(found[0])), terms[term.key].field(State(found[0]))
        assert (a is None and b is None) or np.array_equal(a, b)
    assert again.rendered == 0
