"""Noise that captures show is what they are weighed by; steps are told by how far apart codes come again."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.gap.compared.conditions import Condition
from analysis.gap.noise.codes import quantization
from analysis.gap.noise.variance import noise_findings, with_noise
from interchange.effects import Effect
from interchange.effects.fixed_pattern import FixedPattern
from interchange.effects.sensor_noise import SensorNoise
from tests.analysis.gap.test_gap_noise import _rig


def known(*effects: Effect) -> tuple[list[Condition], list[Condition]]:
    """A rig with ``effects``, and the same with what it shows of its noise."""
    found, said = _rig(4, effects, repeats=4)
    return found, with_noise(found, said, noise_findings(found, said))


def test_the_data_sheets_noise_stays() -> None:
    found, same = known()
    assert same is found


def test_noise_is_what_repeats_show_and_the_mean_stays() -> None:
    """Six times the read noise: a third more variance, told to 2 % by 230,000 values of it."""
    found, told = known(SensorNoise(30.0))
    for a, b in zip(found, told, strict=True):
        measured = float(a.spread.mean())
        assert float(a.simulated().temporal.mean()) < 0.8 * measured
        assert float(b.simulated().temporal.mean()) == pytest.approx(measured, rel=0.02)
        assert (a.simulated().dn == b.simulated().dn).all()


def test_a_fixed_pattern_is_what_pixels_show() -> None:
    """PRNU 2 % where the data sheet has 0.4 %: its variance 25 times as large, known to a tenth."""
    found, told = known(FixedPattern(0.02, 1.0))
    for a, b in zip(found, told, strict=True):
        bright = a.simulated().dn > 1000
        more = float((b.simulated().fixed / a.simulated().fixed)[bright].mean())
        assert more == pytest.approx(25, rel=0.1)
        assert b.simulated().temporal == pytest.approx(a.simulated().temporal)


@pytest.mark.parametrize("step", [16, 63])
def test_codes_a_dn_beside_the_steps_are_no_finer_steps(step: int) -> None:
    """Offsets of less than a DN, drawn for each pixel, before codes are rounded for a file: three codes a step."""
    found, _ = _rig(1)
    rng = np.random.default_rng(3)

    def coarse(c: Condition) -> Condition:
        shots = [np.rint(x.pixels / step) * step for x in c.captures]
        shots = [np.rint(s + rng.uniform(-1.2, 1.2, s.shape)) for s in shots]
        return replace(
            c, captures=tuple(replace(x, pixels=s) for x, s in zip(c.captures, shots, strict=True))
        )

    told = quantization([coarse(c) for c in found])
    assert told is not None
    assert told.probability > 0.95
    assert 2 ** (12 - told.parameters["bits"].value) == pytest.approx(step, rel=0.01)
