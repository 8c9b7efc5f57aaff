"""The chain in few passes is the chain step by step, and its random numbers are those that they stand for."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.special import ndtri

from interchange.camera import Camera, Lens, Sensor
from interchange.effects.motion_blur import MotionBlur
from interchange.exposure import expose
from interchange.image import Image, Quantity

SIZE = (331, 277)  # odd, and more than two bands of rows
SENSOR = Sensor(
    SIZE, (3.45e-6, 3.45e-6), responsivity=9000, full_well=10000, bit_depth=12, black_level=64, read_noise=2.5,
    prnu=0.006, dsnu=1.1, dark_current=40.0, prnu_row=0.001, prnu_column=0.002, dsnu_row=0.3, dsnu_column=0.5,
    hot_pixels=(1e-3, 300.0), serial_number="1",
)  # fmt: skip
CROSSTALK = {"color_crosstalk": (0.05, 0.01, 0.05, 0.05, 0.01, 0.05), "white_balance": (1.6, 1, 1.9)}
SRGB = {
    **CROSSTALK,
    "color_correction": (1.5, -0.4, -0.1, -0.2, 1.4, -0.2, 0, -0.5, 1.5),
    "response": "sRGB",
    "output_bit_depth": 8,
}
PLAIN = Lens(0.016, vignetting=(-0.3, 0.05), blur=0.7, veiling_glare=(0.02,))
FULL = replace(
    PLAIN,
    f_stop=5.6,
    diffraction=True,
    lateral_chromatic_aberration=(2e-3, -3e-3, 1e-3),
    axial_chromatic_aberration=(2.0, 0.0, 3.0),
    field_blur=(0.5, 4.0, 2.0, 0.4),
    veiling_glare=(0.02, 0.01, 0.1, 0.006),
)


def scene(seed=0):
    y, x = np.mgrid[: SIZE[1], : SIZE[0]]
    grey = 0.4 + 0.3 * np.sin(x / 20) * np.cos(y / 30) + 0.2 * ((x // 32 + y // 32) % 2)
    grain = np.random.default_rng(seed).uniform(0.9, 1.1, (*grey.shape, 3))
    return Image((grey[..., None] * grain * (1, 0.8, 0.5)).astype(np.float32))


CASES = {
    "mono": (Lens(), {"mosaic": "mono"}),
    "mono, lens": (PLAIN, {"mosaic": "mono"}),
    "mono, colours apart": (FULL, {"mosaic": "mono", "spectral_response": (0.8, 1, 0.6), "response": "sRGB"}),
    "raw": (PLAIN, {"mosaic": "GBRG", "demosaic": "none", **CROSSTALK}),
    "bilinear": (FULL, {"mosaic": "RGGB", **SRGB}),
    "edge aware": (FULL, {"mosaic": "GRBG", "demosaic": "edge_aware", **SRGB}),
    "JPEG": (FULL, {"mosaic": "BGGR", "jpeg_quality": 90, **SRGB}),
    "three sensors": (FULL, SRGB),
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("until", list(Quantity)[1:])
def test_few_passes_are_the_steps_one_by_one(case, until):
    """To 1e-4 of the highest light: neighbouring convolutions made one are approached by fewer separable terms than
    each by itself, and single precision is 3e-7 of it. In the outer 20 px the border goes on after each, or after all:
    1 %. So much light turns few roundings, by one DN, which sRGB's slope in the dark makes 3; a DN that crosses an
    edge-aware demosaic's threshold or a JPEG's is some more."""
    lens, sensor = CASES[case]
    camera = Camera(lens=lens, sensor=replace(SENSOR, **sensor), t_exp=1.1)
    moved = (MotionBlur(2.5, -1.0),) if case in ("bilinear", "mono, lens") else ()
    got, want = (
        expose(scene(), camera, until=until, effects=moved, step_by_step=plain).pixels
        for plain in (False, True)
    )
    assert got.shape == want.shape
    apart, inner = np.abs(got - want), (slice(20, -20), slice(20, -20))
    if until is Quantity.DN:
        turned, most = {"edge aware": (0.02, 5), "JPEG": (0.15, 8)}.get(case, (0.06, 3))
        assert (apart[inner] > 0).mean() < turned
        assert apart[inner].max() <= most
    else:
        assert apart[inner].max() < (1e-4 if lens != Lens() and case != "raw" else 1e-6) * want.max()
        assert apart.max() < 0.01 * want.max()


def test_sites_alone_are_evaluated_where_nothing_mixes_channels():
    """A light that only red sees leaves green and blue sites dark, and a depth-of-field blur before is done whole."""
    camera = Camera(lens=Lens(0.016, blur=0.7), sensor=replace(SENSOR, mosaic="RGGB"), t_exp=1.0)
    red = Image(np.full((SIZE[1], SIZE[0], 3), (0.5, 0, 0), np.float32))
    e = expose(red, camera, until=Quantity.ELECTRONS).pixels[..., 0]
    assert e[0::2, 0::2].mean() == pytest.approx(0.5 * 9000 + 40, rel=0.01)
    assert abs(e[1::2, 1::2].mean() - 40) < 1
    near = replace(camera, lens=Lens(0.016, f_stop=4, focus_distance=0.5, vignetting=(-0.2,)))
    deep = replace(scene(), passes={"depth": np.full(SIZE[::-1], 0.51, np.float32)})
    got, want = (expose(deep, near, until=Quantity.ELECTRONS, step_by_step=s).pixels for s in (False, True))
    assert got == pytest.approx(want, rel=1e-5, abs=1e-2)


def test_normal_numbers_are_the_inverse_distribution_of_their_bits():
    """Every number against scipy's; the polynomials are good to 1e-6, single precision to 4e-7 of the far ones."""
    from interchange import readout_kernels as rk

    z, w, words = rk.aligned(rk.PART), rk.aligned(rk.PART), np.empty(rk.PART // 2, np.uint64)
    everything = []
    for part in range(400):
        rk.normal(np.uint64(11), part * rk.PART, z, words, w)
        bits = words.view(np.uint32)
        want = -ndtri(((bits >> 1) + 0.5) * 2.0**-32) * np.where(bits & 1, 1, -1)
        assert np.abs(z - want).max() < 4e-6
        everything.append(z.astype(np.float64))
    z = np.concatenate(everything)
    n = len(z)  # moments 1 to 4 within 4 sigma of those of n normal numbers
    for power, mean, variance in ((1, 0, 1), (2, 1, 2), (3, 0, 15), (4, 3, 96)):
        assert abs((z**power).mean() - mean) < 4 * np.sqrt(variance / n)
    lag = [np.mean(z[k:] * z[:-k]) for k in (1, 2, 64, 1024)]
    assert np.abs(lag).max() < 4.5 / np.sqrt(n)


@pytest.mark.parametrize("electrons", [0.4, 7.0, 25.0, 2000.0])
def test_read_out_noise_has_the_moments_of_poisson_and_normal(electrons):
    """Mean, variance, third and fourth cumulant of Poisson(λ) + N(0, σ²): λ, λ + σ², λ, λ; 4.5 σ of 10⁶ draws, and
    what one normal variable in place of it misses of the fourth, λ - 3 (...): under 0.06 of the variance squared."""
    sigma, size = 2.0, (1000, 1000)
    c = Camera(
        sensor=Sensor(
            size, responsivity=electrons, read_noise=sigma, full_well=1e7, bit_depth=12, mosaic="mono"
        ),
        t_exp=1.0,
    )
    flat = Image(np.ones((size[1], size[0], 1), np.float32))
    x = expose(flat, c, rng=np.random.default_rng(1), until=Quantity.ELECTRONS).pixels.astype(np.float64)
    v, n = electrons + sigma**2, x.size
    d = x - electrons
    assert d.mean() == pytest.approx(0, abs=4.5 * np.sqrt(v / n))
    assert (d**2).mean() / v == pytest.approx(1, abs=4.5 * np.sqrt((2 + 1 / v) / n))
    assert (d**3).mean() / v**1.5 == pytest.approx(electrons / v**1.5, abs=4.5 * np.sqrt((15 + 30 / v) / n))
    assert (d**4).mean() / v**2 - 3 == pytest.approx(electrons / v**2, abs=0.06)


def test_frames_of_one_seed_are_the_same_and_of_two_are_not_correlated():
    camera = Camera(lens=PLAIN, sensor=replace(SENSOR, mosaic="mono"), t_exp=1.0)
    a, b, other = (
        expose(scene(), camera, rng=np.random.default_rng(s), until=Quantity.ELECTRONS).pixels.ravel()
        for s in (3, 3, 4)
    )
    mean = expose(scene(), camera, until=Quantity.ELECTRONS).pixels.ravel()
    assert np.array_equal(a, b)
    assert abs(np.corrcoef(a - mean, other - mean)[0, 1]) < 4.5 / np.sqrt(a.size)


@pytest.mark.parametrize("pattern", ["RGGB", "BGGR", "GRBG", "GBRG"])
@pytest.mark.parametrize("size", [(3, 3), (64, 37), (40, 100)])
def test_colours_of_a_mosaic_are_opencvs(pattern, size):
    """Bilinear, bit by bit, border included."""
    from interchange import readout_kernels as rk
    from interchange.effects.mosaic import phases

    raw = np.random.default_rng(0).integers(0, 4096, size).astype(np.uint16)
    out = np.empty((*size, 3), np.float32)
    row, column = next((i, j) for i, j, channel in phases(pattern_of(pattern)) if channel == 0)
    identity = np.eye(3, dtype=np.float32), np.zeros(3, np.float32), np.arange(4096, dtype=np.float32)
    rk.developed(raw, 0, size[0], row, column, *identity, out)
    assert np.array_equal(out, cv2.demosaicing(raw, getattr(cv2, f"COLOR_Bayer{pattern}2RGB")))


def pattern_of(name):
    from interchange.sensor import Mosaic

    return Mosaic(name)
