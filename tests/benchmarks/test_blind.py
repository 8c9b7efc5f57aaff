"""The blind benchmark's own parts: what it imports, its effects, its severities, its seals, its scores. No engine."""

import ast
import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from benchmarks.blind import chain, proposals, severity, strata, tracing, truth
from benchmarks.blind.chain import Cause, Frame
from benchmarks.blind.errors import Tolerances, disturbed, draw, sheets
from benchmarks.blind.picture import write_png
from benchmarks.blind.run import first_of_each_scene, shared_out
from benchmarks.blind.scene_causes import RENDERED, changed
from benchmarks.blind.scenes import SCENES, scene
from benchmarks.blind.tracing import Quality
from benchmarks.blind.usd import write_scene

FOLDER = Path(__file__).parents[2] / "benchmarks/blind"
PRODUCT = {"analysis", "composer", "interchange", "offline", "realtime"}
FRAME = Frame((48, 36))


def _image(seed: int = 0) -> np.ndarray:
    """Bright and dark squares in three colours, e-."""
    rng = np.random.default_rng(seed)
    cells = rng.uniform(500, 6000, (6, 8, 3))
    return np.kron(cells, np.ones((6, 6, 1)))


@pytest.mark.parametrize("file", sorted(FOLDER.glob("*.py")), ids=lambda f: f.name)
def test_no_file_imports_the_product(file: Path):
    for node in ast.walk(ast.parse(file.read_text())):
        names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom):
            assert not node.level, "relative imports hide where they lead"
            names = [node.module or ""]
        if isinstance(node, ast.Call) and getattr(node.func, "id", getattr(node.func, "attr", "")) in (
            "__import__",
            "import_module",
        ):
            pytest.fail("an import that cannot be read")
        assert not {n.split(".")[0] for n in names} & PRODUCT


def test_what_a_lens_brings_into_the_frame_is_rendered():
    """An image that looks d px outside the sensor needs d px around it; one that looks inside no more than others."""
    setup = truth.Setup(scene("plate", (48, 36)), None, Quality(9, 1), 0, Path("unused"))  # type: ignore[arg-type]
    barrel = Cause(
        "lens_distortion", "division", 0.2, {"sign": -1.0}
    )  # r / (1 - 0.2 r²), r = 1 in the corner
    assert truth.margin(setup, [barrel]) == int(np.ceil((1 / 0.8 - 1) * 24)) + truth.SPARE
    assert truth.margin(setup, [replace(barrel, shape={"sign": 1.0})]) == tracing.MARGIN
    assert truth.margin(setup, []) == tracing.MARGIN
    assert truth.margin(setup, [barrel.at(0.999)]) == 18


def _proposed() -> list[tuple[str, str]]:
    everything = {**proposals.SEEN, **proposals.OUTSIDE}
    return [(name, scenes[0]) for name, scenes in everything.items()]


@pytest.mark.parametrize(("name", "where"), _proposed())
def test_a_proposal_has_a_form_that_acts_and_is_nothing_at_zero(name: str, where: str):
    bench = scene(where)
    for seed in range(3):
        p = proposals.propose(name, bench, np.random.default_rng(seed))
        assert p.cause.name == name
        assert 0 <= p.low < p.start < p.high
        json.dumps(p.cause.shape)  # labels must be able to hold it
        form = p.cause.form
        known = form in chain.FORMS or form in RENDERED or form in truth.LIGHT
        assert known, form
        if form in RENDERED:
            assert changed(bench, [p.cause]) is bench
            assert changed(bench, [p.cause.at(p.start)]) is not bench


def _chain(cause: Cause, E: np.ndarray) -> np.ndarray:
    """All stages but ``flow``, which has a test of its own."""
    e = chain.sensor([cause], chain.optics([cause], chain.fine([cause], E, 3), FRAME), 1.0, FRAME)
    return chain.readout([cause], e / 10500, FRAME) * 10500


IMAGE_FORMS = [f for f in (*chain.FINE, *chain.OPTICS, *chain.SENSOR, *chain.READOUT) if f != "steps"]


def _of_form(form: str) -> proposals.Proposal:
    bench = scene("rich")
    for name in (*proposals.SEEN, *proposals.OUTSIDE):
        for seed in range(6):
            p = proposals.propose(name, bench, np.random.default_rng(seed))
            if p.cause.form == form:
                return p
    raise KeyError(form)


@pytest.mark.parametrize("form", IMAGE_FORMS)
def test_an_image_form_grows_with_its_amplitude(form: str):
    p, E = _of_form(form), _image()
    change = [severity.severity([E], [_chain(p.cause.at(a * p.start), E)], 1e9) for a in (0.0, 0.5, 1.0, 2.0)]
    assert change[0] < 1e-12
    assert all(b > a for a, b in pairwise(change))


@pytest.mark.parametrize("form", ["pillbox", "two Gaussians", "smear"])
def test_blur_keeps_light_and_place(form: str):
    point = np.zeros((121, 121, 3), np.float32)
    point[60, 60] = 1.0
    p = _of_form(form)
    for a in (0.2, 1.0, 2.0):
        blurred = chain.fine([p.cause.at(a)], point, 3)
        assert np.allclose(blurred.sum(axis=(0, 1)), 1, atol=1e-4)
        r, c = np.meshgrid(np.arange(121), np.arange(121), indexing="ij")
        # half a fine pixel: a smear along a bent path is not symmetric, yet centred
        assert abs(float((blurred[..., 0] * r).sum()) - 60) < 0.5
        assert abs(float((blurred[..., 0] * c).sum()) - 60) < 0.5


def test_flow_moves_what_it_says():
    x, y = FRAME.grid
    u, v = chain.flow([Cause("principal_point", "offset", 0.1, {"angle": 0.0})], x, y, 1)
    assert np.allclose(u, x - 0.1)
    assert np.allclose(v, y)
    bent, _ = chain.flow([Cause("lens_distortion", "division", 0.1, {"sign": 1.0})], x, y, 1)
    assert np.allclose(bent, x / (1 + 0.1 * (x * x + y * y)))
    shape = {"red": 1.0, "blue": -1.0, "x": 0.0, "y": 0.0}
    colours = Cause("lateral_chromatic_aberration", "wedge colours", 0.01, shape)
    assert chain.flow([colours], x, y, 1)[0] is x
    assert np.abs(chain.flow([colours], x, y, 0)[0]).max() < np.abs(x).max()


def test_crosstalk_leaves_grey_and_the_well_is_never_overfull():
    grey = np.full((36, 48, 3), 3000.0)
    mixed = chain.sensor([Cause("color_crosstalk", "diffusion", 0.1, {"blue": 1.0})], grey, 1.0, FRAME)
    assert np.allclose(mixed, grey)
    well = Cause("saturation", "soft well", 0.5, {"well": 9000.0})
    assert chain.sensor([well], np.full((36, 48, 3), 1e6), 1.0, FRAME).max() <= 6000.0 + 1e-6


def test_the_solver_finds_a_severity_and_says_when_there_is_none():
    a, s = severity.solve(lambda a: 0.3 * a**1.7, 0.01, 1e-5, 10, 1.0, 1e-3)
    assert s == pytest.approx(0.01, rel=1e-3)
    assert a == pytest.approx((0.01 / 0.3) ** (1 / 1.7), rel=1e-3)
    with pytest.raises(severity.OutOfReach):
        severity.solve(lambda a: 0.001 * a, 0.01, 1e-5, 2, 1.0)


def test_severity_is_the_rms_of_the_change_over_the_mean():
    E = _image()
    assert severity.severity([E], [1.02 * E], 1e9) == pytest.approx(
        0.02 * np.sqrt(np.mean(E**2)) / np.mean(E)
    )
    hot = E.copy()
    hot[0, 0] = 1e8
    assert severity.severity([hot], [2 * hot - (hot < 1e7) * hot], 1e5) == 0.0


def test_a_stratum_without_causes_is_an_error() -> None:
    """It was a loop without an end: what is outside the catalogue is never as strong as 4 %."""
    with pytest.raises(ValueError, match="below 4 %"):
        strata.plans(0, 5, 1, (0.04, 0.08), {"outside": 4})


def test_strata_add_up_and_an_order_says_nothing():
    for n in (1, 30, 100, 640):
        assert sum(strata.counts(n).values()) == n
    found = strata.plans(400, 5, 2)
    assert len({p.case for p in found}) == 400
    assert [p.case for p in found] == sorted(p.case for p in found)
    assert found == strata.plans(400, 5, 2)
    assert {p.case for p in found}.isdisjoint({p.case for p in strata.plans(400, 6, 2)})
    for p in found:
        for name, _ in p.effects:
            seen = {**proposals.SEEN, **proposals.OUTSIDE}.get(name, strata.SCENES)
            assert p.scene in seen
    assert {p.scene for p in found} == set(strata.SCENES)
    assert {p.scene for p in strata.plans(60, 5, 2, scenes=("plate",))} == {"plate"}
    singles = [p.effects[0] for p in found if p.stratum == "single"]
    assert {n for n, _ in singles} == set(proposals.SEEN)
    for stronger, causes in (
        (1.0, set(proposals.SEEN) - set(strata.MOVES)),
        (strata.STRONGER, set(strata.MOVES)),
    ):
        assert {s for n, s in singles if n in causes} == {stronger * s for s in strata.SEVERITIES}


def test_what_one_camera_has_alone_is_in_its_captures_alone(monkeypatch: pytest.MonkeyPatch):
    """Both cameras' plans occur; the other camera's means stay as they were, and nothing is traced for it."""
    plans = strata.plans(20, 3, 1, shares={"camera": 20})
    assert {p.eye for p in plans} == {0, 1}
    assert {p.effects[0][0] for p in plans} == set(strata.OF_A_CAMERA)
    assert not any(p.eye for p in strata.plans(100, 3, 1))

    bench = scene("rich")
    flat = np.full((bench.size[1], bench.size[0], 3), 0.1)
    monkeypatch.setattr(truth._Pixels, "__call__", lambda self, shot, lamp: (flat, 0.0))
    drawn = draw(bench, Tolerances(), np.random.default_rng(0), 1.0)
    setup = truth.Setup(bench, drawn, Quality(4, 1), 0, Path())
    cause = proposals.propose("exposure", bench, np.random.default_rng(0)).cause.at(0.1)
    plain, everywhere = truth.means(setup, []), truth.means(setup, [cause])
    for eye in (0, 1):
        alone = truth.means(setup, [replace(cause, eye=eye)])
        for shot, a, b, c in zip(bench.shots, plain, everywhere, alone, strict=True):
            assert np.array_equal(c, b if shot.eye == eye else a)
            assert np.array_equal(a, b) == (not shot.lamps)


@pytest.mark.parametrize("name", SCENES)
def test_scene_files_say_the_scene_and_are_alike_each_time(name: str, tmp_path: Path):
    Usd = pytest.importorskip("pxr.Usd")
    from pxr import UsdGeom

    bench = scene(name)
    for which in "ab":
        (tmp_path / which).mkdir()
        write_scene(bench, tmp_path / which / "scene.usda")
    assert (tmp_path / "a/scene.usda").read_bytes() == (tmp_path / "b/scene.usda").read_bytes()
    stage = Usd.Stage.Open(str(tmp_path / "a/scene.usda"))
    camera = UsdGeom.Camera(stage.GetPrimAtPath("/World/Camera0"))
    matrix = np.array(camera.ComputeLocalToWorldTransform(0))
    assert np.allclose(matrix[3, :3], bench.eyes[0].position)
    assert np.allclose(matrix[:3, :3], bench.eyes[0].rotation, atol=1e-6)
    for part in bench.parts:
        assert UsdGeom.Mesh(stage.GetPrimAtPath(f"/World/{part.name}"))
    first, second = first_of_each_scene([tmp_path / "a", tmp_path / "b"])
    assert ([f.name for f in first], [s.name for s in second]) == (["a"], ["b"])


@pytest.mark.parametrize("name", SCENES)
def test_solids_face_outwards(name: str):
    for part in scene(name).parts:
        s = part.solid
        if s.normals is None:
            continue
        corners = s.vertices[s.faces]
        n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        big = np.linalg.norm(n, axis=1) > 1e-9
        n = n[big] / np.linalg.norm(n[big], axis=1, keepdims=True)
        # a facet leans from its smooth normal by less than half a step of 96
        assert np.einsum("ij,ikj->ik", n, s.normals[s.faces][big]).min() > np.cos(np.deg2rad(6))


def test_calibration_errors_stay_within_what_is_declared():
    bench, t = scene("rich", (48, 36)), Tolerances()
    errors = [draw(bench, t, np.random.default_rng(k)) for k in range(200)]
    lamps = np.concatenate([e.lamps - 1 for e in errors])
    assert 0.4 * t.light_intensity < lamps.std() < t.light_intensity
    assert np.abs(lamps).max() <= 2 * t.light_intensity
    assert np.std([e.black[0] for e in errors]) < t.black_level_dn
    assert np.mean([e.flat[0].std() for e in errors]) < t.flat_field
    moved = disturbed(bench, t, np.random.default_rng(0))
    halves = [k for k, part in enumerate(bench.parts) if part.name.startswith("board_")]
    assert [sheets(bench)[k] for k in halves] == [halves[0]] * 2  # one print: no gap opens between its tiles
    assert np.array_equal(*(moved.parts[k].poses[0] - bench.parts[k].poses[0] for k in halves))
    assert len(set(sheets(bench))) == len(bench.parts) - 1
    shift = [np.subtract(a.position, b.position) for a, b in zip(moved.lamps, bench.lamps, strict=True)]
    assert 0 < np.abs(shift).max() <= 2 * t.light_position_mm
    for a, b in zip(moved.eyes, bench.eyes, strict=True):
        R = np.array(a.rotation)
        assert np.allclose(R @ R.T, np.eye(3), atol=1e-9)
        turn = np.arccos(np.clip((np.trace(R @ np.array(b.rotation).T) - 1) / 2, -1, 1))
        assert turn * b.focal * 48 < 4 * t.registration_px


def test_pixels_are_means_of_fine_ones_and_move_as_the_mounting_does():
    bench = replace(scene("plate", (20, 16)), eyes=scene("plate").eyes)
    still = replace(draw(bench, Tolerances(), np.random.default_rng(0)), registration={0: np.zeros((2, 3))})
    setup = truth.Setup(bench, still, Quality(16, 3, 2), 0, Path("unused"))
    column = np.arange(3 * 24) / 3 + 1 / 6 - 2.5  # px of the sensor
    ramp = np.broadcast_to(column[None, :, None], (3 * 20, 3 * 24, 3)).astype(np.float32)
    plain = truth.through_lens(setup, [], ramp, 0)
    assert plain.shape == (16, 20, 3)
    assert np.allclose(plain[0, :, 0], np.arange(20), atol=1e-5)
    affine = np.zeros((2, 3))
    affine[0, 2] = 0.04
    moved = truth.through_lens(replace(setup, errors=replace(still, registration={0: affine})), [], ramp, 0)
    # remap has 32 steps a fine pixel: 0.01 px of the sensor
    assert np.allclose(moved - plain, 0.04, atol=0.012)


def test_captures_have_the_noise_of_their_electrons():
    bench = scene("plate", (64, 48))
    errors = draw(bench, Tolerances(), np.random.default_rng(1))
    setup = truth.Setup(bench, errors, Quality(), 0, Path("unused"))
    mean = np.full((48, 64, 3), 4000.0)
    rng = np.random.default_rng(2)
    frames = np.stack([truth.capture(setup, [], bench.shots[0], mean, rng).astype(float) for _ in range(24)])
    K = bench.sensor.K
    expected = K**2 * (4000 + 7.0**2) + 1 / 12
    # 24 frames of 9216 values: a variance is known to 0.3 %
    assert frames.var(axis=0, ddof=1).mean() == pytest.approx(expected, rel=0.02)
    assert frames.mean() == pytest.approx(64 + errors.black[0] + K * 4000, abs=0.5)
    dark = truth.capture(setup, [], bench.shots[0], mean * 0 - 100, rng)  # 39 DN lower, where no light is
    # 9216 values with 7 e- of read noise: their mean is known to 0.03 DN
    assert dark.mean() == pytest.approx(64 + errors.black[0] - K * 100, abs=0.15)
    noisy = Cause("sensor_noise", "read noise", 30.0)
    more = np.stack(
        [truth.capture(setup, [noisy], bench.shots[0], mean, rng).astype(float) for _ in range(24)]
    )
    assert more.var(axis=0, ddof=1).mean() == pytest.approx(K**2 * (4000 + 37.0**2) + 1 / 12, rel=0.02)


def test_a_beam_dims_light_off_the_axis_as_it_says():
    lamp = replace(
        scene("plate").lamps[0], position=(0.0, 0.0, 300.0), beam=(0.3, 0.0), axis=(0.0, 0.0, -1.0)
    )
    at = np.array([[[0.0, 0.0, 0.0], [0.3, 0.0, 0.0]]])  # below, and at 45 degrees
    found = {"direct": np.ones((1, 2, 3)), "indirect": np.ones((1, 2, 3))}
    shaped = truth._shaped(found, {"position": at}, lamp)
    slant = 1 + 0.3 * (np.sqrt(0.5) - 1)
    assert np.allclose(shaped["direct"][0, :, 0], [1.0, slant], atol=1e-6)
    assert np.allclose(shaped["indirect"], (1 + slant) / 2, atol=1e-6)


@pytest.mark.skipif(not tracing.llvm(), reason="Mitsuba's LLVM is not installed")
def test_the_engine_lights_a_matte_plate_as_the_inverse_square_law_says(tmp_path: Path):
    pytest.importorskip("mitsuba")
    bench = scene("plate", (24, 18))
    lamp, q = bench.lamps[0], Quality(16, 1, 0)
    found = tracing.layer(bench, bench.eyes[0], 0, lamp, q, 0, tmp_path)
    p = tracing.guide(bench, bench.eyes[0], 0, q, tmp_path)["position"]
    d = np.array(lamp.position) / 1e3 - p
    r = np.linalg.norm(d, axis=-1, keepdims=True)
    law = np.array(bench.matters[0].diffuse) / np.pi * lamp.intensity / 4 * d[..., 2:] / r**3
    # a pixel of 5 mm, 16 samples, and a lamp whose solid angle single precision knows to 0.1 %
    assert np.abs(found["direct"] / law - 1).max() < 5e-3
    assert abs(np.mean(found["direct"] / law) - 1) < 1e-3
    assert np.abs(found["indirect"]).max() < 1e-3 * law.max()
    again = tracing.layer(bench, bench.eyes[0], 0, lamp, q, 0, tmp_path)
    assert np.array_equal(again["direct"], found["direct"])


def test_pictures_are_png_of_16_bits(tmp_path: Path):
    import cv2

    pixels = np.random.default_rng(0).integers(0, 65536, (7, 5, 3)).astype(np.uint16)
    write_png(tmp_path / "a.png", pixels)
    read = cv2.imread(str(tmp_path / "a.png"), cv2.IMREAD_UNCHANGED)
    assert np.array_equal(read[..., ::-1], pixels)


@pytest.mark.parametrize(
    ("cores", "workers", "own"),
    [
        ([0, 1], 1, [{0, 1}]),
        ([0, 1], 2, [{0}, {1}]),
        ([2, 3, 5, 7], 2, [{2, 3}, {5, 7}]),
        ([4], 3, [{4}, {4}, {4}]),  # more workers than cores share them
    ],
)
def test_workers_have_cores_of_their_own(cores: list[int], workers: int, own: list[set[int]]):
    assert [set(x) for x in shared_out(cores, workers)] == own
