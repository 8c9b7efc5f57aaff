"""EMVA 1288, release 4: rows, columns and pixels told apart; a colour camera channel by channel."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from analysis.emva import characterise, level, split
from analysis.emva_color import joined, planes
from composer.cli import main
from interchange.camera import Camera, Lens, Sensor
from interchange.exposure import expose
from interchange.formats import emva_sheet
from interchange.image import Image
from interchange.problems import BrightfieldError
from interchange.sensor import Mosaic

SIZE = (300, 240)
SENSOR = Sensor(
    SIZE, (5e-6, 5e-6), responsivity=1e4, full_well=12000, bit_depth=12, black_level=60, read_noise=6.0,
    prnu=0.010, prnu_row=0.004, prnu_column=0.007, dsnu=4.0, dsnu_row=2.0, dsnu_column=3.0, serial_number="40012",
    mosaic="mono",
)  # fmt: skip


def test_a_sum_of_rows_columns_and_pixels_is_told_apart():
    """The patterns themselves as drawn, not their law: cross terms are left, 1 / sqrt(M N) of the product of two."""
    rng = np.random.default_rng(0)
    row, column, pixel = rng.normal(0, 3, (200, 1)), rng.normal(0, 2, 300), rng.normal(0, 5, (200, 300))
    got = split(7 + row + column + pixel)
    assert got == pytest.approx((row.var(ddof=1), column.var(ddof=1), 25), rel=0.04)
    assert split(row + 0 * column) == pytest.approx((row.var(ddof=1), 0, 0), abs=1e-9)


def test_the_standards_three_linear_equations_are_these():
    """s²_p = MN / (MN - M - N) (s² - s²_cav - s²_rav), s²_cav = s²_c + s²_p / M, likewise rows; to 1 / (M N)."""
    y = np.random.default_rng(1).normal(0, 1, (60, 80)) + np.random.default_rng(2).normal(0, 1, 80)
    M, N = y.shape
    total, cav, rav = y.var(), y.mean(axis=0).var(), y.mean(axis=1).var()
    pixel = M * N / (M * N - M - N) * (total - cav - rav)
    row, column, left = split(y)
    assert left == pytest.approx(pixel, rel=2 / (M * N))
    assert column * (N - 1) / N == pytest.approx(cav - pixel / M, abs=1e-3)
    assert row * (M - 1) / M == pytest.approx(rav - pixel / N, abs=1e-3)


def frames(sensor, L, count, rng, t=0.1):
    channels = 3 if Mosaic(sensor.mosaic).is_bayer else 1
    pixels = np.broadcast_to(np.asarray(L, np.float32), (SIZE[1], SIZE[0], channels)).copy()
    camera = Camera(lens=Lens(f_stop=2.0), sensor=sensor, t_exp=t)
    return [expose(Image(pixels), camera, rng=rng).pixels[..., 0] for _ in range(count)]


def test_a_simulated_sensors_patterns_come_back_as_declared():
    """240 rows and 300 columns of the serial number's own pattern tell an rms to 5 % (1 sigma); pixels to 0.3 %."""
    rng = np.random.default_rng(3)
    bright = [level(0.1, np.nan, frames(SENSOR, L, 16 if L == 6 else 2, rng)) for L in (1.5, 3, 6, 9)]
    dark = [level(0.1, 0, frames(SENSOR, 0, 16, rng))]
    found = characterise(bright, dark, 12).sheet
    for symbol, want, tolerance in (
        ("DSNU1288.row", 2.0, 0.15), ("DSNU1288.col", 3.0, 0.15), ("DSNU1288.pixel", 4.0, 0.02),
        ("PRNU1288.row", 0.004, 0.15), ("PRNU1288.col", 0.007, 0.15), ("PRNU1288.pixel", 0.010, 0.02),
        ("DSNU1288", np.sqrt(29), 0.06), ("PRNU1288", np.sqrt(165e-6), 0.06),
    ):  # fmt: skip
        assert found.get(symbol) == pytest.approx(want, rel=tolerance), symbol
    for name in ("DSNU1288", "PRNU1288"):
        parts = [found.get(f"{name}.{p}") ** 2 for p in ("row", "col", "pixel")]
        assert sum(parts) == pytest.approx(found.get(name) ** 2, rel=0.01)
    back = found.sensor(SENSOR)
    assert (back.dsnu, back.dsnu_column) == (found.get("DSNU1288.pixel"), found.get("DSNU1288.col"))


@pytest.mark.parametrize("pattern", ["RGGB", "BGGR", "GRBG", "GBRG"])
def test_planes_are_the_sites_of_their_channel(pattern):
    y = np.arange(24).reshape(4, 6)
    found = planes(y, Mosaic(pattern))
    assert list(found) == ["red", "green", "green2", "blue"]
    for name, letter in (("red", "R"), ("blue", "B")):
        k = pattern.index(letter)
        assert np.array_equal(found[name], y[k // 2 :: 2, k % 2 :: 2])
    red, green = found["red"], found["green"]
    assert np.array_equal(red // 6, green // 6)  # the same rows


def test_planes_that_cannot_be_are_said():
    with pytest.raises(BrightfieldError, match="must have even sides; got 5 x 4"):
        planes(np.zeros((4, 5)), Mosaic.RGGB)
    with pytest.raises(BrightfieldError, match="need a Bayer pattern"):
        planes(np.zeros((4, 4)), Mosaic.MONO)


def test_a_colour_camera_comes_back_channel_by_channel(tmp_path, capsys):
    """K of every plane, the efficiencies' ratios, and a sensor that has them; by the command, from PNG files."""
    eta = (0.30, 0.55, 0.40)
    sensor = replace(
        SENSOR, mosaic="GRBG", responsivity=0, quantum_efficiency=eta, wavelength_nm=525, demosaic="none"
    )
    rng = np.random.default_rng(4)
    energy = np.pi / 16 * 25e-12 * 0.1  # of L = 1 through f/2 on a pixel in 0.1 s, J
    unit = energy * 525e-9 / (6.62607015e-34 * 299792458.0)
    lines = [f"n 12 {SIZE[0]} {SIZE[1]}"]
    for k, electrons in enumerate([0, *np.linspace(500, 13000, 12)]):
        photons = electrons / 0.55
        lines.append(f"b 100000000 {photons}" if k else "d 100000000")
        for n, y in enumerate(frames(sensor, photons / unit, 2, rng)):
            cv2.imwrite(str(tmp_path / f"{k}_{n}.png"), y.astype(np.uint16))
            lines.append(f"i {k}_{n}.png")
    (tmp_path / "data.txt").write_text("\n".join(lines))
    out = tmp_path / "out.json"
    command = [
        "emva",
        str(tmp_path),
        "--mosaic",
        "GRBG",
        "--out",
        str(out),
        "--wavelength",
        "525",
        "--pixel",
        "5",
    ]
    assert main(command) == 0
    said = capsys.readouterr().out
    assert "green2, 150 x 120 px" in said
    back = emva_sheet.read(out).sensor()
    assert back.mosaic is Mosaic.GRBG
    assert back.resolution == SIZE
    assert back.quantum_efficiency == pytest.approx(eta, rel=0.02)
    assert pytest.approx(SENSOR.K, rel=0.01) == back.K
    assert back.read_noise == pytest.approx(6.0, rel=0.03)


def test_a_joined_sheet_has_no_efficiency_without_photons():
    plane = emva_sheet.DataSheet({"K": emva_sheet.Result(0.25, 0.002)}, bits=12, width=10, height=8)
    sheet = joined(dict.fromkeys(("red", "green", "green2", "blue"), plane), Mosaic.RGGB)
    assert sheet.results == {"K": emva_sheet.Result(0.25, 0.001)}
    assert (sheet.width, sheet.height) == (20, 16)
