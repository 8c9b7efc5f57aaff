"""Effects of noise, recovered from simulated repeats of a lit plane with stripes; 160 x 120 px, no renderer."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import nnls

from analysis.gap.compared.conditions import Condition
from analysis.gap.judgement.findings import beside_unknown
from analysis.gap.light.radiance import Rendered
from analysis.gap.noise.codes import flat_top, quantization, saturation, with_steps, without_flat_tops
from analysis.gap.noise.finding import NoiseFinding, Number, probability
from analysis.gap.noise.fixed_pattern import _possible, fixed_pattern
from analysis.gap.noise.variance import _line, noise_findings, sensor_noise, with_black_level
from interchange.camera import Camera, Sensor
from interchange.captures import Capture
from interchange.effects import Effect
from interchange.effects.black_level import BlackLevel
from interchange.effects.fixed_pattern import FixedPattern
from interchange.effects.response_curve import ResponseCurve
from interchange.effects.saturation import Saturation
from interchange.effects.sensor_noise import SensorNoise
from interchange.exposure import expose
from interchange.image import Image
from interchange.light import Light, LightKind
from interchange.scene import Scene

SHEET = Sensor((160, 120), (5e-6, 5e-6), responsivity=8000.0, full_well=1e4, black_level=64, read_noise=5, prnu=0.004,
               dsnu=1.0, bit_depth=12)  # fmt: skip
LAMPS = ("/A", "/B", "/C")


def _planes() -> dict[str, np.ndarray]:
    """Light of three lamps from three sides, on stripes of two albedos."""
    y, x = np.mgrid[:120, :160] / 120
    stripes = np.where((x * 8).astype(int) % 2, 0.9, 0.45)
    falls = [(x, y), (1.33 - x, y), (x, 1 - y)]
    return {
        name: (stripes / (1 + 2 * u**2 + v**2))[..., None].repeat(3, axis=2).astype(np.float32)
        for name, (u, v) in zip(LAMPS, falls, strict=True)
    }


def _rig(
    seed: int, effects: tuple[Effect, ...] = (), sheet: Sensor = SHEET, repeats: int = 2, power: float = 1.0
) -> tuple[list[Condition], list[np.ndarray]]:
    """Each lamp alone, by the sensor of ``sheet`` with other ``effects`` than its data sheet says."""
    rng = np.random.default_rng(seed)
    camera = Camera("/Top", sensor=replace(sheet, serial_number=str(seed)))
    planes = _planes()
    full = Scene(lights=tuple(Light(n, LightKind.SPHERE, (1.0, 1.0, 1.0)) for n in LAMPS))
    nothing = np.zeros((120, 160, 3), np.float32)
    shown = Rendered(full, camera, planes, {n: np.ones(3) for n in LAMPS}, nothing, nothing, {}, {})
    found = []
    for lamp in LAMPS:
        on = tuple(replace(x, intensity=(power * (x.name == lamp),) * 3) for x in full.lights)
        scene = replace(full, lights=on)
        image = Image(shown.radiance(scene))
        shots = [expose(image, camera, rng=rng, effects=effects).pixels for _ in range(repeats)]
        captures = tuple(
            Capture(f"{lamp}{k}.png", "/Top", 0, 1.0, s, bits=8 if sheet.bits_out == 8 else 16)
            for k, s in enumerate(shots)
        )
        stack = np.stack(shots)
        spread = stack.var(axis=0, ddof=1) if repeats > 1 else None
        mask = np.ones((120, 160), bool)
        found.append(Condition(captures, scene, camera, stack.mean(axis=0), spread, mask, rendered=shown))
    return found, [c.simulated().dn for c in found]


def test_the_data_sheets_own_sensor_has_no_finding() -> None:
    """20 seeds: no effect with more than 0.05, in 80 answers."""
    for seed in range(20):
        for told in noise_findings(*_rig(seed)):
            assert told.probability < 0.05, (seed, told)


def test_gain_and_read_noise_lie_within_their_intervals() -> None:
    """12 seeds, at two repeats: z of both numbers has rms 1 within what 24 values tell (0.65 to 1.45 at 99 %), and mean
    within 3 / sqrt(12): no bias from binning."""
    z = []
    for seed in range(12):
        told = sensor_noise(*_rig(seed, (SensorNoise(9.0), Saturation(9e3))))
        assert told is not None
        assert told.probability > 0.99
        K, read = told.parameters["K"], told.parameters["read_noise"]
        z.append(((K.value - (4095 - 64) / 9e3) / K.sigma, (read.value - 9) / read.sigma))
    assert 0.6 < np.sqrt(np.mean(np.square(z))) < 1.5
    assert np.abs(np.mean(z, axis=0)).max() < 3 / np.sqrt(12)


def test_gain_is_the_slope_of_the_standards_line() -> None:
    """Levels that lie 5 % off a line, the dim ones known best: every one counts the same, up to 70 % of saturation, and
    the line is as uncertain as they scatter about it."""
    light = np.linspace(1, 10, 10)
    measured = light * np.where(np.arange(10) % 2, 1.05, 0.95)
    linear = light <= 7
    slope, square = _line(light, measured, 0.01 * light, linear)
    x, y = light[linear], measured[linear]
    assert slope == pytest.approx(np.linalg.lstsq(x[:, None], y, rcond=None)[0][0])
    assert slope != pytest.approx(np.mean(y / x), abs=0.002)  # by each one's own error
    one = np.sqrt(np.sum((x * (y - slope * x)) ** 2) * 7 / 6) / np.sum(x**2)
    assert np.sqrt(square) == pytest.approx(one)
    assert _line(light, 2 * light, 0.01 * light, linear) == pytest.approx(
        (2, np.sum((0.01 * x * x) ** 2) / np.sum(x**2) ** 2)
    )


def test_what_is_cut_at_zero_tells_nothing_of_noise() -> None:
    """A sensor whose dark value is 0, its read noise 10 DN: where it shows next to no light, half of it is cut off."""
    sheet = replace(SHEET, black_level=0.0, read_noise=25.0)
    for power in (1.0, 0.02):
        for told in noise_findings(*_rig(1, sheet=sheet, power=power)):
            assert told.name != "sensor_noise" or told.probability < 0.05, (power, told)


def test_noise_counts_from_the_black_level_that_was_found() -> None:
    """20 DN above the data sheet's 64, which would pass for 50 e- of light, more than σ_d²; 3 of its own
    σ."""
    found, said = _rig(0, (BlackLevel(84.0),))
    told = sensor_noise(with_black_level(found, {"/Top": 20.0}), [s + 20 for s in said])
    wrong = sensor_noise(found, [s + 20 for s in said])
    assert told is not None
    assert wrong is not None
    for name, true in (("K", SHEET.K), ("read_noise", SHEET.read_noise)):
        assert told.parameters[name].value == pytest.approx(true, abs=3 * told.parameters[name].sigma)
    assert wrong.parameters["read_noise"].value == 0


def test_a_level_that_was_lowered_may_lack_the_noise_of_its_electrons() -> None:
    """By 60 DN: 150 e- more are counted from there than make noise, which is all of σ_d² (144 e-²) and more; an opened
    case had a sensor noise of 0.99 for it."""
    found, said = _rig(0, sheet=replace(SHEET, read_noise=12))
    lowered = with_black_level(found, {"/Top": -60.0})
    told, alone = sensor_noise(lowered, said, -60.0), sensor_noise(lowered, said)
    assert told is not None
    assert alone is not None
    assert told.probability < 0.05
    assert alone.probability > 0.9


@pytest.mark.parametrize(("noisy", "sure"), [(0.0, False), (50.0, False), (400.0, True)])
def test_an_offset_may_have_a_noise_of_its_own(noisy: float, sure: bool) -> None:
    """20 DN are 50 e-, which a dark current brings with 50 e-² of noise and a black level without any; 400 e-² are
    the sensor's."""
    read = float(np.sqrt(SHEET.read_noise**2 + noisy))
    found, said = _rig(0, (BlackLevel(84.0), SensorNoise(read)))
    told = sensor_noise(with_black_level(found, {"/Top": 20.0}), [s + 20 for s in said], 20.0)
    assert told is not None
    found_read = told.parameters["read_noise"]
    assert found_read.value == pytest.approx(read, abs=3 * found_read.sigma)
    assert (told.probability > 0.9) == sure


def test_a_gain_that_is_off_is_found_beside_an_offset_whose_noise_is_its_own() -> None:
    """12 % more than an ideal sensor's, and 119 e-² of which 20 DN may bring 50: what may be wide is no narrower than
    what is not."""
    sheet = replace(SHEET, full_well=1.12 * SHEET.full_well, read_noise=0.0)
    found, said = _rig(0, (BlackLevel(84.0), SensorNoise(119**0.5)))
    told = sensor_noise(
        [replace(c, camera=replace(c.camera, sensor=replace(sheet, black_level=84.0))) for c in found],
        [s + 20 for s in said],
        20.0,
    )
    assert told is not None
    assert told.parameters["K"].value == pytest.approx(SHEET.K, rel=0.03)
    assert told.probability > 0.9


def test_a_light_that_drifts_between_repeats_is_no_noise() -> None:
    """By 2 % of the mean: its variance would be as large as the photons'."""
    found, said = _rig(0)
    drifting = []
    for c in found:
        one, two = c.captures
        two = replace(two, pixels=two.pixels + 0.02 * float(c.mean.mean()))
        stack = np.stack([one.pixels, two.pixels])
        drifting.append(
            replace(c, captures=(one, two), mean=stack.mean(axis=0), spread=stack.var(axis=0, ddof=1))
        )
    steady, told = sensor_noise(found, said), sensor_noise(drifting, said)
    assert steady is not None
    assert told is not None
    assert told.parameters["K"].value == pytest.approx(steady.parameters["K"].value, rel=0.01)


def test_fixed_patterns_lie_within_their_intervals() -> None:
    """8 seeds; the pattern itself, drawn on 19,200 x 3 px, is known to 0.3 %."""
    z = []
    for seed in range(8):
        effect = FixedPattern(prnu=0.012, dsnu=6.0, serial_number=str(seed))
        told = fixed_pattern(*_rig(seed, (effect,)))
        assert told is not None
        assert told.probability > 0.95
        for name, true in (("prnu", 0.012), ("dsnu", 6.0)):
            number = told.parameters[name]
            z.append((number.value - true) / number.sigma)
    assert 0.5 < np.sqrt(np.mean(np.square(z))) < 1.6


def test_no_pattern_is_less_than_none() -> None:
    """Squares as by an independent solver: one that came out below 0 was taken for a pattern that is off."""
    rng = np.random.default_rng(4)
    below = 0
    for _ in range(60):
        X = rng.standard_normal((12, 2)) * [1.0, 0.3] + 0.5
        y = X @ rng.normal([0.1, 0.0], 0.2) + 0.3 * rng.standard_normal(12)
        sums = np.array([X[:, 0] @ X[:, 0], X[:, 0] @ X[:, 1], X[:, 1] @ X[:, 1], X[:, 0] @ y, X[:, 1] @ y])
        below += bool((np.linalg.lstsq(X, y, rcond=None)[0] < 0).any())
        assert _possible(sums) == pytest.approx(nnls(X, y)[0], abs=1e-6)
    assert below > 10


def test_a_pattern_needs_two_lamps_of_their_own() -> None:
    found, said = _rig(0)
    assert fixed_pattern(found[:1], said[:1]) is None
    again = [found[0], replace(found[0], captures=found[1].captures)]
    assert fixed_pattern(again, [said[0], said[0]]) is None


def test_a_pattern_needs_pixels_away_from_edges() -> None:
    """Fine stripes everywhere, as in pictures that are much reduced: nothing is told, and no NaN."""
    found, said = _rig(0)
    stripes = np.where(np.indices((120, 160)).sum(axis=0) % 2, 1.0, 0.3)[..., None]
    assert fixed_pattern(found, [s * stripes for s in said]) is None


@pytest.mark.parametrize("bits", [8, 10, 11])
def test_fewer_bits_leave_a_comb(bits: int) -> None:
    found, _ = _rig(1)
    step = 2 ** (12 - bits)

    def coarse(c: Condition) -> Condition:
        captures = tuple(replace(x, pixels=np.floor(x.pixels / step) * step) for x in c.captures)
        return replace(c, captures=captures)

    told = quantization([coarse(c) for c in found])
    assert told is not None
    assert told.probability > 0.95
    assert told.parameters["bits"].value == pytest.approx(bits, abs=0.1)


@pytest.mark.parametrize("step", [4, 32])
def test_fewer_levels_are_no_sensor_noise(step: int) -> None:
    """4 DN: the noise hides the steps. 32 DN: most pixels repeat one code, others jump by a step, and none of that
    is the sensor's."""
    found, said = _rig(7, repeats=4)

    def coarse(c: Condition) -> Condition:
        stack = np.stack([np.rint(x.pixels / step) * step for x in c.captures]).astype(np.float32)
        shots = tuple(replace(x, pixels=p) for x, p in zip(c.captures, stack, strict=True))
        return replace(c, captures=shots, mean=stack.mean(axis=0), spread=stack.var(axis=0, ddof=1))

    rounded = [coarse(c) for c in found]
    judged = {n.name: n.probability for n in noise_findings(rounded, said)}
    assert judged["sensor_noise"] > 0.9 or step == 4
    told = with_steps(rounded)
    assert [c.step for c in told] == pytest.approx([step] * 3, rel=0.05)
    judged = {n.name: n.probability for n in noise_findings(told, said)}
    assert judged["quantization"] > 0.9
    assert judged.get("sensor_noise", 0.0) < 0.1
    assert [c.step for c in with_steps(found)] == [1.0] * 3


@pytest.mark.parametrize("power", [1.0, 0.3, 0.1, 0.05])
def test_the_dark_in_8_bit_files_is_no_sensor_noise(power: float) -> None:
    """A read noise of 0.13 of their step: in the dark, which at 0.1 of the light is nearly all, repeats jump by a whole
    step or by none, wherever between two codes the black level is."""
    for seed, black in enumerate((64.0, 68.0, 72.0)):
        sheet = replace(SHEET, output_bit_depth=8, black_level=black)
        told = sensor_noise(*_rig(seed, sheet=sheet, repeats=4, power=power))
        assert told is None or told.probability < 0.1, (black, told)
        assert told is not None or power < 0.2


@pytest.mark.parametrize(("rms", "kept"), [(0.0, 1.0), (0.003, 0.5), (0.03, 1 / 101)])
def test_a_fixed_pattern_beside_what_has_no_name_is_less_probable(rms: float, kept: float) -> None:
    """PRNU 0.5 % where the data sheet has 0.4 %: 0.3 % more, beside stripes of ``rms`` over the signal."""
    stripes = ("stripes fixed to the image", "/Top")
    e = SimpleNamespace(G=np.diag([100.0, 7.0]), signal=100.0)
    fitted: Any = SimpleNamespace(
        evidence=SimpleNamespace(e=e, members={stripes: np.array([0]), ("defocus", ""): np.array([1])}),
        after=SimpleNamespace(theta=np.array([rms, 5.0])),
        best=SimpleNamespace(causes=(stripes, ("defocus", ""))),
    )
    told = NoiseFinding("fixed_pattern", 0.9, {"prnu": Number(0.005, 1e-4, "1")})
    assert beside_unknown(told, fitted, SHEET).probability == pytest.approx(0.9 * kept)
    other = replace(told, name="sensor_noise")
    assert beside_unknown(other, fitted, SHEET) == other


def test_a_lower_full_well_cuts_the_histogram() -> None:
    found, said = _rig(2, (ResponseCurve(),), power=1.1)
    assert flat_top(found, said) is None
    cut = [
        replace(c, captures=tuple(replace(x, pixels=np.minimum(x.pixels, 2400)) for x in c.captures))
        for c in found
    ]
    level, pixels = flat_top(cut, said) or (0, 0)
    assert level == 2400
    assert pixels > 1000
    for kept, c in zip(without_flat_tops(cut), cut, strict=True):
        assert not (kept.mask & (c.mean.max(axis=2) >= 2400)).any()
        assert kept.mask.any()
    assert [c.mask.all() for c in without_flat_tops(found)] == [True] * 3
    told = saturation(cut, said)
    assert told is not None
    assert told.probability > 0.95
    assert told.parameters["full_well"].value == pytest.approx((2400 - 64) / SHEET.K)


def test_a_full_well_is_the_same_in_an_image_of_fewer_bits() -> None:
    """Of a converter of 12 bits in an image of 8: cut off at 150 of 255, which are 2409 of 4095."""
    sheet = replace(SHEET, output_bit_depth=8)
    found, said = _rig(2, (ResponseCurve(bits_out=8),), sheet, power=1.1)
    cut = [
        replace(c, captures=tuple(replace(x, pixels=np.minimum(x.pixels, 150)) for x in c.captures))
        for c in found
    ]
    told = saturation(cut, said)
    assert told is not None
    assert told.probability > 0.95
    assert told.parameters["full_well"].value == pytest.approx((150 * 4095 / 255 - 64) / SHEET.K)


def test_a_sensor_that_saturates_at_its_highest_value_is_what_the_sheet_says() -> None:
    found, said = _rig(3, power=3.0)
    assert max(c.mean.max() for c in found) == 4095
    assert flat_top(found, said) is None
    told = saturation(found, said)
    assert told is not None
    assert told.probability < 0.05


def test_a_cut_that_a_wrong_black_level_makes_is_no_finding() -> None:
    """Black 1 DN below the sheet's: the highest DN of all is 4094. Two nulls of a blind set were called saturated."""
    found, said = _rig(3, power=3.0)
    lower = [
        replace(c, captures=tuple(replace(x, pixels=np.maximum(x.pixels - 1, 0)) for x in c.captures))
        for c in found
    ]
    told = saturation(lower, said)
    assert told is not None
    assert told.probability < 0.05


def test_probability_is_the_ratio_of_marginal_likelihoods() -> None:
    """One number known exactly: at 0 the odds are those of the priors' heights times the prior's."""
    p = probability(np.zeros(1), np.zeros((1, 1)), np.array([0.01]), np.array([0.5]), prior=0.1)
    assert p / (1 - p) == pytest.approx((0.1 / 0.9) * 0.01 / 0.5)


def test_noise_needs_repeats() -> None:
    found, said = _rig(0, repeats=1)
    assert sensor_noise(found, said) is None
    assert fixed_pattern(found, said) is not None


def test_noise_that_falls_with_the_light_tells_no_gain() -> None:
    found, said = _rig(0)
    top = max(float(s.max()) for s in said)
    fading = [
        replace(c, spread=(60 * (1 - s / top) + 1).astype(np.float32))
        for c, s in zip(found, said, strict=True)
    ]
    assert sensor_noise(fading, said) is None
    assert "sensor_noise" not in {n.name for n in noise_findings(fading, said)}
