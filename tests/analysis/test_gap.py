"""The diagnosis on a small bench, rendered by the rasteriser: from captures.json to the verdict."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd

from analysis.gap.attribution import Sets, confirmed, without
from analysis.gap.conditions import Condition, conditions
from analysis.gap.diagnose import Diagnosed, diagnose
from analysis.gap.diagnosis import record
from analysis.gap.expected import mean_dn, noise_variance
from analysis.gap.geometry_terms import geometry_terms
from analysis.gap.light_terms import shaded
from analysis.gap.model import Model
from analysis.gap.overlap import must_overlap, notes_on_files, shifts, with_files_bits
from analysis.gap.radiance import Rendered, render_all
from analysis.gap.renderers import renderer
from analysis.gap.report import write_report
from analysis.gap.shrinkage import yardstick
from analysis.gap.state import State
from composer.cli import main
from interchange.captures import Captures, Tolerances
from interchange.effects import Effect
from interchange.effects.black_level import BlackLevel
from interchange.effects.vignetting import Vignetting
from interchange.exposure import expose
from interchange.formats import captures as captures_file
from interchange.formats import images
from interchange.formats.document import Document, open_scene
from interchange.image import Image
from interchange.problems import BrightfieldError, FileError

BENCH = Path(__file__).parents[2] / "assets/bench_sample/scene.usda"
WIDTH, HEIGHT = 112, 84
TIMES = (0, 1, 4, 6, 7, 10, 12, 13, 15)
EXPOSURE = dict.fromkeys((6, 7, 13), 0.5) | {10: 0.25}
TRUTH = Vignetting(a2=-0.22, a4=0.04)


def _camera(time: float) -> str:
    return "/World/Camera0" if time < 13 else "/World/Camera1"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The bench with three of its six lamps."""
    folder = tmp_path_factory.mktemp("gap")
    stage = Usd.Stage.Open(str(BENCH))
    for lamp in ("LED2", "LED3", "LED5"):
        stage.RemovePrim(f"/World/{lamp}")
    text = stage.GetRootLayer().ExportToString()
    assert text.count("(480, 360)") == 2
    (folder / "scene.usda").write_text(text.replace("(480, 360)", f"({WIDTH}, {HEIGHT})"))
    return folder


@pytest.fixture(scope="module")
def document(folder: Path) -> Document:
    return open_scene(folder / "scene.usda")


@pytest.fixture(scope="module")
def truth(folder: Path, document: Document) -> list[Rendered]:
    """The diagnosis's own rendering: what is tested here is its statistics, not a renderer."""
    views = [(s, s.camera(_camera(s.time))) for s in map(document.scene, TIMES)]
    with renderer("realtime", 16) as (render, settings):
        return render_all(views, render, settings, folder / "cache")


def _capture(
    folder: Path, document: Document, truth: list[Rendered], name: str, effects: Sequence[Effect]
) -> Captures:
    rng = np.random.default_rng(3)
    entries = []
    (folder / name).mkdir(exist_ok=True)
    for time, shown in zip(TIMES, truth, strict=True):
        scene = document.scene(time)
        camera = scene.camera(_camera(time))
        camera = replace(camera, sensor=replace(camera.sensor, prnu=0.0))
        t_exp = EXPOSURE.get(time, 1.0)
        dn = expose(Image(shown.radiance(scene)), camera, t_exp, rng=rng, effects=effects).pixels
        file = folder / name / f"{time:02d}.png"
        images.write(file, dn.astype(np.uint16))
        entries.append({"image": file.name, "camera": camera.name, "time": time, "exposure": t_exp})
    path = folder / name / "captures.json"
    path.write_text(json.dumps({"scene": "../scene.usda", "captures": entries}))
    return captures_file.read(path)


def _diagnosed(folder: Path, document: Document, captures: Captures, out: str) -> Diagnosed:
    (folder / out).mkdir(exist_ok=True)
    with renderer("realtime", 16) as (render, settings):
        return diagnose(captures, document, render, settings, folder / "cache", folder / out, verify=True)


@pytest.fixture(scope="module")
def null(folder: Path, document: Document, truth: list[Rendered]) -> Diagnosed:
    return _diagnosed(folder, document, _capture(folder, document, truth, "null", ()), "null")


@pytest.fixture(scope="module")
def vignetting(folder: Path, document: Document, truth: list[Rendered]) -> Diagnosed:
    return _diagnosed(
        folder, document, _capture(folder, document, truth, "vignetting", [TRUTH]), "vignetting"
    )


def test_captures_that_are_what_the_scene_says_need_nothing(null: Diagnosed) -> None:
    d = null.diagnosis
    assert d.verdict == "none"
    assert d.gap.before == d.gap.after < 1.1
    assert d.over_declared == {}  # the captures' scene has no errors at all
    assert d.gap.noise_floor == pytest.approx(1, abs=0.03)  # two repeats of 100 x 75 px


def test_vignetting_is_found_and_closes_the_gap(vignetting: Diagnosed) -> None:
    d = vignetting.diagnosis
    assert d.verdict == "effects"
    (effect,) = d.effects
    assert effect.name == "vignetting"
    assert effect.probability > 0.95
    a2, a4 = effect.parameters["a2"], effect.parameters["a4"]
    assert a2.value == pytest.approx(TRUTH.a2, abs=4 * a2.sigma)
    assert a4.value == pytest.approx(TRUTH.a4, abs=4 * a4.sigma)
    assert a2.value + a4.value == pytest.approx(
        TRUTH.a2 + TRUTH.a4, abs=0.006
    )  # the corner, by two tolerances
    assert d.gap.explained > 0.9
    assert d.gap.ci95_before[0] < d.gap.before < d.gap.ci95_before[1]


@pytest.mark.parametrize("case", ["null", "vignetting"])
def test_shares_of_every_kind_add_up(case: str, request: pytest.FixtureRequest) -> None:
    where = request.getfixturevalue(case).diagnosis.where
    kinds = {s.kind for s in where.shares}
    assert kinds == {
        "capture", "channel", "material", "object", "light", "zone", "lamp", "frequency", "fixed to",
    }  # fmt: skip
    for kind in kinds:
        assert sum(s.share for s in where.of(kind)) == pytest.approx(1, abs=1e-12)
        assert where.of(kind)[-1].name == "noise"
        assert where.of(kind)[-1].share * where.total == pytest.approx(where.noise, rel=1e-9)


def test_the_file_is_as_the_contract_has_it(vignetting: Diagnosed) -> None:
    data = json.loads(json.dumps(record(vignetting.diagnosis), allow_nan=False))
    assert list(data)[:6] == ["verdict", "effects", "gap", "where", "corrected_scene", "seconds"]
    assert list(data["effects"][0])[:8] == [
        "name", "stage", "probability", "parameters", "rivals", "separate_by", "gap_without", "gap_with",
    ]  # fmt: skip
    assert list(data["effects"][0]["parameters"]["a2"]) == ["value", "sigma", "unit"]
    assert list(data["gap"])[:10] == [
        "unit", "before", "after", "noise_floor", "ci95_before", "ci95_after", "rmse_dn_before", "rmse_dn_after",
        "explained", "held_out",
    ]  # fmt: skip
    assert list(data["where"]["by_region"][0]) == ["kind", "name", "share"]
    assert data["effects"][0]["stage"] == "optics"


def test_held_out_captures_refute_what_makes_them_worse(vignetting: Diagnosed) -> None:
    """An exposure 5 % off beside the vignetting goes, the vignetting stays."""
    fitted, held = vignetting.fit, vignetting.held_out
    assert [c[0] for c in fitted.best.causes] == ["vignetting"]
    theta = fitted.after.theta.copy()
    theta[[i for i, t in enumerate(fitted.terms) if t.candidate == ("exposure", "")]] += 0.05
    both = replace(
        fitted.best, causes=(("exposure", ""), *fitted.best.causes), slabs=(0.1, *fitted.best.slabs)
    )
    wrong = replace(
        fitted,
        after=replace(fitted.after, theta=theta),
        hypotheses=(both, *fitted.hypotheses),
        probability={**fitted.probability, ("exposure", ""): 0.99},
    )
    by = yardstick(held, vignetting.simulations.after, 1.0)
    found = confirmed(wrong, held, by)
    assert found.best.causes == fitted.best.causes
    assert found.probability["exposure", ""] == 0
    assert found.refuted == (("exposure", ""),)
    assert by.chi2([found.after.simulated(c) for c in held]) == pytest.approx(
        by.chi2(vignetting.simulations.after), rel=1e-3
    )


def test_some_of_the_effects_are_simulated_as_a_model_of_them_is(vignetting: Diagnosed) -> None:
    """All of them exactly, none of them within a twentieth of what they change."""
    fitted, sets = vignetting.fit, Sets(vignetting.fit)
    for c in vignetting.held_out:
        all_of_them = fitted.after.simulated(c)
        assert sets.simulated([], c) == pytest.approx(all_of_them, abs=1e-3)
        none = without(fitted, fitted.best.causes).simulated(c)
        change = float(np.abs(all_of_them - none).max())
        assert sets.simulated(fitted.best.causes, c) == pytest.approx(none, abs=0.05 * change)


def test_without_the_effects_calibrations_errors_are_left(vignetting: Diagnosed) -> None:
    """Those are what verification puts onto the corrected scene, whatever ``before`` is."""
    fitted = vignetting.fit
    assert np.abs(fitted.after.theta).max() > 0
    zero = np.zeros(len(fitted.terms))
    written = replace(fitted, before=replace(fitted.before, theta=zero, at=zero))
    for c in vignetting.held_out:
        left = without(written, fitted.best.causes).simulated(c)
        assert left == pytest.approx(fitted.before.simulated(c), abs=1e-3)
        assert np.abs(left - c.simulated().dn).max() > 0.1


def test_the_corrected_scene_has_the_effect(folder: Path, document: Document, vignetting: Diagnosed) -> None:
    path = folder / "vignetting" / vignetting.diagnosis.corrected_scene
    effect = vignetting.diagnosis.effects[0]
    for camera in open_scene(path).scene(0).cameras:
        assert camera.lens.vignetting == pytest.approx([effect.parameters[a].value for a in ("a2", "a4")])
    assert document.scene(0).camera("Camera0").lens.vignetting == (0.0, 0.0)


def test_the_waterfall_adds_up(vignetting: Diagnosed) -> None:
    d = vignetting.diagnosis
    assert sum(s.chi2 for s in d.waterfall) == pytest.approx(d.gap.as_written**2, rel=1e-9)
    assert [s.kind for s in d.waterfall] == ["calibration", "effect", "rest", "noise"]
    (effect,) = d.effects
    assert effect.share * d.gap.before**2 == pytest.approx(d.gap.before**2 - d.gap.after**2, rel=1e-9)
    assert effect.gap_without == d.gap.before


def test_the_written_scene_rendered_anew_keeps_the_claim(vignetting: Diagnosed, null: Diagnosed) -> None:
    """Truth and diagnosis share a renderer, and the effect is one of the chain: what is left is single precision."""
    check = vignetting.diagnosis.verification
    assert check is not None
    assert check.holds
    assert check.sentence == ""
    assert check.rendered == pytest.approx(vignetting.diagnosis.gap.after, rel=0.02)
    assert check.as_written < 0.7 * vignetting.diagnosis.gap.as_written
    assert null.diagnosis.verification is None  # nothing was written that could be wrong


def test_edges_lie_where_the_simulation_has_them(null: Diagnosed) -> None:
    edges = null.diagnosis.edges
    assert edges is not None
    assert edges.after.count > 100
    assert edges.after.rms < 2 * edges.after.floor < 0.1  # px; one renderer for both


def test_the_report_stands_alone(folder: Path, vignetting: Diagnosed) -> None:
    captures = captures_file.read(folder / "vignetting" / "captures.json")
    write_report(folder / "report.html", vignetting, captures)
    text = (folder / "report.html").read_text()
    assert "The gap comes from vignetting" in text
    assert text.count("data:image/png;base64,") >= 4
    assert "http" not in text.replace("http-equiv", "")


def test_expected_dn_are_the_mean_of_many_frames(document: Document, truth: list[Rendered]) -> None:
    scene = document.scene(0)
    camera = scene.camera("Camera0")
    camera = replace(camera, sensor=replace(camera.sensor, prnu=0.0))
    image = Image(truth[0].radiance(scene) * 0.5)
    effects = [TRUTH, BlackLevel(70.0)]
    rng = np.random.default_rng(0)
    frames = np.stack([expose(image, camera, 1.0, rng=rng, effects=effects).pixels for _ in range(60)])
    mean = mean_dn(image, camera, effects)
    temporal, _ = noise_variance(mean, replace(camera, sensor=replace(camera.sensor, black_level=70.0)))
    z = (frames.mean(0) - mean) / np.sqrt(temporal / 60)
    bright = mean > 100  # 28,000 values: rms within 1 %, mean within 3 / sqrt(28,000)
    assert np.sqrt(np.mean(z[bright] ** 2)) == pytest.approx(1, abs=0.03)
    assert np.mean(z[bright]) == pytest.approx(0, abs=0.03)
    assert np.mean(frames.var(0, ddof=1)[bright] / temporal[bright]) == pytest.approx(1, abs=0.01)


def test_light_adds_up_and_is_rendered_once(folder: Path, document: Document, truth: list[Rendered]) -> None:
    assert truth[0] is truth[3]  # one arrangement
    alone = truth[0].radiance(document.scene(0)) + truth[2].radiance(document.scene(4))
    assert alone == pytest.approx(truth[3].lamps["/World/LED0"] + truth[3].lamps["/World/LED4"], rel=1e-5)
    everything = sum(truth[3].lamps.values()) + truth[3].rest
    assert truth[3].radiance(document.scene(6)) == pytest.approx(everything, rel=1e-5)

    def never(*given: object) -> Image:
        raise AssertionError("what the cache holds must not be rendered")

    with renderer("realtime", 16) as (_, settings):
        views = [(s, s.camera(_camera(s.time))) for s in map(document.scene, TIMES)]
        again = render_all(views, never, settings, folder / "cache")
    assert np.array_equal(again[0].lamps["/World/LED0"], truth[0].lamps["/World/LED0"])


@pytest.fixture(scope="module")
def shown(folder: Path, document: Document, null: Diagnosed) -> list[State]:
    return [State(c) for c in null.conditions]


@pytest.mark.parametrize("axis", range(3))
def test_a_lamp_that_moves_changes_what_its_terms_say(shown: list[State], axis: int) -> None:
    """Against differences of S ∝ n · d / r³, where the lamp does not graze."""
    state = shown[0]
    terms = {t.key: t for t in shaded([state.condition], Tolerances())}
    lamp = next(x for x in state.shown.scene.lights if x.name == "/World/LED0").world_from_light[:3, 3]

    def falls(at: np.ndarray) -> np.ndarray:
        d = at - state.position
        return np.sum(state.normal * d, axis=-1) / np.linalg.norm(d, axis=-1) ** 3

    h = 1e-3 * np.eye(3)[axis]
    with np.errstate(invalid="ignore"):  # where nothing is seen there is no normal
        slope = (falls(lamp + 1e-2 * h) - falls(lamp - 1e-2 * h)) / 2e-2 / falls(lamp)
    column = np.asarray(terms["light_position", "/World/LED0", "xyz"[axis]].field(state))
    d = lamp - state.position
    ok = np.sum(state.normal * d, axis=-1) > 0.1 * np.linalg.norm(d, axis=-1)
    expected = state.lamps["/World/LED0"] * slope[..., None]
    assert ok.sum() > 4000
    assert column[ok] == pytest.approx(expected[ok], rel=1e-3, abs=1e-3)


def test_poses_move_pixels_as_projection_does(shown: list[State]) -> None:
    state = shown[0]
    for term in geometry_terms([state.condition], Tolerances()):
        if term.cause != "camera_pose":
            continue
        assert term.flow is not None
        flow = np.stack(term.flow(state) or (), axis=-1)
        axis, h = "xyz".index(term.parameter[1]), 1e-4
        delta = np.eye(4)
        if term.parameter[0] == "t":
            delta[axis, 3] = 1e-3 * h
        else:
            u, v = [(1, 2), (2, 0), (0, 1)][axis]
            delta[u, v], delta[v, u] = -1e-3 * h, 1e-3 * h
        moved = replace(state.camera, world_from_camera=state.camera.world_from_camera @ np.linalg.inv(delta))
        exact = (moved.project(state.position) - state.camera.project(state.position)) / h
        assert flow == pytest.approx(exact, rel=1e-3, abs=1e-3)


def test_a_correction_of_the_chain_equals_its_effect(vignetting: Diagnosed) -> None:
    """The model with vignetting in the chain alone simulates what the camera with that effect gives."""
    fitted = vignetting.fit
    cause = np.array([t.cause == "vignetting" for t in fitted.terms])
    theta = np.where(cause, fitted.theta, 0.0)
    condition = vignetting.conditions[0]
    values = [p.value for p in vignetting.diagnosis.effects[0].parameters.values()]
    expected = condition.simulated([Vignetting(*values)]).dn
    assert Model(fitted.terms, theta, theta).simulated(condition) == pytest.approx(expected, abs=1e-2)


def _of(document: Document, truth: list[Rendered]) -> list[Rendered]:
    """One rendering a condition: times 6 and 7 are repeats."""
    return [r for time, r in zip(TIMES, truth, strict=True) if time != 7]


def test_captures_that_do_not_fit_the_scene_are_told_together(folder: Path, document: Document) -> None:
    path = folder / "wrong.json"
    images.write(folder / "small.png", np.zeros((5, 5, 3), np.uint16))
    images.write(folder / "bright.png", np.full((HEIGHT, WIDTH, 3), 60000, np.uint16))
    entry = {"time": 0, "exposure": 1}
    entries = [
        {**entry, "image": "small.png", "camera": "/World/Camera0"},
        {**entry, "image": "bright.png", "camera": "/World/Camera0"},
        {**entry, "image": "null/00.png", "camera": "/World/Camra0"},
    ]
    path.write_text(json.dumps({"scene": "scene.usda", "captures": entries}))
    with pytest.raises(FileError) as error:
        conditions(captures_file.read(path), document)
    said = str(error.value).splitlines()
    assert len(said) == 3
    assert "captures[0].image" in said[0]
    assert "112 x 84 px" in said[0]
    assert "4095" in said[1]
    assert 'Did you mean "/World/Camera0"' in said[2]


def test_a_camera_that_looks_elsewhere_is_named(
    folder: Path, document: Document, truth: list[Rendered]
) -> None:
    """Half an image further down stands for a grossly wrong pose; the other camera's captures are right."""
    found = _found(folder, document, truth)
    must_overlap(found)
    turned = [
        replace(c, mean=np.roll(c.mean, HEIGHT // 2, axis=0)) if c.camera.name == "/World/Camera1" else c
        for c in found
    ]
    with pytest.raises(BrightfieldError, match=r"those of /World/Camera1 \(correlation"):
        must_overlap(turned)


def _found(folder: Path, document: Document, truth: list[Rendered]) -> list[Condition]:
    found = conditions(_capture(folder, document, truth, "null", ()), document)
    return [replace(c, rendered=r) for c, r in zip(found, _of(document, truth), strict=True)]


def test_captures_that_lie_off_are_told(folder: Path, document: Document, truth: list[Rendered]) -> None:
    found = _found(folder, document, truth)
    assert shifts(found) == {}
    rolled = [replace(c, mean=np.roll(c.mean, (4, 3), (0, 1))) for c in found]
    assert shifts(rolled) == {
        name: pytest.approx(5, abs=0.3) for name in ("/World/Camera0", "/World/Camera1")
    }


def test_8_bit_images_are_compared_in_their_own_steps(
    folder: Path, document: Document, truth: list[Rendered]
) -> None:
    """The sensor's 4095 DN in 255: what differs is temporal noise and the rounding, 1/12 of a step squared."""
    captures = _capture(folder, document, truth, "null", ())
    eight = tuple(replace(c, pixels=np.rint(c.pixels * 255 / 4095), bits=8) for c in captures.captures)
    found = with_files_bits(conditions(replace(captures, captures=eight), document))
    found = [replace(c, rendered=r) for c, r in zip(found, _of(document, truth), strict=True)]
    for c in (c for c in found if c.lamps):
        model = c.simulated()
        assert model.top == 255
        ok = c.usable(model)[..., None] & (model.dn > 20)  # in the dark all values round alike
        z = (c.captures[0].pixels - model.dn)[ok] / np.sqrt(model.temporal[ok])
        assert np.sqrt(np.mean(z**2)) == pytest.approx(1, abs=0.1)
    first, second = notes_on_files(found)
    assert "a step is 16.1 DN" in first
    assert "processed" in second
    assert notes_on_files(_found(folder, document, truth)) == []


def test_captures_of_something_else_are_refused(folder: Path, document: Document, null: Diagnosed) -> None:
    captures = captures_file.read(folder / "null" / "captures.json")
    rng = np.random.default_rng(0)
    other = tuple(
        replace(c, pixels=rng.permuted(c.pixels.reshape(-1)).reshape(c.pixels.shape))
        for c in captures.captures
    )
    with pytest.raises(BrightfieldError, match="must show what the scene shows"):
        _diagnosed(folder, document, replace(captures, captures=other), "other")


def test_two_conditions_are_too_few(folder: Path, document: Document, null: Diagnosed) -> None:
    captures = captures_file.read(folder / "null" / "captures.json")
    with pytest.raises(BrightfieldError, match="three different conditions"):
        conditions(replace(captures, captures=captures.captures[:2]), document)


def test_the_command_writes_all_three(
    folder: Path, null: Diagnosed, capsys: pytest.CaptureFixture[str]
) -> None:
    data = json.loads((folder / "null" / "captures.json").read_text())
    data["captures"] = [data["captures"][i] for i in (0, 2, 3, 7)]
    (folder / "null" / "few.json").write_text(json.dumps(data))
    words = ["diagnose", str(folder / "null" / "few.json"), "--render", "realtime", "--samples", "16"]
    out = folder / "command"
    assert main([*words, "--out", str(out), "--cache", str(folder / "cache")]) == 0
    assert json.loads((out / "diagnosis.json").read_text())["verdict"] == "none"
    assert {p.name for p in out.iterdir()} == {"diagnosis.json", "report.html", "scene_corrected.usda"}
    assert "No unmodelled effect was found" in capsys.readouterr().out
