"""Blur that changes over the field, against the closed forms of its second and third moments."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import j1

from interchange.camera import Camera, Lens, Sensor
from interchange.effects.defocus import Defocus
from interchange.effects.field_blur import FieldBlur
from interchange.effects.measured_blur import MeasuredBlur
from interchange.exposure import expose
from interchange.image import Image, Quantity
from interchange.parameter import ParameterError
from interchange.varying_psf import kernel, spread_over_field

W, H = 161, 121  # nodes every 16 columns and 15 rows
CAMERA = Camera(sensor=Sensor((W, H), (5e-6, 5e-6)))
CENTRE = np.array([80.0, 60.0])


def spot(effect, column, row, camera=CAMERA):
    """Moments of the image of one pixel: total, centroid, covariance outward and around."""
    L = np.zeros((H, W, 1), np.float32)
    L[row, column] = 1
    out = effect.apply(Image(L), camera, None).pixels[..., 0].astype(np.float64)
    y, x = np.mgrid[:H, :W]
    total = out.sum()
    centroid = np.array([(out * x).sum(), (out * y).sum()]) / total
    away = np.array([column, row]) - CENTRE
    c, s = away / max(np.hypot(*away), 1e-9) if away.any() else (1.0, 0.0)
    dx, dy = x - centroid[0], y - centroid[1]
    u, v = c * dx + s * dy, -s * dx + c * dy
    second = [(out * a * b).sum() / total for a, b in ((u, u), (v, v), (u, v))]
    return total, centroid, second, (out * u**3).sum() / total


PLACES = [(80, 60), (144, 60), (80, 15), (144, 105), (32, 30)]  # nodes of the grid; not the border


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize(
    "effect",
    [
        FieldBlur(axis=-1.0, tangential=9.0, sagittal=4.0),
        FieldBlur(coma=1.5),
        FieldBlur(axis=0.3, tangential=0.8, sagittal=0.2, coma=0.1),
        MeasuredBlur((0.0, 0.4, 0.4, 1.0, 2.4, 1.2)),
    ],
)
def test_a_points_image_has_the_moments_of_its_formula(effect, place):
    """At a node, where it is one kernel; to 1 %: 4096 rays fill the pupil, a Gaussian of them ends at 4 sigma."""
    r = np.hypot(*(np.array(place) - CENTRE)) / (np.hypot(W, H) / 2)
    total, centroid, (outward, around, across), _ = spot(effect, *place)
    want = effect.sigma(r)
    assert total == pytest.approx(1, abs=1e-5)
    assert centroid == pytest.approx(place, abs=2e-3)
    assert (outward, around) == pytest.approx((want[0] ** 2, want[1] ** 2), rel=0.01, abs=1e-5)
    assert abs(across) < 0.01 * max(want) ** 2 + 1e-5


def test_between_nodes_the_variance_is_the_mean_of_theirs():
    """Which misses the formula's r⁴ by 6 (h / 2r)² of it: 12 % here, nodes h = 16 px apart at r = 56 px."""
    effect = FieldBlur(tangential=12.0, sagittal=12.0)
    near, far, middle = (spot(effect, c, 60)[2][0] for c in (128, 144, 136))
    assert middle == pytest.approx((near + far) / 2, rel=0.01)
    want = effect.sigma(56 / (np.hypot(W, H) / 2))[0] ** 2
    assert 0 < middle / want - 1 < 6 * (8 / 56) ** 2 + 0.01


def test_the_corner_is_as_the_numbers_say():
    """r = 1: discs of diameter d_T and d_S, whose rms along an axis is a quarter of it."""
    assert FieldBlur(tangential=8.0, sagittal=2.0).sigma(1.0) == pytest.approx((2.0, 0.5))
    rays = FieldBlur(tangential=8.0, sagittal=2.0).rays(1.0)
    assert rays.std(axis=0) == pytest.approx((2.0, 0.5), rel=2e-3)
    small = MeasuredBlur((1.0, 3.0, 1.0))
    k = kernel(small.rays(1.0))
    half = len(k) // 2
    y, x = np.mgrid[-half : half + 1, -half : half + 1]
    assert ((k * x**2).sum(), (k * y**2).sum()) == pytest.approx((9, 1), rel=0.01)


@pytest.mark.parametrize(("coma", "side"), [(1.5, 1), (-1.5, -1)])
def test_comas_flare_points_outward_or_inward(coma, side):
    """Third moment of the rays, C³ r³ <(ρ² (2 + cos 2φ) - 1)³>, by quadrature."""
    place, r = (144, 105), np.hypot(64, 45) / (np.hypot(W, H) / 2)
    phi = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    rho2 = (np.arange(400) + 0.5) / 400
    third = ((rho2[:, None] * (2 + np.cos(2 * phi)) - 1) ** 3).mean() * (coma * r) ** 3
    assert np.sign(third) == side
    assert spot(FieldBlur(coma=coma), *place)[3] == pytest.approx(third, rel=0.03)


def test_light_is_kept_and_the_border_goes_on():
    rng = np.random.default_rng(0)
    L = np.zeros((H, W, 3), np.float32)
    L[30:-30, 30:-30] = rng.uniform(0, 1, (H - 60, W - 60, 3))
    effect = FieldBlur(axis=1.0, tangential=7.0, sagittal=-4.0, coma=0.8)
    out = effect.apply(Image(L), CAMERA, None).pixels
    assert out.sum(axis=(0, 1)) == pytest.approx(L.sum(axis=(0, 1)), rel=1e-5)
    flat = effect.apply(Image(np.ones((H, W, 3), np.float32)), CAMERA, None).pixels
    # light leaves where blur grows: by some d(σ²) over the grid's 16 px squared, most where the border cuts tents
    assert flat == pytest.approx(1, abs=0.03)
    assert flat[20:-20, 20:-20].mean() == pytest.approx(1, abs=2e-3)


def test_a_function_alike_all_over_is_a_convolution():
    """Against the plain sum, one kernel everywhere, coma's too: nothing is flipped, no seam."""
    place = np.random.default_rng(0).normal(0, 1.5, (3000, 2))

    def same(r):
        return place

    x = np.random.default_rng(1).uniform(0, 1, (H, W, 1)).astype(np.float32)
    k = kernel(place)
    # around the centre the function turns with the azimuth: a centre far to the left leaves it as it is
    got = spread_over_field(x, same, (W, H), (-1e9, 60.0))[..., 0]
    half = len(k) // 2
    padded = np.pad(x[..., 0], half, mode="edge").astype(np.float64)
    windows = np.lib.stride_tricks.sliding_window_view(padded, k.shape)
    assert got == pytest.approx(np.einsum("ijkl,kl->ij", windows, k[::-1, ::-1]), abs=1e-5)


def test_it_follows_the_principal_point():
    camera = replace(CAMERA, principal_point=(32.0, 60.0))
    effect = FieldBlur(tangential=10.0, sagittal=10.0)
    assert spot(effect, 32, 60, camera)[2][0] == pytest.approx(0, abs=1e-6)
    assert spot(effect, 144, 60, camera)[2][0] > 1.9 * spot(effect, 144, 60)[2][0]


def test_a_camera_has_it_in_its_chain():
    L = np.zeros((H, W, 3), np.float32)
    L[12, 144] = 1
    c = replace(CAMERA, lens=Lens(field_blur=(0, 6.0, 2.0)))
    out = expose(Image(L), c, until=Quantity.IRRADIANCE).pixels
    assert out[12, 144, 1] < 0.3
    assert out.sum() == pytest.approx(3, rel=1e-4)


@pytest.mark.parametrize("sigmas", [(0, 1), (0, 1, 1, 0, 1, 1), (0, -1, 1), (0, 1, 1e9)])
def test_measured_blur_must_be_triples_of_rising_radius(sigmas):
    with pytest.raises(ParameterError, match=r"MeasuredBlur\.sigmas must"):
        MeasuredBlur(sigmas)


def test_depth_adds_to_the_fields_aberrations_before_they_are_squared():
    """At a node, (c + d_0 + d_T r²)² / 16 outward; 3 % of it by the sum over pixels of a layer's disc. A depth whose
    disc is what the axis lacks is sharp there."""
    lens = Lens(0.025, f_stop=2.8, focus_distance=0.4, field_blur=(1.5, 6.0, 6.0))
    camera = replace(CAMERA, lens=lens)
    defocus = Defocus.of(camera)
    for depth, place in ((0.404, (144, 60)), (0.397, (144, 60)), (0.41, (80, 15))):
        c = float(defocus.confusion(np.array(depth), camera))
        L = np.zeros((H, W, 1), np.float32)
        L[place[1], place[0]] = 1
        image = Image(L, passes={"depth": np.full((H, W), depth, np.float32)})
        out = expose(image, camera, until=Quantity.IRRADIANCE).pixels[..., 0]
        y, x = np.mgrid[:H, :W]
        r = np.hypot(*(np.array(place) - CENTRE)) / (np.hypot(W, H) / 2)
        for at, here in ((x, place[0]), (y, place[1])):
            got = (out * (at - here) ** 2).sum() / out.sum()
            assert got == pytest.approx((c + 1.5 + 6 * r**2) ** 2 / 16, rel=0.03)
    near = 0.4 / (1 + 1.5 * 2.8 * 0.4 * 5e-6 / 0.025**2)  # c = -1.5 px
    L = np.zeros((H, W, 1), np.float32)
    L[60, 80] = 1
    image = Image(L, passes={"depth": np.full((H, W), near, np.float32)})
    assert expose(image, camera, until=Quantity.IRRADIANCE).pixels.max() > 0.99 * lens.projected_solid_angle


@pytest.mark.parametrize("diameter", [0.2, 0.5, 0.8, 1.2, 2.0])
def test_a_disc_smaller_than_a_pixel_takes_no_more_contrast_than_it_has(diameter):
    """The disc's own transfer, 2 J1(x) / x at x = π d f. Shares between five pixels a side are polynomials of the
    fourth degree: 10 % at half of Nyquist's frequency, and at it nearly half of the loss is missing; shares between
    four pixels lost up to five times as much as the disc there."""
    k = kernel(FieldBlur(axis=diameter).rays(0.0)).sum(axis=0)
    at = np.arange(len(k)) - len(k) // 2
    for frequency, least, most in ((0.125, 0.98, 1.02), (0.25, 0.9, 1.1), (0.5, 0.5, 1.02)):
        x = np.pi * diameter * frequency
        lost = 1 - k @ np.cos(2 * np.pi * frequency * at)
        assert least < lost / (1 - 2 * j1(x) / x) < most, frequency
