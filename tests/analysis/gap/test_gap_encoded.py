"""Captures that were encoded for a screen are told from linear ones, whatever else is wrong with them."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from analysis.gap.compared.conditions import Condition
from analysis.gap.corrected.scene import write_corrected
from analysis.gap.finding import Estimate, Finding
from analysis.gap.judgement.attribution import Attribution, waterfall
from analysis.gap.judgement.findings import Known, with_known
from analysis.gap.measures.shrinkage import Gap
from analysis.gap.notes import _encoded
from analysis.gap.processed.encoded import LINE, Encoding, encoded, has_a_number, parameters
from analysis.gap.processed.taken_as import on_scene, taken_as
from analysis.gap.sensor.expected import mean_dn
from interchange.camera import Camera
from interchange.captures import Captures
from interchange.effects.response_curve import ResponseCurve
from interchange.exposure import expose
from interchange.formats.document import open_scene
from interchange.image import Image, Quantity
from interchange.sensor import Response, Sensor
from tests.analysis.gap.bench import BENCH
from tests.analysis.gap.test_gap_overlap import SIZE, lit

COLUMN, ROW = np.meshgrid(np.linspace(-1, 1, SIZE[0]), np.linspace(-1, 1, SIZE[1]))
PLATE = lit(6.0 - 2.5 * (COLUMN**2 + ROW**2))
RAMP = lit(0.05 + 3.0 * (1 + COLUMN))


def _as_if(condition: Condition, gain: float, curve: ResponseCurve, bits: int = 8) -> Condition:
    """Captures that were ``gain`` times as bright, encoded by a curve, rounded to some bits, with black taken off."""
    top = 2**condition.camera.sensor.bits_out - 1
    signal = np.clip(gain * condition.mean / top, 0, 1)
    codes = np.rint(curve.curve(signal) * (2**bits - 1)) / (2**bits - 1)
    return replace(condition, mean=(codes * top).astype(np.float32))


@pytest.mark.parametrize("gain", [0.7, 1.0, 1.4])
def test_srgb_is_told(gain: float) -> None:
    shaded = replace(PLATE, mean=PLATE.mean * (1 - 0.05 * COLUMN[..., None] ** 2).astype(np.float32))
    for c in (PLATE, shaded):
        found = encoded([_as_if(c, gain, ResponseCurve(response=Response.SRGB))])
        assert [s.camera for s in found] == ["/eye"]


@pytest.mark.parametrize("curve", [{}, {"gamma": 0.9}, {"gamma": 1.1}, {"bow": 0.1}])
def test_what_is_linear_or_bends_little_is_left_to_the_fit(curve: dict[str, float]) -> None:
    assert encoded([_as_if(PLATE, 1.0, ResponseCurve(**curve))]) == []


@pytest.mark.parametrize("gain", [0.7, 1.3])
@pytest.mark.parametrize("gamma", [0.4, 0.4545, 0.7, 1.5])
def test_a_power_is_told(gain: float, gamma: float) -> None:
    """In 8 bits; sRGB's curve and that of Rec. 709 are near the second."""
    (found,) = encoded([_as_if(RAMP, gain, ResponseCurve(gamma=gamma))])
    assert found.response is Response.LINEAR
    assert found.gamma.value == pytest.approx(gamma, abs=max(3 * found.gamma.sigma, 0.01))
    assert found.gamma.sigma < 0.02
    assert list(parameters([found])) == ["gamma"]
    assert found.of(PLATE.camera).sensor.gamma == found.gamma.value


@pytest.mark.parametrize("gain", [0.7, 1.0])
def test_rec_709_is_told(gain: float) -> None:
    (found,) = encoded([_as_if(RAMP, gain, ResponseCurve(response=Response.REC709))])
    assert found.response is Response.REC709
    assert parameters([found]) == {"rec709": LINE}
    other = replace(found, camera="/other", response=Response.SRGB)
    assert set(parameters([found, other])) == {"eye rec709", "other sRGB"}
    assert [has_a_number(n) for n in ("other sRGB", "lut", "eye gamma")] == [False, False, True]
    assert "curve of Rec. 709 and sRGB's curve" in _encoded([found, other])[0]


def _toned(x: np.ndarray) -> np.ndarray:
    y = ResponseCurve(response=Response.SRGB).curve(x)
    return 0.6 * y + 0.4 * y * y * (3 - 2 * y)


@pytest.mark.parametrize("shade", [0.0, 0.3])
def test_a_curve_without_a_name_is_a_table(shade: float) -> None:
    """Of two plates of which one is a third as bright, and a ramp: within half a percent of the range, and within one
    where a lens shades them, which falls off as the plates' own light does."""
    dark = replace(lit(0.3 * PLATE.rendered.lamps["/lamp"][..., 0]), captures=()) if PLATE.rendered else PLATE
    shading = (1 - shade * (COLUMN**2 + ROW**2) / 2)[..., None]
    own = []
    for c in (PLATE, dark, RAMP):
        signal = np.clip(c.mean / 4095 * shading, 0, 1)
        own.append(replace(c, mean=(np.rint(255 * _toned(signal)) / 255 * 4095).astype(np.float32)))
    (found,) = encoded(own)
    assert found.response is Response.LUT
    assert parameters([found]) == {"lut": LINE}
    camera = found.of(PLATE.camera)
    assert camera.sensor.response_lut == found.lut
    x = np.linspace(0.05, 0.55, 50)
    gains = [
        np.abs(ResponseCurve.of(camera).curve(x) - _toned(g * x)).max() for g in np.linspace(0.8, 1.1, 61)
    ]
    assert min(gains) < (0.01 if shade else 0.005)


def test_a_scene_that_says_so_has_no_other_curve() -> None:
    sensor = replace(PLATE.camera.sensor, response=Response.SRGB)
    told = replace(PLATE, camera=replace(PLATE.camera, sensor=sensor))
    assert encoded([replace(told, mean=told.simulated().dn)]) == []


def test_the_dark_tells_nothing() -> None:
    assert encoded([lit(np.zeros(SIZE[::-1]))]) == []


@pytest.mark.parametrize("off", [False, True])
def test_whether_black_was_taken_off_is_told(off: bool) -> None:
    """A black level of a thirtieth of the range, kept beneath the curve or gone."""
    sensor = replace(PLATE.camera.sensor, black_level=136.0)
    plate = replace(PLATE, camera=replace(PLATE.camera, sensor=sensor))
    black, top = 136.0, 2**sensor.bits_out - 1
    signal = np.clip(0.9 * (plate.simulated().dn - black) / (top - black), 0, 1)
    y = ResponseCurve(response=Response.SRGB).curve(signal)
    dn = top * y if off else black + (top - black) * y
    (told,) = encoded([replace(plate, mean=dn.astype(np.float32))])
    assert told.black_off is off
    assert told.of(plate.camera).sensor.black_level == (0 if off else 136)
    assert told.of(plate.camera).sensor.response is Response.SRGB
    (taken,) = taken_as([plate], [told])
    assert encoded([replace(taken, mean=dn.astype(np.float32))]) == []


def test_the_curve_is_a_finding_and_part_of_what_is_closed() -> None:
    """χ² of 100 as written, 4 with the curve and 1 with a vignetting as well: the curve takes 96 off, a γ that
    was found beside it 0.5 of the 3 that are left, and steps add up."""
    g = Gap(10.0, 1.0, 0.9, (9, 11), (0.9, 1.1), 50.0, 2.0, ("a.png",), 10.0, 50.0)
    taken = Attribution({}, {}, {"vignetting": 2.5, "response_curve": 0.5})
    steps = waterfall(g, taken, {"response_curve": 96.0})
    assert {s.name: s.chi2 for s in steps if s.kind == "effect"} == {
        "response_curve": 96.5,
        "vignetting": 2.5,
    }
    assert sum(s.chi2 for s in steps) == pytest.approx(g.as_written**2)
    gamma = Finding("response_curve", 0.7, {"gamma": Estimate(1.01, 0.01, "1")}, (), None, 2.0, 1.0, 0.005)
    other = replace(gamma, name="vignetting", share=0.025)
    known = Known("response_curve", {"sRGB": LINE}, "why", 96.0, 9.5, ("/World/eye",))
    found = with_known([other, gamma], known, g)
    assert [f.name for f in found] == ["response_curve", "vignetting"]
    assert found[0].share == pytest.approx(0.965)
    assert found[0].parameters == {"sRGB": LINE} | gamma.parameters
    assert found[0].grounds == "why"
    assert found[0].called == "response curve of eye"
    assert (found[0].gap_without, found[0].gap_with) == (9.5, 1.0)


def test_the_corrected_scene_says_so(tmp_path: Path) -> None:
    document = open_scene(BENCH)
    encodings = [Encoding("/World/Camera0", True)]
    captures = Captures(BENCH, BENCH, ())
    assert (
        write_corrected(document, captures, [], tmp_path / "new.usda", partial(on_scene, told=encodings))
        == {}
    )
    for name, said in (("/World/Camera0", (Response.SRGB, 0.0)), ("/World/Camera1", (Response.LINEAR, 64.0))):
        sensor = open_scene(tmp_path / "new.usda").scene(0).camera(name).sensor
        assert (sensor.response, sensor.black_level) == said


def test_the_mean_of_a_curve_that_bends_is_not_the_curve_of_the_mean() -> None:
    """Noise of a dozen DN on signals of a hundred: against the sensor itself, 400 frames of 64 pixels a level, whose
    standard error is 0.6 DN of slopes up to 7; the curve of the mean is 5 DN and more off. Black is high enough to clip
    nothing."""
    sensor = Sensor((64, 64), (1e-6, 1e-6), responsivity=1000.0, full_well=1e4, black_level=200.0, read_noise=30.0,
                    response=Response.SRGB)  # fmt: skip
    camera = Camera("/eye", sensor=sensor)
    radiance = np.repeat(np.linspace(0.05, 1.0, 64)[:, None, None] * np.ones((64, 64, 1)), 3, axis=2)
    image = Image(radiance.astype(np.float32), Quantity.RADIANCE, camera)
    rng = np.random.default_rng(2)
    frames = np.mean([expose(image, camera, 1.0, rng=rng).pixels[..., 0].mean(1) for _ in range(400)], axis=0)
    mean = mean_dn(image, camera)[:, 0, 0]
    of_the_mean = mean_dn(image, camera, [ResponseCurve()])[:, 0, 0].astype(float)
    bent = ResponseCurve(response=Response.SRGB).output(of_the_mean, sensor.bit_depth, sensor.black_level)
    assert np.abs(frames - mean).max() < 2
    assert np.abs(frames - bent).max() > 5


def test_the_report_says_how_they_are_taken() -> None:
    (words,) = _encoded([Encoding("/eye", True)])
    assert "captures of eye follow sRGB's curve, with black taken off before" in words
    assert _encoded([]) == []
