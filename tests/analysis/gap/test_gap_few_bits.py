"""Files of fewer bits than the camera's converter: their black level, gain and noise are those of the files."""

import numpy as np
import pytest

from analysis.gap.sensor.expected import expected, noise_variance
from interchange.camera import Camera, Sensor

EIGHT = Sensor(
    (64, 64), (5e-6, 5e-6), 2e4, 1e4, black_level=64, read_noise=11, bit_depth=12, output_bit_depth=8
)
CAMERA = Camera("/World/eye", sensor=EIGHT)


def test_black_and_gain_of_files_of_fewer_bits() -> None:
    assert EIGHT.black_out == pytest.approx(64 * 255 / 4095)
    assert EIGHT.K_out == pytest.approx(EIGHT.K * 255 / 4095)
    dark = expected(np.zeros((64, 64, 3), np.float32), CAMERA)
    assert dark.dn == pytest.approx(dark.black, abs=1e-3)


@pytest.mark.parametrize("read_noise", [5.0, 11.0, 25.0])
def test_rounding_is_never_more_than_is_expected(read_noise: float) -> None:
    """Dark noise of 0.1, 0.3 and 0.6 DN of the files, rounded: its variance about means from a code to the next is at
    most what is expected, and reaches it half way."""
    sensor = Sensor((64, 64), (5e-6, 5e-6), 2e4, 1e4, black_level=64, read_noise=read_noise, bit_depth=12,
                    output_bit_depth=8)  # fmt: skip
    temporal, fixed = noise_variance(
        np.full((1, 1, 1), sensor.black_out), Camera("/World/eye", sensor=sensor)
    )
    sigma = sensor.K_out * read_noise
    assert temporal == pytest.approx(sigma**2 + 1 / 12, rel=0.02)
    rng = np.random.default_rng(0)
    phases = np.linspace(0, 1, 41)
    rounded = [np.rint(x + sigma * rng.standard_normal(100_000)) for x in phases]
    measured = np.array([y.var() for y in rounded])
    off = np.array([((y - x) ** 2).mean() for x, y in zip(phases, rounded, strict=True)])
    assert off[:-1].mean() == pytest.approx(sigma**2 + 1 / 12, rel=0.03)
    assert measured.max() < 1.03 * float((temporal + fixed).item())
    assert float((temporal + fixed).item()) < 1.3 * measured.max()
