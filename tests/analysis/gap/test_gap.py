"""The diagnosis on a small bench, rendered by the rasteriser: from captures.json to the verdict."""

import json
from dataclasses import replace

import numpy as np
import pytest

from analysis.gap.compared.state import State
from analysis.gap.diagnose import Diagnosed
from analysis.gap.diagnosis import record
from analysis.gap.judgement.attribution import Attribution, claimed, lacking, without
from analysis.gap.judgement.calling import confirmed, no_worse
from analysis.gap.judgement.tolerated import within_tolerances
from analysis.gap.light import knots
from analysis.gap.light.radiance import render_all
from analysis.gap.measures.shrinkage import yardstick
from analysis.gap.renderers import renderer
from analysis.gap.report.page import write_report
from analysis.gap.search.model import Model
from analysis.gap.sensor.expected import mean_dn, noise_variance
from analysis.gap.terms.geometry import geometry_terms
from analysis.gap.terms.light import shaded
from composer.cli import main
from interchange.captures import Tolerances
from interchange.effects.black_level import BlackLevel
from interchange.effects.principal_point import PrincipalPoint
from interchange.effects.vignetting import Vignetting
from interchange.exposure import expose
from interchange.formats import captures as captures_file
from interchange.formats.document import open_scene
from interchange.image import Image
from tests.analysis.gap.bench import SAMPLES, TIMES, Rig, camera_at

TRUTH = Vignetting(a2=-0.22, a4=0.04)
ASIDE = PrincipalPoint(cx=0.08, cy=-0.05)  # px: what calibration may be off by, on every edge


@pytest.fixture(scope="module")
def null(rig: Rig) -> Diagnosed:
    return rig.diagnosed(rig.captured("null", ()), "null")


@pytest.fixture(scope="module")
def vignetting(rig: Rig) -> Diagnosed:
    return rig.diagnosed(rig.captured("vignetting", [TRUTH, ASIDE]), "vignetting")


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
    beside = record(replace(vignetting.diagnosis, unknown=(("fixed to the image", 0.7),)))
    assert (beside["verdict"], beside["unknown"]) == (
        "effects+unknown",
        [{"name": "fixed to the image", "probability": 0.7}],
    )


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


def test_held_out_captures_tell_what_the_others_leave_open_of_the_calibration(vignetting: Diagnosed) -> None:
    """A lamp that is 1 % brighter, twice its tolerance, in captures that were held out, where those that were fitted to
    tell nothing; the vignetting stays."""
    fitted, held = vignetting.fit, vignetting.held_out
    (lamp,) = fitted.evidence.members["light_intensity", "/World/LED0"]
    theta = fitted.after.theta.copy()
    theta[lamp] += 0.01
    as_it_is = fitted.after.simulations(held)
    change = np.subtract(replace(fitted.after, theta=theta).simulations(held), as_it_is)
    shown = [replace(c, mean=c.mean + more) for c, more in zip(held, change, strict=True)]
    blind = replace(
        fitted,
        parts=tuple(replace(p, G=np.zeros_like(p.G), b=np.zeros_like(p.b)) for p in fitted.parts),
    )
    told = within_tolerances(blind, shown, fitted.best.causes)
    left = change - np.subtract(told.simulations(held), as_it_is)
    assert np.mean(left**2) < 0.1 * np.mean(change**2)
    assert 0.3 < told.theta[lamp] / 0.01 < 1  # the rest are gains of the captures' own
    assert within_tolerances(fitted, shown, fitted.best.causes).theta[lamp] < told.theta[lamp]
    own = fitted.evidence.members[fitted.best.causes[0]]
    assert told.theta[own] == pytest.approx(fitted.after.theta[own], rel=1e-4)
    none = within_tolerances(blind, shown, ()).theta[own]
    assert np.abs(none / fitted.evidence.spike[own]).max() < 3  # a vignetting is no error of the calibration


def test_some_of_the_effects_are_simulated_as_a_model_of_them_is(vignetting: Diagnosed) -> None:
    """All of them exactly, none of them within a twentieth of what they change."""
    fitted, held = vignetting.fit, vignetting.held_out
    by = yardstick(held, vignetting.simulations.after, 1.0)
    taken = Attribution({"vignetting": fitted.best.causes}, {}, {})
    for carried, out in (({"vignetting"}, ()), (set(), fitted.best.causes)):
        want = by.chi2(lacking(fitted, out).simulations(held)) ** 0.5
        assert claimed(fitted, held, by, taken, carried) == pytest.approx(want)
    for c in held:
        all_of_them = fitted.after.simulated(c)
        assert lacking(fitted, []).simulated(c) == pytest.approx(all_of_them, abs=1e-3)
        none = without(fitted, fitted.best.causes).simulated(c)
        change = float(np.abs(all_of_them - none).max())
        assert lacking(fitted, fitted.best.causes).simulated(c) == pytest.approx(none, abs=0.05 * change)


def test_before_is_told_beside_after_as_it_would_be_alone(vignetting: Diagnosed) -> None:
    """What a vignetting of 5 % does to calibration's errors of 0.5 % is a hundredth of what it does to the image."""
    after, causes = vignetting.fit.after, vignetting.fit.best.causes
    own = vignetting.fit.before
    assert own.beside is after or not own.theta.any()  # the file as written, where that fits better
    before = lacking(vignetting.fit, causes)
    assert before.beside is after
    for c in vignetting.held_out:
        alone = replace(before, beside=None).simulated(c)
        change = float(np.sqrt(np.mean((after.simulated(c) - alone) ** 2)))
        assert float(np.sqrt(np.mean((before.simulated(c) - alone) ** 2))) < 0.02 * change


def test_without_the_effects_calibrations_errors_are_left(vignetting: Diagnosed) -> None:
    """Those are what verification puts onto the corrected scene, whatever ``before`` is."""
    fitted, zero = vignetting.fit, np.zeros(len(vignetting.fit.terms))
    own = [t.candidate in fitted.best.causes for t in fitted.terms]
    errors = replace(
        fitted.after, theta=np.where(own, 0, fitted.after.theta), at=np.where(own, 0, fitted.after.at)
    )
    assert np.abs(errors.theta).max() > 0
    for before in (replace(fitted.before, theta=zero, at=zero), fitted.before):
        for c in vignetting.held_out:
            left = without(replace(fitted, before=before), fitted.best.causes).simulated(c)
            assert left == pytest.approx(errors.simulated(c), abs=1e-3)
            assert np.abs(left - c.simulated().dn).max() > 0.1


def test_what_is_before_is_the_file_as_written_where_that_fits_better(vignetting: Diagnosed) -> None:
    """A black level 30 DN off fits worse: then nothing of calibration's errors is told without the effects."""
    fit, fitted_to = vignetting.fit, [c for c in vignetting.conditions if not c.held_out]
    assert no_worse(fitted_to, fit) is fit
    level = [t.key == ("black_level", "", "black_level") for t in fit.terms]
    assert sum(level) == 1
    off = replace(fit, before=replace(fit.before, theta=fit.before.theta + np.where(level, 30.0, 0.0)))
    nothing = no_worse(fitted_to, off)
    assert not nothing.before.theta.any()
    assert nothing.after is fit.after


def test_the_corrected_scene_has_the_effect(rig: Rig, vignetting: Diagnosed) -> None:
    path = rig.folder / "vignetting" / vignetting.diagnosis.corrected_scene
    effect = vignetting.diagnosis.effects[0]
    for camera in open_scene(path).scene(0).cameras:
        assert camera.lens.vignetting == pytest.approx([effect.parameters[a].value for a in ("a2", "a4")])
    assert rig.document.scene(0).camera("Camera0").lens.vignetting == (0.0, 0.0)


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


def test_the_report_stands_alone(rig: Rig, vignetting: Diagnosed) -> None:
    captures = captures_file.read(rig.folder / "vignetting" / "captures.json")
    write_report(rig.folder / "report.html", vignetting, captures)
    text = (rig.folder / "report.html").read_text()
    assert "The gap comes from vignetting" in text
    assert text.count("data:image/png;base64,") >= 4
    assert "http" not in text.replace("http-equiv", "")


def test_expected_dn_are_the_mean_of_many_frames(rig: Rig) -> None:
    scene = rig.document.scene(0)
    camera = scene.camera("Camera0")
    camera = replace(camera, sensor=replace(camera.sensor, prnu=0.0))
    image = Image(rig.truth[0].radiance(scene) * 0.5)
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


def test_light_adds_up_and_is_rendered_once(rig: Rig) -> None:
    assert rig.truth[0] is rig.truth[3]  # one arrangement
    alone = rig.truth[0].radiance(rig.document.scene(0)) + rig.truth[2].radiance(rig.document.scene(4))
    assert alone == pytest.approx(
        rig.truth[3].lamps["/World/LED0"] + rig.truth[3].lamps["/World/LED4"], rel=1e-5
    )
    everything = sum(rig.truth[3].lamps.values()) + rig.truth[3].rest
    assert rig.truth[3].radiance(rig.document.scene(6)) == pytest.approx(everything, rel=1e-5)

    def never(*given: object) -> Image:
        raise AssertionError("what the cache holds must not be rendered")

    with renderer("realtime", SAMPLES) as (_, settings):
        views = [(s, s.camera(camera_at(s.time))) for s in map(rig.document.scene, TIMES)]
        again = render_all(views, never, settings, rig.cache)
    assert np.array_equal(again[0].lamps["/World/LED0"], rig.truth[0].lamps["/World/LED0"])


@pytest.fixture(scope="module")
def shown(rig: Rig, null: Diagnosed) -> list[State]:
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


def test_the_command_writes_all_three(
    rig: Rig, null: Diagnosed, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(knots, "FINER", 1)  # as the rig's, whose renderings are read
    monkeypatch.setattr(knots, "MANY", SAMPLES)
    data = json.loads((rig.folder / "null" / "captures.json").read_text())
    data["captures"] = [data["captures"][i] for i in (0, 2, 3, 7)]
    (rig.folder / "null" / "few.json").write_text(json.dumps(data))
    words = [
        "diagnose",
        str(rig.folder / "null" / "few.json"),
        "--render",
        "realtime",
        "--samples",
        str(SAMPLES),
    ]
    out = rig.folder / "command"
    assert main([*words, "--out", str(out), "--cache", str(rig.cache)]) == 0
    assert json.loads((out / "diagnosis.json").read_text())["verdict"] == "none"
    assert {p.name for p in out.iterdir()} == {"diagnosis.json", "report.html", "scene_corrected.usda"}
    assert "No unmodelled effect was found" in capsys.readouterr().out
