"""Measurements: goniometer BRDFs, spectra and tables are recognised, and damaged ones name the line."""

from pathlib import Path

import numpy as np
import pytest

from interchange.formats import measurements
from interchange.formats.document import open_file
from interchange.formats.measurements import Kind, Measurement
from interchange.problems import FileError

ASSETS = Path(__file__).parents[2] / "assets" / "measurements"


def read(text: str, path: Path) -> Measurement:
    path.write_text(text)
    return measurements.read(path)


def test_a_goniometer_brdf() -> None:
    paint = open_file(ASSETS / "garnet_red_60.brdf")
    assert paint.kind is Kind.BRDF
    assert paint.rows == 60
    assert [a.name for a in paint.axes] == ["theta_i", "phi_i", "theta_s", "phi_s"]
    assert paint.wavelength_nm is not None
    np.testing.assert_array_equal(paint.wavelength_nm, np.arange(400, 701, 10))
    assert "Garnet Red" in paint.comments
    # first reading of the file: 50 degrees in, 32.86 degrees out, 0.023025 at 400 nm and 0.050083 at 700 nm
    assert paint.axes[0].values[0] == pytest.approx(np.radians(50), abs=1e-6)
    assert (paint.values[0].values[0], paint.values[-1].values[0]) == (0.023025, 0.050083)
    red, blue = paint.values[-1].values.mean(), paint.values[0].values.mean()
    assert red > 2 * blue


def test_directions_are_unit_and_as_the_angles_say() -> None:
    paint = measurements.read(ASSETS / "garnet_red_60.brdf")
    wi, wo = measurements.directions(paint)
    np.testing.assert_allclose(np.linalg.norm(wi, axis=1), 1)
    np.testing.assert_allclose(np.arccos(wo[:, 2]), paint.axes[2].values, atol=1e-12)
    np.testing.assert_allclose(np.tan(paint.axes[3].values) * wo[:, 0], wo[:, 1], atol=1e-9)


def test_illuminant_a_is_planck() -> None:
    lamp = measurements.read(ASSETS / "cie.stdillum.A.spd")
    assert lamp.kind is Kind.SPECTRUM
    nm = lamp.axes[0].values
    # CIE 15: relative Planck spectrum with c2 = 1.435e7 nm K and T = 2848 K, 100 at 560 nm; 6 digits are given
    expected = 100 * (560 / nm) ** 5 * np.expm1(1.435e7 / (2848 * 560)) / np.expm1(1.435e7 / (2848 * nm))
    np.testing.assert_allclose(lamp.values[0].values, expected, rtol=5e-6)


@pytest.mark.parametrize(
    "text",
    [
        "wavelength (nm),lamp (W/nm),filter\n400,1.5,0.1\n500,2.5,0.2\n",
        "Wavelength [nm];lamp [W/nm];filter\n400;1,5;0,1\n500;2,5;0,2\n",
        "# a comment\nwavelength(nm)\tlamp(W/nm)\tfilter\n\n400\t1.5\t0.1\n500\t2.5\t0.2\n",
        "\ufeffwavelength (µm),lamp (W/nm),filter\n0.4,1.5,0.1\n0.5,2.5,0.2\n",
    ],
)
def test_spectra_with_a_header(text: str, tmp_path: Path) -> None:
    found = read(text, tmp_path / "a.csv")
    assert found.kind is Kind.SPECTRUM
    np.testing.assert_allclose(found.axes[0].values, [400, 500])
    assert [(c.name, c.unit) for c in found.values] == [("lamp", "W/nm"), ("filter", "")]
    np.testing.assert_array_equal(found.values[0].values, [1.5, 2.5])


def test_any_other_table(tmp_path: Path) -> None:
    found = read('material,Cz,n,"note, long"\na,0.5,10,x\nb,,3,"y, z"\n', tmp_path / "a.csv")
    assert found.kind is Kind.TABLE
    assert found.rows == 2
    assert found.labels == {"material": ("a", "b"), "note, long": ("x", "y, z")}
    np.testing.assert_array_equal(found.values[0].values, [0.5, np.nan])
    assert "1 cells hold no number" in str(found.notes[0])
    assert read("1 2\n3 4\n", tmp_path / "b.csv").values[1].name == "column 2"


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.csv", "a,b\n1,2\n1,2,3\n", "line 3: Every row must have 2 columns as the first; got 3"),
        ("a.csv", 'a,b\n"1,2\n', "line 2: The row cannot be split"),
        ("a.csv", "\n", "empty"),
        ("a.csv", "a\0b", "must be text"),
        ("a.csv", "# only words\n", "no numbers"),
        (
            "a.csv",
            "wavelength,x\n500,1\n400,1\n",
            "line 3: Wavelengths must be positive numbers that increase",
        ),
        ("a.spd", "380 1\n385 x\n", "must have columns of numbers"),
        (
            "a.brdf",
            "2\n400 500\n0.1 0 0.2 0 1\n",
            "line 3: Rows of 4 angles and 2 values must follow; 5 of 6",
        ),
        ("a.brdf", "2\n400 500\n0.1 0 2.2 0 1 1\n", r"line 3: theta must lie in \[0, pi/2\]; got 2.2"),
        ("a.brdf", "2\n400 500\n0.1 0 zero 0 1 1\n", 'line 3: A number was expected; got "zero"'),
        ("a.brdf", "2\n400 500\n0.1 0 nan 0 1 1\n", "line 3: Every number must be finite"),
        ("a.brdf", "9e99\n1", "must begin with the number of wavelengths"),
        ("a.brdf", "# nothing\n", "must begin with the number of wavelengths"),
    ],
)
def test_damaged_files_name_the_line(name: str, text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(FileError, match=message):
        read(text, tmp_path / name)
