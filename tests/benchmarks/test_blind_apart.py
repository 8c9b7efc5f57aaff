"""Cases of the blind benchmark made by apart/: errors within tolerances, forms that act, labels and pages that do not
say which. Nothing here names one, since who writes the diagnosis reads this file."""

import ast
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import benchmarks.blind
from benchmarks.blind import case, chain, proposals, severity, strata, truth
from benchmarks.blind.apart import errors as apart_errors
from benchmarks.blind.apart import proposals as apart
from benchmarks.blind.apart import world
from benchmarks.blind.bench import Bench
from benchmarks.blind.chain import Cause
from benchmarks.blind.errors import Tolerances
from benchmarks.blind.page import table
from benchmarks.blind.results import Answer, answer
from benchmarks.blind.rules import right
from benchmarks.blind.scene_causes import ALL, RENDERED, changed
from benchmarks.blind.scenes import SCENES, scene
from benchmarks.blind.tracing import Quality

FOLDER = Path(benchmarks.blind.__file__).parent / "apart"
PRODUCT = {"analysis", "composer", "interchange", "offline", "realtime"}
DRAWS = 60
NAMES = (*proposals.SEEN, *apart.OUTSIDE)
FIRST = {*chain.FORMS, *chain.NOISE, *RENDERED, "one lamp", "one lamp's colour", "sky", "bounces"}
T = Tolerances()


def test_its_files_are_short_marked_and_import_no_product():
    for file in FOLDER.glob("*.py"):
        text = file.read_text()
        tree = ast.parse(text)
        assert "does not read this folder" in (ast.get_docstring(tree) or "")
        assert text.count("\n") < 300
        for node in ast.walk(tree):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom):
                assert not node.level
                names = [node.module or ""]
            assert not {n.split(".")[0] for n in names} & PRODUCT


@pytest.fixture(scope="module")
def bench() -> Bench:
    return scene("rich", (48, 36))


@pytest.fixture(scope="module")
def drawn(bench: Bench) -> list[apart_errors.ApartErrors]:
    return [apart_errors.draw(bench, T, np.random.default_rng(k)) for k in range(DRAWS)]


def _where(bench: Bench) -> dict[str, np.ndarray]:
    """Every part, seen at places all over it."""
    rng = np.random.default_rng(0)
    part = np.repeat(np.arange(len(bench.parts)), 12)[:, None]
    return {"part": part, "position": rng.uniform(-0.15, 0.15, (*part.shape, 3)).astype(np.float32)}


def _displacements(e: apart_errors.ApartErrors, bench: Bench) -> np.ndarray:
    x, y = np.meshgrid(np.linspace(-24, 24, 13), np.linspace(-18, 18, 13))
    found = [
        np.subtract(e.moved(s.eye, e.moment(s), x, y), (x, y)) for s in bench.shots
    ]  # (2, 13, 13) px each
    return np.array(found)


def test_errors_stay_within_what_is_declared(drawn: list[apart_errors.ApartErrors], bench: Bench):
    shots = bench.shots
    frames = [(s, r) for s in shots for r in range(s.repeats)]
    kinds = {
        "registration": (T.registration_px, [_displacements(e, bench) for e in drawn]),
        "lamps": (
            T.light_intensity,
            [np.array([e.lamp(k, s) for s in shots for k in range(len(bench.lamps))]) - 1 for e in drawn],
        ),
        "albedo": (T.albedo, [e.reflectance(bench, _where(bench)) - 1 for e in drawn]),
        "flat": (T.flat_field, [np.array([e.field(s) for s in shots]) - 1 for e in drawn]),
        "black": (
            T.black_level_dn,
            [np.array([np.broadcast_to(e.offset(*f), (36, 48, 3)) for f in frames]) for e in drawn],
        ),
    }
    for kind, (tolerance, errors) in kinds.items():
        rms = np.array([np.sqrt(np.mean(x**2)) for x in errors]) / tolerance
        assert 0.4 < np.sqrt(np.mean(rms**2)) < 1.0, kind
        assert max(np.abs(x).max() for x in errors) <= 2.01 * tolerance, kind
        assert rms.std() > 0.05, kind  # not two cases alike


def test_pixels_are_as_uneven_as_the_sensor_declares(drawn: list[apart_errors.ApartErrors], bench: Bench):
    for e in drawn:
        gain = e.pixel_gain(bench.shots[0], 0)
        assert gain.std() == pytest.approx(bench.sensor.prnu, rel=0.01)
        assert abs(gain.mean() - 1) < T.light_intensity


def test_more_than_is_declared_where_a_plan_says_so(bench: Bench):
    spread = [
        np.std([apart_errors.draw(bench, T, np.random.default_rng(k), scale).lamps for k in range(DRAWS)])
        for scale in (1.0, 2 / 0.7)
    ]
    assert 1.4 * T.light_intensity < spread[1] < 2.4 * T.light_intensity
    assert spread[0] < T.light_intensity


@pytest.mark.parametrize("name", SCENES)
def test_the_scene_stands_within_what_is_declared(name: str):
    nominal = scene(name)
    lamps, parts, gloss = [], [], []
    for k in range(DRAWS):
        moved = world.disturbed(nominal, T, np.random.default_rng(k))
        lamps += [
            np.subtract(a.position, b.position) for a, b in zip(moved.lamps, nominal.lamps, strict=True)
        ]
        for a, b in zip(moved.parts, nominal.parts, strict=True):
            for M, N in zip(a.poses, b.poses, strict=True):
                shift = a.solid.vertices @ (M - N)[:3, :3].T + (M - N)[:3, 3]
                assert np.abs(shift[:, 2]).max() < 1e-9
                parts.append(np.sqrt(np.mean(shift[:, :2] ** 2)))
        for a, b in zip(moved.matters, nominal.matters, strict=True):
            gloss += [np.log(n / m) for (_, _, n), (_, _, m) in zip(a.lobes, b.lobes, strict=True)]
        for a, b in zip(moved.eyes, nominal.eyes, strict=True):
            R = np.array(a.rotation)
            N = np.array(b.rotation)
            assert np.allclose(R @ R.T, N @ N.T, atol=1e-7)  # a scene file has them in single precision
            back, distance = np.array(b.rotation[2]), np.linalg.norm(b.position)
            middle = R @ (np.array(b.position) - distance * back - a.position)
            assert np.abs(middle[:2]).max() < 1e-6 * distance
    assert 0.4 < np.sqrt(np.mean(np.square(lamps))) / T.light_position_mm < 1
    assert np.abs(lamps).max() <= 2.01 * T.light_position_mm
    if len(nominal.parts) > 1:
        assert 0.2 < np.sqrt(np.mean(np.square(parts))) / T.object_pose_mm < 1
        assert max(parts) < 2.5 * T.object_pose_mm
    if gloss:
        assert np.std(gloss) < T.gloss
        assert np.abs(gloss).max() <= 2.01 * T.gloss


def test_same_seed_same_case(bench: Bench):
    a, b, c = (apart_errors.draw(bench, T, np.random.default_rng(k)) for k in (1, 1, 2))
    shot = bench.shots[-1]
    for f in ("field", "lamps", "pixel_gain", "offset"):
        x, y, z = (e.lamps if f == "lamps" else getattr(e, f)(*_args(f, shot)) for e in (a, b, c))
        assert np.array_equal(x, y)
        assert not np.array_equal(x, z)
    for name in NAMES:
        p, q = (apart.propose(name, _bench(name), np.random.default_rng(3)) for _ in range(2))
        assert p == q
    plans = [strata.plans(300, 5, 2, apart=x) for x in (0.0, 0.5, 0.5)]
    assert plans[1] == plans[2]
    assert 140 < sum(p.apart for p in plans[1]) < 160
    assert not any(p.apart for p in plans[0])
    for p, q in zip(plans[0], plans[1], strict=True):  # but for what is set apart the same set
        assert (p.case, p.seed, p.scene) == (q.case, q.seed, q.scene)
        assert p == q or q.apart
        for name, _ in q.effects:
            assert (name in apart.OUTSIDE) == (q.apart and q.stratum == "outside")
            assert q.scene in apart.OUTSIDE.get(name, (q.scene,))


def _args(f: str, shot: object) -> tuple:
    return (shot,) if f == "field" else (shot, 0)


def _bench(name: str) -> Bench:
    return scene({**proposals.SEEN, **apart.OUTSIDE}[name][0], (48, 36))


class _Still:
    """No errors."""

    def moment(self, shot):
        return 0

    def moves(self, eye, moment):
        return False

    def moved(self, eye, moment, x, y):
        return x, y

    def lamp(self, k, shot):
        return np.ones(3)

    def reflectance(self, bench, where):
        return np.ones((*where["part"].shape, 3))

    def field(self, shot):
        return 1.0


@pytest.fixture
def painted(monkeypatch: pytest.MonkeyPatch) -> None:
    """In place of the engine: a bumpy table of coloured squares, bright to one side, another in each lamp's light."""

    def guide(bench, eye, pose, q, cache):
        w, h = ((n + 2 * q.margin) * q.fine for n in bench.size)
        y, x = np.mgrid[:h, :w]
        part = (x * len(bench.parts) // w + y // 7) % len(bench.parts)
        p = np.stack([(x / w - 0.5) * 0.3, (y / h - 0.5) * 0.25, 0.01 * (part % 3)], axis=-1)
        n = np.stack([0.6 * np.sin(part), 0.6 * np.cos(part), 0.8 + 0 * x], axis=-1)
        return {"part": part, "position": p, "normal": n}

    def layer(bench, eye, pose, lamp, q, seed, cache):
        where = guide(bench, eye, pose, q, cache)
        rng = np.random.default_rng(sum(map(ord, lamp.name if lamp else "sky")))
        paint = rng.uniform(0.3, 1.0, (len(bench.parts), 3)) * np.linspace(0.2, 1, len(bench.parts))[:, None]
        top = 9000 / bench.sensor.responsivity / (1 + len(bench.lamps) / 4)
        light = top * paint[where["part"]] * (1 + where["position"][..., :1])
        return {"direct": light.astype(np.float32), "indirect": (0.1 * light).astype(np.float32)}

    monkeypatch.setattr(truth, "guide", guide)
    monkeypatch.setattr(truth, "layer", layer)


def _setup(bench: Bench) -> truth.Setup:
    shots = tuple(replace(s, exposure=0.9 * s.exposure) for s in bench.shots)
    return truth.Setup(replace(bench, shots=shots), _Still(), Quality(1, 3, 4), 0, Path("unused"))


def _severity_of(setup: truth.Setup, still: list[np.ndarray], c: Cause) -> Callable[[float], float]:
    well = setup.bench.sensor.full_well
    return lambda a: severity.severity(still, truth.means(setup, [c.at(a)]), well)


# numbers in place of names: a failing test must not say which form it is
@pytest.mark.parametrize("k", range(len(NAMES)))
@pytest.mark.usefixtures("painted")
def test_a_form_is_nothing_at_zero_and_reaches_the_severities(k: int):
    name, bench = NAMES[k], _bench(NAMES[k])
    forms: dict[str, proposals.Proposal] = {}
    for seed in range(8):
        p = apart.propose(name, bench, np.random.default_rng(seed))
        assert p.cause.name == name
        assert 0 <= p.low < p.start < p.high
        json.dumps(p.cause.shape)
        if p.cause.form not in FIRST:  # tests of the first way have those
            forms.setdefault(p.cause.form, p)
    for p in forms.values():
        c = p.cause
        parts = tuple(replace(x, matter=c.place) for x in bench.parts)
        setup = _setup(replace(bench, parts=parts) if c.place in {m.name for m in bench.matters} else bench)
        still = truth.means(setup, [])
        nothing = truth.means(setup, [c])  # but for rounding, where sums are in another order
        for a, b in zip(still, nothing, strict=True):
            assert np.allclose(a, b, rtol=1e-5, atol=1e-3)
        if c.form in ALL:
            assert changed(bench, [c]) is bench
            assert changed(bench, [c.at(p.start)]) is not bench
            continue
        if name == "saturation":  # of too dark an image nothing is cut off, whatever the form
            continue
        assert chain.is_chain(c) or c.form in truth.LIGHT
        for wanted in (0.005, 0.04):
            _, s = severity.solve(_severity_of(setup, still, c), wanted, p.low, p.high, p.start, 0.05)
            assert s == pytest.approx(wanted, rel=0.06)


def test_most_causes_have_a_form_of_its_own():
    """12 at least of the first way's table, and three outside it."""
    own = {
        name
        for name in proposals.SEEN
        for seed in range(8)
        if apart.propose(name, _bench(name), np.random.default_rng(seed)).cause.form not in FIRST
    }
    assert len(own) >= 12
    assert len(apart.OUTSIDE) >= 3
    assert not {*apart.OUTSIDE} & {*proposals.OUTSIDE}


@pytest.mark.parametrize("k", range(len(chain.ALL["fine"]) - len(chain.FINE)))
def test_blur_keeps_light_and_place(k: int):
    form = sorted(set(chain.ALL["fine"]) - set(chain.FINE))[k]
    names = [n for n in proposals.SEEN if "plate" not in proposals.SEEN[n]]
    found = (apart.propose(n, _bench(n), np.random.default_rng(s)) for n in names for s in range(8))
    c = next(p.cause for p in found if p.cause.form == form)
    point = np.zeros((121, 121, 3), np.float32)
    point[60, 60] = 1.0
    for a in (0.1, 0.6, 2.0):
        blurred = chain.fine([c.at(a)], point, 3)
        assert np.allclose(blurred.sum(axis=(0, 1)), 1, atol=1e-2)  # wider towards one side: nearly
        y, x = np.mgrid[:121, :121]
        assert abs(float((blurred[..., 0] * x).sum()) - 60) < 0.5
        assert abs(float((blurred[..., 0] * y).sum()) - 60) < 0.5


def test_captures_have_the_noise_that_is_declared():
    bench = scene("plate", (64, 48))
    errors = apart_errors.draw(bench, T, np.random.default_rng(1))
    setup = truth.Setup(bench, errors, Quality(), 0, Path("unused"))
    mean, rng = np.full((48, 64, 3), 4000.0), np.random.default_rng(2)
    shot = next(s for s in bench.shots if s.repeats == 4)
    frames = np.stack([truth.capture(setup, [], shot, mean, rng, k % 4).astype(float) for k in range(24)])
    K = bench.sensor.K
    # two frames of the same repeat differ by noise alone
    pairs = frames[:4] - frames[4:8]
    assert pairs.var() / 2 == pytest.approx(K**2 * (4000 + 7.0**2) + 1 / 12, rel=0.02)
    assert frames.mean() == pytest.approx(64 + K * 4000, abs=2.5 + 4e-3 * K * 4000)


def test_labels_do_not_say_the_form():
    c = Cause("vignetting", "a form", 0.3, {"x": 1.0}, "LED0")
    told = case.told(c, True)
    assert "a form" not in json.dumps(told)
    assert {"amplitude", "shape"}.isdisjoint(told)
    assert not told["place"]
    assert case.told(c, False)["form"] == "a form"


def _label(k: str, stratum: str, apart: bool, *names: str) -> dict:
    effects = [
        {"name": n, "form": "secretform", "place": "secretplace", "wanted": 0.01, "severity": 0.01,
         "parameters": {"secret": 1.2345}} for n in names
    ]  # fmt: skip
    return {
        "case": k,
        "stratum": stratum,
        "scene": "rich",
        "effects": effects,
        "severity": 0.01,
        "apart": apart,
    }


def test_a_page_has_both_kinds_side_by_side_and_no_form(tmp_path: Path):
    labels = [
        _label("a1", "null", True), _label("a2", "single", True, "vignetting"),
        _label("a3", "outside", True, "apart_1"), _label("b1", "null", False), _label("b2", "single", False, "gloss"),
    ]  # fmt: skip
    said = {
        "verdict": "effects", "seconds": 1.0, "gap": {"explained": 0.9, "before": 2.0, "after": 1.1},
        "effects": [
            {"name": "gloss", "probability": 0.95, "parameters": {"secret": {"value": 1.3, "sigma": 0.1}}}
        ],
    }  # fmt: skip
    for x in labels:
        (tmp_path / x["case"]).mkdir()
        (tmp_path / x["case"] / "diagnosis.json").write_text(json.dumps(said))
    answers = {x["case"]: answer(tmp_path / x["case"] / "diagnosis.json") for x in labels}
    page = table(labels, answers)
    assert "| one effect, exact | 1/1 | 100.0 % | 2.5–100.0 % | 0/1 | 0.0 % | 0.0–97.5 % |" in page
    assert "| confident (p > 0.9) and wrong | 1/2 |" in page
    assert "| vignetting (apart, 1.00 %) |" in page
    assert "| apart_1 (apart, 1.00 %) |" in page
    assert "secret" not in page
    one = [x for x in labels if not x["apart"]]
    assert "first way" not in table(one, answers)
    assert right(labels[2], Answer({}, unknown=True))
    assert not right(labels[2], Answer({"gloss": 0.8}, unknown=True))
