"""What the lens and time do to irradiance, against closed forms. Images are small and smooth or single points."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from interchange.camera import Camera, Lens, Sensor
from interchange.effects.axial_chromatic_aberration import AxialChromaticAberration
from interchange.effects.defocus import Defocus
from interchange.effects.diffraction import Diffraction
from interchange.effects.lateral_chromatic_aberration import LateralChromaticAberration
from interchange.effects.veiling_glare import VeilingGlare
from interchange.effects.vignetting import Vignetting
from interchange.exposure import expose
from interchange.filtering import airy, airy_kernel, convolve, diffraction_mtf, disc
from interchange.image import Image, Quantity

SIZE = (101, 81)
CAMERA = Camera(sensor=Sensor(SIZE, (5e-6, 5e-6)), lens=Lens(0.025))


def point(column=50, row=40, channels=3):
    L = np.zeros((SIZE[1], SIZE[0], channels), np.float32)
    L[row, column] = 1
    return Image(L)


def blobs(places, sigma=3.0, channels=3):
    """Gaussian spots at (column, row)."""
    y, x = np.mgrid[: SIZE[1], : SIZE[0]]
    L = sum(np.exp(-((x - c) ** 2 + (y - r) ** 2) / (2 * sigma**2)) for c, r in places)
    return Image(np.repeat(L[..., None], channels, 2).astype(np.float32))


def moments(plane):
    """Centroid (column, row) and variance along columns and rows, px²."""
    y, x = np.mgrid[: plane.shape[0], : plane.shape[1]]
    total = plane.sum(dtype=np.float64)
    cx, cy = (plane * x).sum() / total, (plane * y).sum() / total
    return (cx, cy), ((plane * (x - cx) ** 2).sum() / total, (plane * (y - cy) ** 2).sum() / total)


def test_a_flat_field_falls_off_as_its_numbers_say():
    lens = Lens(vignetting=(-0.31, 0.05))
    c = replace(CAMERA, lens=lens, principal_point=(44.0, 47.0))
    E = expose(Image(np.ones((81, 101, 3), np.float32)), c, until=Quantity.IRRADIANCE).pixels[..., 1]
    for column, row in ((0, 0), (100, 80), (44, 47), (90, 3)):
        r2 = ((column - 44) ** 2 + (row - 47) ** 2) / ((101**2 + 81**2) / 4)
        assert E[row, column] == pytest.approx(1 - 0.31 * r2 + 0.05 * r2**2, rel=1e-6)


def test_natural_vignetting_is_cos_to_the_fourth():
    """To the next term, 4 tan⁶ θ: 1e-6 at the corner of a half angle of 4.6 degrees."""
    lens = Lens(4e-3)
    E = Vignetting.natural(replace(CAMERA, lens=lens)).apply(
        Image(np.ones((81, 101, 3), np.float32)), replace(CAMERA, lens=lens), None
    )
    theta = np.arctan(np.hypot(50, 40) * 5e-6 / 4e-3)
    assert E.pixels[0, 0, 0] == pytest.approx(np.cos(theta) ** 4, abs=4 * np.tan(theta) ** 6 + 1e-7)


def test_red_and_blue_are_imaged_larger_and_smaller():
    """Centroids of spots, which their own magnification moves by some 0.008 px (9 px² times its gradient)."""
    effect = LateralChromaticAberration(
        red=0.02, blue=-0.015, red3=0.01, blue3=0.005, red_u=0.02, red_v=-0.03, blue_u=-0.01
    )
    unit = np.hypot(101, 81) / 2
    for place in ((80.0, 60.0), (20.0, 40.0), (50.0, 65.0)):
        out = effect.apply(blobs([place]), CAMERA, None).pixels
        d = np.array(place) - (50, 40)
        r2 = (d @ d) / ((101**2 + 81**2) / 4)
        for channel, c, c3, aside in (
            (0, 0.02, 0.01, (0.02, -0.03)), (1, 0, 0, (0, 0)), (2, -0.015, 0.005, (-0.01, 0))
        ):  # fmt: skip
            centroid, _ = moments(out[..., channel])
            assert centroid == pytest.approx(
                (50, 40) + d * (1 + c + c3 * r2) + unit * np.array(aside), abs=0.01
            )


def test_a_channel_is_moved_by_its_shifts():
    """A ramp shows where its light comes from: the column, less how far it was moved."""
    camera = Camera("/eye", sensor=Sensor((100, 80), (5e-6, 5e-6)))
    effect = LateralChromaticAberration(0.01, -0.006, 0.004, 0.002, red_u=0.003, blue_v=-0.002)
    column, row = np.meshgrid(np.arange(100.0), np.arange(80.0))
    moved = effect.shifts(camera)
    inner = np.s_[8:-8, 8:-8]
    for axis, ramp in enumerate((column, row)):
        image = Image(np.repeat(ramp[..., None], 3, axis=2).astype(np.float32), Quantity.RADIANCE, camera)
        shown = effect.apply(image, camera, None).pixels
        assert ramp[..., None][inner] - shown[inner] == pytest.approx(moved[..., axis][inner], abs=2e-3)
    assert np.abs(moved).max() > 0.5


@pytest.mark.parametrize("diameter", [0.3, 1.7, 2.9, 3.0, 3.5, 6.5, 20.0])
def test_a_disc_has_the_second_moment_of_a_disc(diameter):
    """d²/16 along each axis; a disc of few pixels is drawn by 1/16 px, which leaves some per cent."""
    out = convolve(point(channels=1).pixels, disc(diameter))[..., 0]
    assert out.sum() == pytest.approx(1, rel=1e-5)
    assert moments(out)[1] == pytest.approx((diameter**2 / 16,) * 2, rel=0.07 if 3 < diameter < 5 else 0.02)


@pytest.mark.parametrize("sigma", [0.1, 0.4, 1.3, 5.0])
def test_a_gaussian_blur_has_its_variance(sigma):
    """However narrow; to the 6e-5 of the light beyond four sigma, which has 16 times the variance and more."""
    blurred = Defocus(sigma).apply(point(channels=1), CAMERA, None).pixels[..., 0]
    assert moments(blurred)[1] == pytest.approx((sigma**2,) * 2, rel=2e-3)


def test_neighbouring_convolutions_are_applied_as_one():
    """The chain's result is that of its effects one after the other, to single precision and the separable terms'."""
    lens = Lens(f_stop=5.6, diffraction=True, blur=0.8, axial_chromatic_aberration=(2.0, 0.0, 3.0))
    c = replace(CAMERA, lens=lens)
    L = Image(np.random.default_rng(0).uniform(0, 1, (81, 101, 3)).astype(np.float32))
    got = expose(L, c, until=Quantity.IRRADIANCE).pixels / lens.projected_solid_angle
    one = L
    for effect in (AxialChromaticAberration(2.0, 0.0, 3.0), Defocus(0.8), Diffraction(5.6)):
        one = effect.apply(one, c, None)
    inner = (slice(15, -15), slice(15, -15))  # at the border the image goes on after each, or after all
    assert got[inner] == pytest.approx(one.pixels[inner], abs=3e-3)


def test_axial_aberration_blurs_each_channel_by_its_own_disc():
    shifts = (30e-6, 0.0, -60e-6)  # m behind the sensor, at f/2: discs of 15 and 30 µm, 3 and 6 px
    c = replace(CAMERA, lens=Lens(f_stop=2.0))
    effect = AxialChromaticAberration.shifted(c, shifts)
    assert (effect.red, effect.green, effect.blue) == pytest.approx((3, 0, 6))
    out = effect.apply(point(), c, None).pixels
    assert np.array_equal(out[..., 1], point().pixels[..., 1])
    assert moments(out[..., 2])[1] == pytest.approx((36 / 16,) * 2, rel=0.02)


def test_diffraction_is_airys():
    """First dark ring at 1.22 λ N, 83.8 % of the light within it, second at 2.233 λ N, 91.0 %; Born and Wolf 8.5.2."""
    r0 = 1.2196698912665045
    assert airy(np.array([r0]), r0) == pytest.approx(0, abs=1e-12)
    assert airy(np.array([2.2331]), r0) == pytest.approx(0, abs=1e-7)
    total = 4 / np.pi  # ∫ (2 J1(πr) / πr)² 2π r dr over the plane
    for radius, share in ((r0, 0.838), (2.2331, 0.910)):
        within = quad(lambda r: float(airy(np.array(r), r0)) * 2 * np.pi * r, 0, radius)[0]
        assert within / total == pytest.approx(share, abs=5e-4)


def test_the_first_dark_ring_lies_at_1_22_lambda_n_on_the_sensor():
    """On pixels of a tenth of λ N, by the image of a point: its darkest radius to half a pixel."""
    c = Camera(
        lens=Lens(f_stop=8.0, focus_distance=1.0, diffraction=True),
        sensor=Sensor((101, 101), (0.44e-6, 0.44e-6), wavelength_nm=550, mosaic="mono"),
    )
    L = np.zeros((101, 101, 1), np.float32)
    L[50, 50] = 1
    out = expose(Image(L, camera=c), c, until=Quantity.IRRADIANCE).pixels[50, 50:, 0]
    ring = 1.21967 * 550e-9 * 8 / 0.44e-6
    assert ring == pytest.approx(12.2, abs=0.01)
    assert abs(int(np.argmin(out[5:18])) + 5 - ring) <= 0.5
    assert out[round(ring)] < 1e-3 * out[0]


@pytest.mark.parametrize("spread", [0.05, 0.3, 1.3, 4.0])
def test_kernels_keep_the_light(spread):
    kernel = airy_kernel(spread)
    assert kernel.sum() == pytest.approx(1, abs=1e-5)
    assert np.array_equal(kernel, kernel[::-1, ::-1])
    assert np.array_equal(kernel, kernel.T)


@pytest.mark.parametrize("spread", [0.3, 0.9, 1.8])
def test_diffraction_has_its_contrast(spread):
    """Sines through the kernel against the closed form: to 0.014, by which the light folded back raises it."""
    x = np.arange(256)
    for cycles in (4, 16, 40, 80):
        f = cycles / 256
        L = np.broadcast_to(1 + np.sin(2 * np.pi * f * x), (64, 256)).astype(np.float32)[..., None]
        row = convolve(L, airy_kernel(spread))[32, 64:192, 0]  # whole periods, away from the border
        fitted = 2 * np.abs(np.mean((row - 1) * np.exp(-2j * np.pi * f * x[64:192])))
        assert fitted == pytest.approx(diffraction_mtf(np.array(f * spread)), abs=0.015)


def test_separable_sums_are_the_convolution():
    """Against the plain sum over the kernel, to the share of the kernel's norm that may be missed."""
    kernel = airy_kernel(1.3)
    x = np.random.default_rng(0).uniform(0, 1, (60, 70, 1)).astype(np.float32)
    k = kernel.shape[0] // 2
    padded = np.pad(x[..., 0], k, mode="edge").astype(np.float64)
    windows = np.lib.stride_tricks.sliding_window_view(padded, kernel.shape)
    exact = np.einsum("ijkl,kl->ij", windows, kernel)
    assert convolve(x, kernel)[..., 0] == pytest.approx(exact, abs=1.5e-3)


def test_defocus_by_depth_is_the_thin_lens():
    """c = f² |z - z_f| / (N z (z_f - f)) of a lens of focal length f; its principal distance is v = f z_f / (z_f - f),
    its aperture v / N (both renderers' convention)."""
    f, z_f, N, pitch = 0.025, 0.40, 4.0, 5e-6
    v = f * z_f / (z_f - f)
    c = replace(CAMERA, lens=Lens(v, f_stop=N, focus_distance=z_f))
    for z in (0.36, 0.45):
        depth = np.full((81, 101), z, np.float32)
        out = expose(replace(point(), passes={"depth": depth}), c, until=Quantity.IRRADIANCE).pixels[..., 0]
        diameter = (v / f) * f**2 * abs(z - z_f) / (N * z * (z_f - f)) / pitch
        assert moments(out / out.sum())[1] == pytest.approx((diameter**2 / 16,) * 2, rel=0.03)


def test_defocus_leaves_an_even_field_even_and_a_sharp_edge_in_front_sharp():
    c = replace(CAMERA, lens=Lens(0.025, f_stop=2.0, focus_distance=0.4))
    x = np.arange(101)
    slope = np.broadcast_to(np.linspace(0.38, 0.43, 101, dtype=np.float32), (81, 101))
    even = Defocus(0, 2.0, 0.4).apply(
        Image(np.full((81, 101, 3), 7, np.float32), passes={"depth": slope}), c, None
    )
    assert even.pixels == pytest.approx(7, rel=1e-4)
    depth = np.where(x[None, :] < 50, 0.4, 0.45).astype(np.float32) * np.ones((81, 1), np.float32)
    L = np.where(x[None, :, None] < 50, 1.0, 3.0 + 2 * (x[None, :, None] % 2)) * np.ones((81, 1, 3))
    out = Defocus(0, 2.0, 0.4).apply(Image(L.astype(np.float32), passes={"depth": depth}), c, None).pixels
    assert out[40, :49, 0] == pytest.approx(1, abs=1e-3)  # what is in focus hides what lies behind it
    assert np.ptp(out[40, 70:95, 0]) < 0.3  # stripes of 2 behind the focus are blurred away


def test_a_renderers_own_depth_of_field_is_not_applied_twice():
    lens = Lens(0.025, f_stop=2.0, focus_distance=0.4)
    drawn = Image(
        point().pixels, camera=replace(CAMERA, lens=lens), passes={"depth": np.full((81, 101), 0.3)}
    )
    out = expose(drawn, until=Quantity.IRRADIANCE)
    assert (out.pixels > 0).sum() == 3


def test_glare_is_a_share_of_the_mean():
    L = np.zeros((80, 100, 3), np.float32)
    L[:, :50] = (4, 2, 1)
    c = replace(CAMERA, sensor=Sensor((100, 80)))
    out = VeilingGlare(0.03).apply(Image(L), c, None).pixels
    assert out[0, 99] == pytest.approx(0.03 * np.array([2, 1, 0.5]), rel=1e-5)
    assert out.mean() == pytest.approx(L.mean(), rel=1e-5)
    near = VeilingGlare(halo=0.03, reach=0.03).apply(Image(L), c, None).pixels
    assert near[40, 52, 0] > 5 * near[40, 95, 0] > 0
    assert near.mean() == pytest.approx(L.mean(), rel=0.01)


def test_a_halo_lacks_what_would_come_from_beside_an_image_in_the_dark():
    """Of an even image nothing in its middle; half a pixel from a border Φ(-1/2σ) of each Gaussian, from two of them
    what two independent ones leave. They are drawn on coarser cells: to 3 % of the halo."""
    L = np.ones((400, 400, 1), np.float32)
    c = replace(CAMERA, sensor=Sensor((400, 400)))
    out = VeilingGlare(halo=0.1, reach=0.01, lost=0.1).apply(Image(L), c, None).pixels[..., 0]
    sigma = 0.01 * np.hypot(400, 400) * np.array([0.5, 1, 2, 4])
    beside = norm.cdf(-0.5 / sigma)
    assert out[200, 200] == pytest.approx(1, abs=1e-4)
    assert out[200, 0] == pytest.approx(1 - 0.1 * np.mean(beside), abs=3e-3)
    assert out[0, 0] == pytest.approx(1 - 0.1 * np.mean(1 - (1 - beside) ** 2), abs=3e-3)
    part = VeilingGlare(halo=0.1, reach=0.01, lost=0.04).apply(Image(L), c, None).pixels[..., 0]
    assert 1 - part[200, 0] == pytest.approx(0.4 * (1 - out[200, 0]), rel=1e-3)


def test_diffraction_of_a_camera_is_asked_for():
    c = replace(CAMERA, lens=Lens(f_stop=8))
    assert not Diffraction.of(c).is_there
    assert Diffraction.of(Diffraction(5.6).on(c)) == Diffraction(5.6)
