"""The plan of captures: margins in closed form, and on a plain plate what has to be captured to tell offsets."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.gap.capture_plan import ALL, ENOUGH, NONE, SEVERITY, CapturePlan, Margins, capture_plan
from analysis.gap.judgement.attribution import CATALOGUED
from analysis.gap.renderers import renderer
from analysis.gap.terms.base import NUISANCE, Term
from composer.cli import main
from interchange.formats import images
from interchange.formats.captures import read
from interchange.formats.document import open_scene
from interchange.problems import BrightfieldError

PLATE = """#usda 1.0
(defaultPrim = "World"
metersPerUnit = 0.001
upAxis = "Z")
def Xform "World" {
  def Mesh "plate" {
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-60, -45, 0), (60, -45, 0), (60, 45, 0), (-60, 45, 0)]
    uniform token subdivisionScheme = "none"
  }
  def SphereLight "Left" {
    float inputs:intensity = 36
    bool inputs:normalize = 1
    float inputs:radius = 1
    double3 xformOp:translate = (-120, 0, 200)
    uniform token[] xformOpOrder = ["xformOp:translate"]
  }
  def SphereLight "Right" {
    float inputs:intensity = 36
    bool inputs:normalize = 1
    float inputs:radius = 1
    double3 xformOp:translate = (120, 0, 200)
    uniform token[] xformOpOrder = ["xformOp:translate"]
  }
  def Camera "Camera" {
    float focalLength = 160
    float horizontalAperture = 48
    float verticalAperture = 36
    custom int2 sensor:resolution = (80, 60)
    custom int sensor:bitDepth = 12
    custom float sensor:blackLevel = 64
    custom float sensor:fullWell = 10500
    custom float sensor:responsivity = 90
    custom float sensor:readNoise = 7
    double3 xformOp:translate = (0, 0, 400)
    uniform token[] xformOpOrder = ["xformOp:translate"]
  }
}
"""


def _terms(causes: Sequence[str], spike: float) -> list[Term]:
    return [Term(c, "", f"p{i}", "1", spike, lambda s: None) for i, c in enumerate(causes)]


def test_the_margin_is_what_no_rival_and_no_tolerance_can_imitate() -> None:
    """Against least squares: x_i less its projection on the rival, with the tolerances' covariance as noise."""
    rng = np.random.default_rng(5)
    X = rng.standard_normal((60, 3))
    X[:, 1] += 0.9 * X[:, 0]
    spike, signal = 0.01, 1e4
    margins = Margins(_terms("abc", spike), X.T @ X, signal)
    found = dict(zip(margins.pairs, margins.of(X.T @ X), strict=True))
    size = SEVERITY * np.sqrt(signal) / np.linalg.norm(X[:, 0])
    V = np.eye(60) + spike**2 * np.outer(X[:, 2], X[:, 2])
    W = np.linalg.inv(V)

    def margin(rival: np.ndarray) -> float:
        x = X[:, 0]
        rest = x @ W @ x - (x @ W @ rival) ** 2 / (rival @ W @ rival)
        return 0.5 * size**2 * rest

    assert found[("a", ""), ("b", "")] == pytest.approx(margin(X[:, 1]), rel=1e-3)
    assert found[("a", ""), ("b", "")] < found[("a", ""), ("c", "")] < found[("a", ""), None]


def test_pairs_that_are_told_apart_are_as_they_were_and_others_as_without() -> None:
    """Two of four effects look nearly alike."""
    X = np.random.default_rng(6).standard_normal((2000, 4))
    X[:, 3] = X[:, 0] + 0.5 * X[:, 3]
    margins = Margins(_terms(["a", "b", "c", "d"], 0.01), X.T @ X, 6e5)
    known, more = margins.of(0.5 * X.T @ X), margins.of(X.T @ X)
    told = known >= ENOUGH
    assert 0 < told.sum() < len(told)
    assert (more >= known * (1 - 1e-9)).all()  # more captures take nothing from a margin
    assert margins.of(X.T @ X, known) == pytest.approx(np.where(told, known, more))


def test_what_looks_alike_has_no_margin() -> None:
    x = np.random.default_rng(5).standard_normal((60, 1))
    X = np.hstack([x, 2 * x])
    margins = Margins(_terms("ab", 0.01), X.T @ X, 1e4)
    found = dict(zip(margins.pairs, margins.of(X.T @ X), strict=True))
    assert found[("a", ""), ("b", "")] == pytest.approx(0, abs=1e-3)
    assert found[("a", ""), None] > 0.1


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("plan") / "plate.usda"
    path.write_text(PLATE)
    return path


@pytest.fixture(scope="module")
def plan(scene: Path) -> CapturePlan:
    with renderer("realtime", 4, reflected=False) as (render, settings):
        return capture_plan(open_scene(scene), render, settings, scene.parent / "cache", most=6)


def test_a_plain_plate_needs_more_than_one_exposure(plan: CapturePlan) -> None:
    """On an even plate a black level, glare and a lamp look alike in one image (GAP: an exposure or the dark tells)."""
    chosen = [p.candidate for p in plan.captures]
    assert 3 <= len(chosen) <= 6
    assert len({(c.lighting, c.exposure) for c in chosen}) == len(chosen)
    assert any(c.lighting != ALL or c.stops for c in chosen)
    offsets = {"black_level", "veiling_glare"}
    early = {frozenset((x.effect[0], x.rival[0])) for p in plan.captures for x in p.separates if x.rival}
    left = {frozenset((x.effect[0], x.rival[0])) for x in plan.confusable if x.rival}
    assert frozenset(offsets) in early - left
    assert all(x.margin < ENOUGH for x in plan.confusable)
    assert plan.told + len(plan.confusable) == plan.pairs
    assert sum(p.repeats for p in plan.captures) == len(chosen) + 3


def test_a_second_way_of_an_effect_and_what_calibration_leaves_are_no_rivals() -> None:
    X = np.random.default_rng(5).standard_normal((60, 3))
    a, b, c = _terms(["a", "b", NUISANCE], 0.01)
    assert Margins([a, replace(b, form=True), c], X.T @ X, 1e4).pairs == [(("a", ""), None)]


def test_a_plan_is_about_effects(plan: CapturePlan) -> None:
    pairs = [*plan.confusable, *(x for p in plan.captures for x in p.separates)]
    named = {cause for x in pairs for cause in (x.effect, x.rival) if cause is not None}
    assert {name for name, _ in named} <= CATALOGUED


def test_the_dark_tells_at_two_exposures(scene: Path) -> None:
    """A dark current from a black level, and either from the ambient light."""
    with renderer("realtime", 4, reflected=False) as (render, settings):
        whole = capture_plan(open_scene(scene), render, settings, scene.parent / "cache", most=99)
    assert len({p.candidate.exposure for p in whole.captures if p.candidate.lighting == NONE}) >= 2


def test_the_skeleton_is_a_captures_file_once_images_are_there(
    scene: Path, plan: CapturePlan, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "rig"
    words = ["capture-plan", str(scene), "--out", str(out), "--most", "6", "--cache", str(tmp_path / "cache")]
    assert main(words) == 0
    assert "pairs of effects are told apart" in capsys.readouterr().out
    data = json.loads((out / "captures.json").read_text())
    for entry in data["captures"]:
        images.write(out / entry["image"], np.full((60, 80, 3), 500, np.uint16))
    captures = read(out / "captures.json")
    document = open_scene(captures.scene)
    for capture in captures.captures:
        lit = document.scene(capture.time)
        assert lit.camera(capture.camera).world_from_camera[2, 3] == pytest.approx(0.4)
    lamps = [tuple(x.name for x in document.scene(c.time).lights if x.is_on) for c in captures.captures]
    said = [p.candidate.lamps for p in plan.captures for _ in range(p.repeats)]
    assert set(lamps) == set(said)
    assert open_scene(scene).scene(0).lights[0].intensity == pytest.approx(
        (9.0, 9.0, 9.0)
    )  # it was not touched


def test_nobody_waits_for_a_lamp_that_is_too_weak(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "weak.usda").write_text(PLATE.replace("inputs:intensity = 36", "inputs:intensity = 0.02"))
    words = ["capture-plan", str(tmp_path / "weak.usda"), "--out", str(tmp_path / "rig"), "--most", "3"]
    assert main([*words, "--cache", str(tmp_path / "cache")]) == 0
    assert "% of the highest DN, and more than 10 s are not planned for" in capsys.readouterr().out
    exposures = [c["exposure"] for c in json.loads((tmp_path / "rig/captures.json").read_text())["captures"]]
    assert max(exposures) == 10


def test_a_scene_without_lamps_has_no_plan(tmp_path: Path) -> None:
    (tmp_path / "dark.usda").write_text(PLATE.replace("inputs:intensity = 36", "inputs:intensity = 0"))
    with (
        renderer("realtime", 4, reflected=False) as (render, settings),
        pytest.raises(BrightfieldError, match="lamp that is on"),
    ):
        capture_plan(open_scene(tmp_path / "dark.usda"), render, settings, tmp_path / "cache")
