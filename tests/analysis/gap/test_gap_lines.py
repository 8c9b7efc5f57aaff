"""Uneven columns and rows are found by what both halves of an image say, and nothing else passes for them."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.gap.compared.conditions import Condition
from analysis.gap.compared.state import State
from analysis.gap.light.radiance import Rendered
from analysis.gap.terms.lines import COLUMNS, ROWS, left_of_lines, without_lines
from interchange.camera import Camera, Sensor
from interchange.light import Light, LightKind
from interchange.scene import Scene

LAMP, SIZE = "/lamp", (160, 120)
COLUMN, ROW = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))


def lit(radiance: np.ndarray, t_exp: float) -> Condition:
    """A condition whose captures are the mean that the scene gives: (H, W) of its one lamp."""
    sensor = Sensor(
        SIZE, (1e-6, 1e-6), responsivity=1500.0, full_well=1e4, prnu=0.002, dsnu=1.0, read_noise=5.0
    )
    camera = Camera("/eye", sensor=sensor, t_exp=t_exp)
    scene = Scene(lights=(Light(LAMP, LightKind.SPHERE, (1.0, 1.0, 1.0)),))
    nothing = np.zeros((SIZE[1], SIZE[0], 3), np.float32)
    lamps = {LAMP: np.repeat(radiance[..., None], 3, axis=2).astype(np.float32)}
    shown = Rendered(scene, camera, lamps, {LAMP: np.ones(3)}, nothing, nothing, {}, {})
    bare = Condition(
        (None,) * 4, scene, camera, nothing, None, np.ones(nothing.shape[:2], bool), rendered=shown
    )
    return replace(bare, mean=bare.simulated().dn.astype(np.float64))


def plate() -> np.ndarray:
    return 0.8 - 0.3 * (((COLUMN - 70) / 160) ** 2 + ((ROW - 40) / 120) ** 2)


def captured(radiance: np.ndarray, change, seed: int = 1) -> list[Condition]:
    """At three exposures, ``change(DN above black, generator)`` for the mean, with the sensor's noise and its pixels'
    own pattern."""
    rng = np.random.default_rng(seed)
    own = 1 + 0.002 * rng.standard_normal((*radiance.shape, 3))
    out = []
    for t_exp in (0.3, 0.6, 1.0):
        c = lit(radiance, t_exp)
        noise = np.sqrt(c.simulated().temporal / 4)
        black = c.camera.sensor.black_level
        mean = black + change((c.mean - black) * own) + noise * rng.standard_normal(c.mean.shape)
        out.append(replace(c, mean=mean))
    return out


GAINS = 1 + 0.01 * np.random.default_rng(7).standard_normal((SIZE[0], 1))
OFFSETS = 6 * np.random.default_rng(8).standard_normal((SIZE[0], 1))


@pytest.mark.parametrize(
    ("change", "turned"),
    [
        (lambda s: s * GAINS, False),
        (lambda s: s * np.resize(GAINS, (SIZE[1], 1, 1)), True),
        (lambda s: s + OFFSETS, False),
    ],
    ids=["columns' gains", "rows' gains", "columns' offsets"],
)
def test_lines_are_found_and_taken_out(change, turned: bool) -> None:
    """Within a fifth: 160 draws are off by 6 % of their rms, and the mean over nine takes a ninth of their variance."""
    found = captured(plate(), change)
    evened, told = without_lines([*found[:2], replace(found[2], held_out=True)])
    assert [x.axis for x in told] == [ROWS if turned else COLUMNS]
    axis = 1 if turned else 0
    whole = [c.simulated().dn - c.camera.sensor.black_level for c in found[:2]]
    rms = np.sqrt(np.mean([np.var((change(s) - s).mean(axis=axis)) for s in whole]))
    assert told[0].rms == pytest.approx(rms, rel=0.2)
    assert f"uneven by {told[0].rms:.2g} DN" in str(told[0])
    for c, before in zip(evened, found, strict=True):  # the one that is held out too
        left, was = ((x.mean - x.simulated().dn).mean(axis=axis) for x in (c, before))
        assert not np.any([c.mask[:3], c.mask[-3:]] if turned else [c.mask[:, :3], c.mask[:, -3:]])
        fine = left - np.apply_along_axis(np.convolve, 0, left, np.ones(15) / 15, "same")
        e = c.simulated()
        noise = np.sqrt((e.temporal / 4 + e.fixed).mean() / len(c.mean.swapaxes(0, axis)))
        assert fine[10:-10].std() < np.hypot(
            0.15 * was[10:-10].std(), 2 * noise
        )  # its own and the estimate's


def pixels_alone(s: np.ndarray) -> np.ndarray:
    return s


def shading(s: np.ndarray) -> np.ndarray:
    """Vignetting of 20 % and a lamp that is off: all of it smooth."""
    r2 = ((COLUMN - 80) / 80.0) ** 2 + ((ROW - 60) / 80.0) ** 2
    return s * (1 - 0.1 * r2 + 0.05 * COLUMN / 160)[..., None]


@pytest.mark.parametrize("change", [pixels_alone, shading])
def test_nothing_else_of_a_plate_passes_for_lines(change) -> None:
    for seed in range(5):
        found = captured(plate(), change, seed)
        evened, told = without_lines(found)
        assert told == ()
        assert evened == found


@pytest.mark.parametrize("off", [0.3, 1.0])
def test_edges_that_are_off_do_not(off: float) -> None:
    """Upright edges through both halves, in the captures ``off`` px further."""

    def stripes(shift: float) -> np.ndarray:
        return plate() * (
            0.6 + 0.4 * np.clip((COLUMN - shift) % 40 - 20, 0, 1) - 0.2 * ((COLUMN - shift) % 40 > 39)
        )

    here, there = stripes(0.0), stripes(off)
    moved = [
        replace(c, mean=c.mean + d.mean - e.mean)
        for c, d, e in zip(
            captured(here, pixels_alone),
            captured(there, pixels_alone),
            captured(here, pixels_alone),
            strict=True,
        )
    ]
    assert without_lines(moved)[1] == ()


def test_what_is_left_of_lines_is_as_large_as_their_slow_waves() -> None:
    """Amplitudes of cosines of white noise, rms over 400 draws, against the widths; fields are those cosines."""
    evened, told = without_lines(captured(plate(), lambda s: s + OFFSETS))
    terms = left_of_lines(evened)
    offsets = [t for t in terms if t.unit == "DN"]
    assert len(terms) == 2 * len(offsets) == 2 * round(2 * SIZE[0] / 60)
    drawn = told[0].rms * np.random.default_rng(3).standard_normal((400, SIZE[0]))
    state = State(evened[0])
    for t in offsets:
        wave = t.field(state)[5, :, 0]
        amplitude = drawn @ wave / (wave @ wave)
        assert t.spike == pytest.approx(np.sqrt(np.mean(amplitude**2)), rel=0.12)  # 400 draws: 3.5 %
    assert left_of_lines(captured(plate(), pixels_alone)) == []


def test_where_edges_are_everywhere_nothing_is_told() -> None:
    found = captured(plate() * (0.5 + 0.5 * (COLUMN // 4 % 2)), lambda s: s * GAINS)
    with np.errstate(all="raise"):
        assert without_lines(found)[1] == ()
