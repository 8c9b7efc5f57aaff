"""Mosaic, colour, curve and codec: what the electronics make of electrons and DN."""

import cv2
import numpy as np
import pytest

from interchange.camera import Camera, Sensor
from interchange.effects.black_level import BlackLevel
from interchange.effects.color_correction import ColorCorrection
from interchange.effects.color_crosstalk import ColorCrosstalk
from interchange.effects.jpeg import Jpeg, decoded
from interchange.effects.response_curve import ResponseCurve
from interchange.exposure import expose
from interchange.image import Image, Quantity
from interchange.parameter import ParameterError

PATTERNS = ("RGGB", "BGGR", "GRBG", "GBRG")
COLOR = np.array([0.5, 0.25, 0.1], np.float32)


def station(**sensor):
    return Camera(sensor=Sensor(**{"resolution": (64, 48), "responsivity": 1e4, "full_well": 1e4, **sensor}))


def even(color=COLOR):
    return Image(np.broadcast_to(color, (48, 64, 3)).astype(np.float32).copy())


@pytest.mark.parametrize("pattern", PATTERNS)
def test_a_pattern_names_its_upper_left_pixels(pattern):
    e = expose(even(), station(mosaic=pattern), until=Quantity.ELECTRONS).pixels
    assert e.shape == (48, 64, 1)
    for k, letter in enumerate(pattern):
        assert e[k // 2, k % 2, 0] == pytest.approx(1e4 * COLOR["RGB".index(letter)])
        assert e[10 + k // 2, 20 + k % 2, 0] == e[k // 2, k % 2, 0]


@pytest.mark.parametrize("pattern", PATTERNS)
@pytest.mark.parametrize("method", ["bilinear", "edge_aware"])
def test_an_even_colour_survives_mosaic_and_demosaicing(pattern, method):
    dn = expose(even(), station(mosaic=pattern, demosaic=method)).pixels
    assert dn.shape == (48, 64, 3)
    assert dn == pytest.approx(np.broadcast_to(COLOR * 4095, dn.shape), abs=0.5001)


def test_raw_pixels_stay_raw_where_asked():
    assert expose(even(), station(mosaic="RGGB", demosaic="none")).pixels.shape == (48, 64, 1)


@pytest.mark.parametrize("mosaic", ["", "RGGB", "GBRG"])
def test_white_balance_makes_a_coloured_white_white(mosaic):
    c = station(mosaic=mosaic, white_balance=(0.5, 1.0, 2.5), black_level=100)
    dn = expose(even(), c).pixels
    assert dn == pytest.approx(100 + 0.25 * 3995, abs=2)  # a DN before the gain of 2.5 is 2.5 after it
    black = expose(even(0 * COLOR), c).pixels
    assert np.array_equal(black, np.full_like(black, 100))


def test_crosstalk_leaves_grey_grey_and_mixes_the_rest():
    effect = ColorCrosstalk(rg=0.2, bg=0.1, gr=0.05)
    assert effect.matrix.sum(axis=1) == pytest.approx(1)
    c = station(color_crosstalk=(0.2, 0, 0.05, 0, 0, 0.1))
    e = expose(even(), c, until=Quantity.ELECTRONS).pixels[0, 0]
    assert e == pytest.approx(1e4 * (effect.matrix @ COLOR), rel=1e-6)
    assert e[0] == pytest.approx(1e4 * (0.8 * 0.5 + 0.2 * 0.25))
    grey = expose(even(np.full(3, 0.3)), c, until=Quantity.ELECTRONS).pixels
    assert grey == pytest.approx(3000, rel=1e-6)


def test_a_colour_matrix_undoes_the_crosstalk_it_is_the_inverse_of():
    cross = ColorCrosstalk(0.2, 0.03, 0.1, 0.05, 0.02, 0.15)
    M = np.linalg.inv(cross.matrix)
    c = station(
        color_crosstalk=(0.2, 0.03, 0.1, 0.05, 0.02, 0.15), color_correction=tuple(M.ravel()), black_level=64
    )
    dn = expose(even(), c).pixels[0, 0]
    assert dn == pytest.approx(64 + COLOR * (4095 - 64), abs=0.5 + np.abs(M).sum(axis=1).max() / 2)
    assert ColorCorrection.of(c).red == pytest.approx(M[0])


@pytest.mark.parametrize(
    ("linear", "encoded"),
    [(0.0, 0), (0.0031308, 10.31), (0.01, 25.46), (0.1, 89.04), (0.2140, 127.5), (0.5, 187.5), (1.0, 255)],
)
def test_srgb_has_its_published_values(linear, encoded):
    """IEC 61966-2-1: 12.92 x up to 0.0031308; 1.055 x^(1/2.4) - 0.055 above; middle grey of 127.5 is 21.4 %."""
    assert 255 * ResponseCurve(response="sRGB").curve(np.array(linear)) == pytest.approx(encoded, abs=0.02)
    dn = expose(even(np.full(3, linear)), station(response="sRGB", output_bit_depth=8, bit_depth=16)).pixels
    assert dn == pytest.approx(encoded, abs=0.55)


@pytest.mark.parametrize(
    ("linear", "encoded"),
    [(0.0, 0.0), (0.009, 0.0405), (0.0179, 0.08055), (0.1, 0.2909), (0.5, 0.7055), (1.0, 1.0)],
)
def test_rec_709_has_its_published_values(linear, encoded):
    """ITU-R BT.709-6, 1.2: 4.5 L below 0.018; 1.099 L^0.45 - 0.099 above."""
    curve = ResponseCurve(response="rec709")
    assert curve.curve(np.array(linear)) == pytest.approx(encoded, abs=2e-4)
    dn = expose(even(np.full(3, linear)), station(response="rec709", output_bit_depth=8, bit_depth=16)).pixels
    assert dn == pytest.approx(255 * encoded, abs=0.55)


def test_a_table_is_linear_between_its_entries_and_gamma_comes_before():
    lut = ResponseCurve(response="lut", lut=(0.0, 0.5, 0.6, 1.0))
    assert lut.curve(np.array([0, 1 / 6, 1 / 3, 0.5, 1])) == pytest.approx([0, 0.25, 0.5, 0.55, 1])
    assert ResponseCurve(gamma=2.0).curve(np.array(0.5)) == pytest.approx(0.25)
    dn = expose(even(np.full(3, 0.5)), station(response="lut", response_lut=(0.0, 0.5, 0.6, 1.0))).pixels
    assert dn == pytest.approx(0.55 * 4095, abs=1)


def test_a_bow_is_a_quarter_at_half_the_range_and_nothing_at_its_ends():
    bowed = ResponseCurve(bow=0.08).curve(np.array([0, 0.25, 0.5, 1]))
    assert bowed == pytest.approx([0, 0.25 + 0.08 * 3 / 16, 0.52, 1])
    assert ResponseCurve(gamma=2.0, bow=0.08).curve(np.array(0.5)) == pytest.approx(0.25 + 0.08 * 3 / 16)
    skewed = ResponseCurve(skew=0.08).curve(np.array([0, 0.25, 0.5, 0.75, 1]))
    assert skewed == pytest.approx([0, 0.25 + 0.08 * 3 / 32, 0.5, 0.75 - 0.08 * 3 / 32, 1])
    c = station(bit_depth=12, black_level=160, bow=-0.08)
    dn = expose(even(np.full(3, 0.5)), c).pixels
    assert dn == pytest.approx(160 + (4095 - 160) * 0.48, abs=0.5)


def test_a_curve_leaves_black_where_it_is():
    c = station(bit_depth=12, black_level=160, response="sRGB", output_bit_depth=8)
    dark = expose(even(0 * COLOR), c).pixels
    assert np.ptp(dark) == 0
    assert dark[0, 0, 0] == round(160 * 255 / 4095)
    grey = expose(even(np.full(3, 0.214)), c).pixels[0, 0, 0]
    assert grey == pytest.approx((160 + (4095 - 160) * 0.5) * 255 / 4095, abs=0.6)


def test_fewer_bits_out_than_the_converter_has():
    dn = expose(even(), station(bit_depth=12, output_bit_depth=8)).pixels[0, 0]
    assert dn == pytest.approx(COLOR * 255, abs=0.5 + 0.5 * 255 / 4095)


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("subsampling", [True, False])
def test_jpeg_is_opencvs(channels, subsampling):
    """The file that OpenCV writes of the DN without it, read again."""
    y, x = np.mgrid[:48, :64]
    L = 0.5 + 0.4 * np.stack([np.sin(x / 5), np.cos(y / 3), np.sin((x + y) / 7)], -1)[..., :channels]
    base = {"bit_depth": 8, "mosaic": "mono" if channels == 1 else ""}
    raw = expose(Image(L.astype(np.float32)), station(**base)).pixels.astype(np.uint8)
    got = expose(
        Image(L.astype(np.float32)), station(jpeg_quality=60, jpeg_subsampling=subsampling, **base)
    ).pixels
    factor = 0x221111 if subsampling else 0x111111
    file = cv2.imencode(
        ".jpg", raw[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 60, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, factor]
    )[1]
    want = cv2.imdecode(file, cv2.IMREAD_UNCHANGED)
    assert np.array_equal(got.squeeze(), want[..., ::-1] if channels == 3 else want)
    assert np.abs(got - raw).max() > 0


def test_a_better_jpeg_is_nearer():
    L = np.random.default_rng(0).uniform(0.2, 0.8, (48, 64, 3)).astype(np.float32)
    raw = expose(Image(L), station(bit_depth=8)).pixels
    errors = [
        np.abs(expose(Image(L), station(bit_depth=8), effects=(Jpeg(q, False),)).pixels - raw).mean()
        for q in (30, 70, 100)
    ]
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < 1


def test_a_full_well_is_the_highest_dn_and_more_gain_reaches_it_earlier():
    L = Image(np.array([0.5, 0.99, 1.0, 7.0], np.float32).reshape(1, 4, 1))
    c = station(resolution=(4, 1), black_level=16)
    assert expose(L, c).pixels.ravel().tolist() == [
        2056,
        4054,
        4095,
        4095,
    ]  # 16 + 0.5 · 4079 = 2055.5, to even
    assert expose(L, c, gain_dB=20 * np.log10(1.5)).pixels.ravel().tolist() == [3075, 4095, 4095, 4095]
    half = expose(L, c, gain_dB=20 * np.log10(0.5)).pixels.ravel()
    assert half[3] == pytest.approx(16 + 4079 / 2, abs=0.51)  # the well is full, the converter is not


@pytest.mark.parametrize("subsampling", [True, False])
@pytest.mark.parametrize("height", [1040, 1023, 530])
def test_a_jpeg_in_bands_is_the_whole_jpeg(height, subsampling):
    """Bit by bit, where bands meet and where the last one ends within a block."""
    y = np.random.default_rng(0).integers(0, 256, (height, 70, 3)).astype(np.uint8)
    effect = Jpeg(80, subsampling)
    assert np.array_equal(effect.compressed(y), decoded(effect.encoded(Image(y))))
    grey = y[..., :1]
    assert np.array_equal(effect.compressed(grey), decoded(effect.encoded(Image(grey))))


@pytest.mark.parametrize("table", [(0.0, 0.6, 0.5, 1.0), (0.0, 1.2), (-0.1, 1.0)])
def test_a_response_rises_within_its_range(table):
    with pytest.raises(ParameterError, match=r"must rise and stay within \[0, 1\]; got"):
        Sensor(response="lut", response_lut=table)


@pytest.mark.parametrize("level", [-74.0, 20.0])
def test_another_black_level_moves_every_dn_alike(level):
    """As many DN an electron as before: what is above the highest DN is cut off, and what is below 0."""
    c = station(bit_depth=12, black_level=64)
    for light in (0.0, 0.02, 0.3, 0.9, 2.0):
        own = expose(even(np.full(3, light)), c).pixels
        moved = expose(even(np.full(3, light)), c, effects=[BlackLevel(level)]).pixels
        free = 64 + light * (4095 - 64)  # DN, before anything is cut off
        assert own[0, 0, 0] == np.clip(np.rint(free), 0, 4095)
        assert moved[0, 0, 0] == np.clip(np.rint(free + level - 64), 0, 4095)
    gain = BlackLevel(level).on(c).sensor.K
    assert gain == pytest.approx(c.sensor.K)
    with pytest.raises(ParameterError, match="black_level"):
        BlackLevel(4095.0).on(c)
