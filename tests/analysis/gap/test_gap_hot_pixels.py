"""Hot pixels, found in captures by the sensor's own model; 160 x 120 px, no renderer."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.gap.compared.conditions import Condition
from analysis.gap.light.radiance import Rendered
from analysis.gap.measures.ledger import temporal_scale
from analysis.gap.noise.hot_pixels import HotPixels, hot_pixels, numbers, places
from analysis.gap.noise.pixel_map import pixel_maps
from analysis.gap.noise.variance import noise_findings, with_noise
from interchange.camera import Camera, Sensor
from interchange.captures import Capture
from interchange.effects import Effect
from interchange.effects.hot_pixels import HotPixels as Model
from interchange.effects.hot_pixels import hot
from interchange.exposure import expose
from interchange.image import Image
from interchange.light import Light, LightKind
from interchange.scene import Scene

H, W, C = 120, 160, 3
SHEET = Sensor((W, H), (5e-6, 5e-6), responsivity=8000.0, full_well=1e4, black_level=64, read_noise=5, prnu=0.004,
               dsnu=1.0, bit_depth=12)  # fmt: skip
EXPOSURES = ((1.0, 0.2), (1.0, 1.0), (0.0, 1.0), (0.0, 0.2), (0.5, 1.0))  # radiance, s
ALIKE = ((1.0, 0.2), (1.0, 0.4), (1.0, 0.6), (1.0, 0.8), (1.0, 1.0))


def _rig(
    seed: int, *effects: Effect, sheet: Sensor = SHEET, shots: tuple[tuple[float, float], ...] = EXPOSURES
) -> tuple[list[Condition], list[np.ndarray]]:
    """A lamp of three powers, at two exposures, twice each."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:H, :W] / H
    plane = (np.where((x * 8).astype(int) % 2, 0.9, 0.45) / (1 + x**2 + y**2))[..., None].repeat(C, axis=2)
    full = Scene(lights=(Light("/A", LightKind.SPHERE, (1.0,) * 3),))
    nothing = np.zeros((H, W, C), np.float32)
    found = []
    for k, (power, t_exp) in enumerate(shots):
        camera = Camera("/Top", sensor=replace(sheet, serial_number=str(seed)), t_exp=t_exp)
        shown = Rendered(
            full, camera, {"/A": plane.astype(np.float32)}, {"/A": np.ones(3)}, nothing, nothing, {}, {}
        )
        scene = replace(full, lights=tuple(replace(light, intensity=(power,) * 3) for light in full.lights))
        image = Image(shown.radiance(scene))
        frames = np.stack([expose(image, camera, rng=rng, effects=effects).pixels for _ in range(2)])
        captures = tuple(Capture(f"{k}_{i}.png", "/Top", 0, t_exp, s, bits=16) for i, s in enumerate(frames))
        spread, mask = frames.var(axis=0, ddof=1), np.ones((H, W), bool)
        found.append(Condition(captures, scene, camera, frames.mean(axis=0), spread, mask, rendered=shown))
    return found, [c.simulated().dn for c in found]


def test_there_are_none_where_there_are_none() -> None:
    """10 seeds of 57600 pixels; a pattern twice the data sheet's among them."""
    for seed in range(10):
        sheet = replace(SHEET, prnu=0.008, dsnu=4.0) if seed % 2 else SHEET
        assert hot_pixels(*_rig(seed, sheet=sheet)) == {}


def test_places_share_and_current_are_those_of_the_sensors_model() -> None:
    """115 pixels in the mean of 300 e-/s at 8 seeds: none that is not hot, all of 6 σ and more; numbers with z of rms 1
    within what 16 values tell (0.55 to 1.5 at 99 %)."""
    z = []
    for seed in range(8):
        conditions, simulations = _rig(seed, Model(2e-3, 300.0))
        (found,) = hot_pixels(conditions, simulations).values()
        assert found.probability > 0.99
        place, strength = hot(str(seed), 2e-3, (H, W, C))
        true = np.zeros(H * W * C)
        true[place] = 300 * strength
        told = found.current.reshape(-1)
        assert (true[told > 0] > 0).all()
        assert (told[true > 2 * found.limit.max()] > 0).mean() > 0.95  # but in neighbours of each other
        off = told[told > 0] - true[told > 0]
        assert abs(off.mean()) < 3 * off.std() / np.sqrt(len(off)) + 1.0
        values = numbers({"/Top": found})
        z += [
            (values[n].value - want) / values[n].sigma
            for n, want in (("hot_share", 2e-3), ("hot_current", 300.0))
        ]
    assert 0.5 < np.sqrt(np.mean(np.square(z))) < 1.5


def test_a_speck_a_highlight_and_a_constant_offset_are_not_hot() -> None:
    conditions, simulations = _rig(0)
    power = [p for p, _ in EXPOSURES]
    for k, c in enumerate(conditions):
        s = simulations[k] - SHEET.black_level
        c.mean[30, 30] += 0.5 * s[30, 30]  # of the surface
        c.mean[60, 60] += 200.0  # of every image
        if power[k] == 0.5:
            c.mean[90, 90] += 300.0  # of one lamp's alone
    assert hot_pixels(conditions, simulations) == {}


def test_hot_pixels_are_a_fixed_pattern_and_no_noise_and_their_map_closes_the_gap() -> None:
    conditions, simulations = _rig(1, Model(2e-3, 300.0))
    found = {n.name: n for n in noise_findings(conditions, simulations)}
    assert found["fixed_pattern"].probability > 0.99
    assert set(found["fixed_pattern"].parameters) >= {"hot_share", "hot_current"}
    assert found["sensor_noise"].probability < 0.05
    shown = with_noise(conditions, simulations, list(found.values()))
    kept = [c if k != 1 else replace(c, held_out=True) for k, c in enumerate(shown)]
    maps = pixel_maps(kept, simulations)
    (after,) = maps.applied([kept[1]], [simulations[1]])
    sites = maps.hot["/Top"] > 0
    before, left = ((conditions[1].mean - x)[sites] for x in (simulations[1], after))
    noise = np.sqrt(conditions[1].simulated().temporal[sites] / 2)
    assert np.sqrt(np.mean((before / noise) ** 2)) > 5
    assert np.sqrt(np.mean((left / noise) ** 2)) < 1.4  # two repeats of it in what they are told from


def test_under_one_light_nothing_is_told() -> None:
    """Specks all over a picture that is longer and longer exposed; and hot pixels, that nothing tells from them."""
    for effects, specks in (((), 3000), ((Model(2e-3, 300.0),), 0)):
        conditions, simulations = _rig(3, *effects, shots=ALIKE)
        place = np.random.default_rng(0).choice(H * W, specks, replace=False)
        for c, s in zip(conditions, simulations, strict=True):
            c.mean.reshape(-1, C)[place] += 3 * (s - SHEET.black_level).reshape(-1, C)[place]
        assert hot_pixels(conditions, simulations) == {}


@pytest.mark.parametrize("exposures", [1, 3])
def test_one_exposure_or_few_conditions_tell_nothing(exposures: int) -> None:
    conditions, simulations = _rig(2, Model(2e-3, 300.0))
    own = [k for k, (_, t) in enumerate(EXPOSURES) if t == 1.0] if exposures == 1 else [0, 1, 2]
    assert hot_pixels([conditions[k] for k in own], [simulations[k] for k in own]) == {}


def test_numbers_add_up_over_cameras() -> None:
    plane = np.zeros((10, 10, 1), np.float32)
    plane[0, :4, 0] = 110.0
    a = HotPixels(plane, np.full(4, 10.0))
    told = numbers({"a": a, "b": a})
    assert told["hot_current"].value == pytest.approx(100)
    assert told["hot_share"].value == pytest.approx(0.04 * np.exp(0.1))
    assert told["hot_share"].sigma == pytest.approx(told["hot_share"].value / np.sqrt(8))


def test_a_tail_that_begins_far_out_is_told_as_it_is_seen() -> None:
    """9 of 100 pixels, 100 e-/s beyond a limit of 1000: e^10 times as many below it would be 200000 %."""
    plane = np.zeros((10, 10, 1), np.float32)
    plane[0, :9, 0] = 1100.0
    far = HotPixels(plane, np.full(9, 1000.0))
    assert far.share == pytest.approx(0.09)
    assert far.mean == pytest.approx(1100)


def test_noise_that_the_sheet_does_not_have_is_no_hot_pixel() -> None:
    """An ideal sensor's sheet beside captures of 10 e- read noise: the EMVA reference's had 9 of 19200."""
    shots = tuple((power, t) for power in (0.0, 0.3) for t in (0.1, 0.2, 0.4, 0.6, 0.8, 1.0))
    for seed in range(4):
        conditions, _ = _rig(seed, sheet=replace(SHEET, read_noise=10), shots=shots)
        ideal = replace(SHEET, read_noise=0, prnu=0, dsnu=0, serial_number=str(seed))
        conditions = [replace(c, camera=replace(c.camera, sensor=ideal)) for c in conditions]
        assert hot_pixels(conditions, [c.simulated().dn for c in conditions]) == {}


def test_a_sentence_says_which_pixels_are_hot() -> None:
    plane = np.zeros((10, 30, 1), np.float32)
    plane[2, 5:28, 0] = np.arange(100, 123)
    (told,) = places({"/World/Top": HotPixels(plane, np.full(23, 10.0))})
    assert told.startswith("Of Top 23 pixels are hot")
    assert "neighbours': (27, 2) 122, (26, 2) 121, " in told
    assert told.endswith("(8, 2) 103 and 3 more.")


def test_hot_pixels_of_dark_frames_do_not_tell_the_noise() -> None:
    """Of one channel, without a black level, they are all that is above DN 0 there; where there is light noise is the
    sheet's, to five times what 19200 values know."""
    sheet = replace(SHEET, black_level=0)
    dark, _ = _rig(0, Model(2e-3, 300.0), sheet=sheet, shots=((0.0, 0.2), (0.0, 1.0)))
    light, _ = _rig(0, Model(2e-3, 300.0), sheet=sheet, shots=((1.0, 0.2),))
    dark, light = (
        [replace(c, mean=c.mean[..., :1], spread=c.spread[..., :1]) for c in some] for some in (dark, light)
    )
    assert max(c.mean.max() for c in dark) > 100
    assert temporal_scale(dark) is None
    assert temporal_scale([*dark, *light]) == pytest.approx(1, abs=5 * np.sqrt(2 / (H * W)))
