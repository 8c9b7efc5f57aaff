"""Goniometer tables: what a header says is done, and what it cannot mean is refused with the line."""

from pathlib import Path

import numpy as np
import pytest

from interchange.formats.document import open_file
from interchange.measurement import Kind, Measurement, directions
from interchange.problems import FileError
from interchange.reflectance import ReflectanceSamples


def read(text: str, folder: Path, name: str = "a.csv") -> Measurement:
    (folder / name).write_text(text)
    return open_file(folder / name)


def samples(text: str, folder: Path, name: str = "a.csv") -> ReflectanceSamples:
    return ReflectanceSamples.from_measurement(read(text, folder, name))


def test_degrees_and_radians_are_the_same_measurement(tmp_path: Path) -> None:
    deg = samples(
        "theta_i (deg),phi_i (deg),theta_s (deg),phi_s (deg),BRDF (1/sr)\n30,0,40,180,0.2\n60,10,5,45,0.1\n",
        tmp_path,
    )
    r = np.radians
    rows = [(r(30), 0, r(40), np.pi, 0.2), (r(60), r(10), r(5), r(45), 0.1)]
    text = "\n".join(";".join(f"{x:.12g}".replace(".", ",") for x in row) for row in rows)
    rad = samples(f"Incidence [rad];phi_in [rad];exitance angle [rad];φ_r [rad];f\n{text}\n", tmp_path)
    assert deg.wi == pytest.approx(rad.wi)
    assert deg.wo == pytest.approx(rad.wo)
    assert deg.wi[0] == pytest.approx([0.5, 0, np.sqrt(0.75)])
    assert deg.wo[0] == pytest.approx([-np.sin(r(40)), 0, np.cos(r(40))])  # 180°: the mirror's side
    assert deg.f.ravel().tolist() == rad.f.ravel().tolist() == [0.2, 0.1]


@pytest.mark.parametrize(
    ("header", "value", "f"),
    [
        ("BRDF", 0.2, 0.2),
        ("CCBSDF (1/sr)", 0.1, 0.2),
        ("BSDF*cos", 0.1, 0.2),
        ("radiance factor", 0.3 * np.pi, 0.3),
    ],
)
def test_values_per_cosine_and_radiance_factors_become_1_per_sr(header, value, f, tmp_path: Path) -> None:
    """Exitance at 60° has cosine 1/2."""
    text = f"aoi_deg,theta_r_deg,phi_r_deg,{header},sigma (1/sr)\n20,60,0,{value},{value / 10}\n20,60,90,{value},0\n"
    found = samples(text, tmp_path)
    assert found.f.ravel() == pytest.approx([f, f])
    assert found.sigma is not None
    assert found.sigma.ravel() == pytest.approx([f / 10, 0])


def test_columns_of_wavelengths_or_channels_are_put_in_order(tmp_path: Path) -> None:
    head = "theta_i (deg),theta_s (deg),phi_s (deg)"
    spectral = samples(
        f"{head},650 nm,450,BRDF 0.55 µm,sigma 450,sigma 650 nm,σ BRDF 0.55 µm\n1,2,3,65,45,55,.45,.65,.55\n"
        * 1,
        tmp_path,
    )
    assert spectral.wavelength_nm.tolist() == [450, 550, 650]
    assert spectral.f.tolist() == [[45, 55, 65]]
    assert spectral.sigma.tolist() == [[0.45, 0.55, 0.65]]
    colour = samples(f"{head},B,R,G\n1,2,3,1,3,2\n", tmp_path)
    assert colour.channels == ("R", "G", "B")
    assert colour.f.tolist() == [[3, 2, 1]]


def test_a_long_table_becomes_one_row_a_pair_of_directions(tmp_path: Path) -> None:
    head = "theta_i (deg),theta_s (deg),phi_s (deg),wavelength (nm),BRDF,uncertainty (%)"
    rows = [
        (20, 30, 0, 500, 0.5, 10),
        (20, 30, 0, 400, 0.4, 10),
        (20, 35, 0, 400, -0.1, 10),
        (20, 30, 0, 400, 0.6, 10),
    ]
    found = read("\n".join([head, *(",".join(map(str, r)) for r in rows)]), tmp_path)
    s = ReflectanceSamples.from_measurement(found)
    assert s.wavelength_nm.tolist() == [400, 500]
    assert s.f[0] == pytest.approx([0.5, 0.5])  # two repeats at 400 nm: their mean
    assert s.f[1, 0] == -0.1
    assert np.isnan(s.f[1, 1])
    assert s.usable.tolist() == [True, False]
    assert s.sigma[0] == pytest.approx([0.05, 0.05])
    assert "1 values are negative; they are kept" in "\n".join(map(str, found.notes))


def test_a_scan_in_the_plane_of_incidence(tmp_path: Path) -> None:
    found = read("incidence (deg),scatter angle (deg),BSDF\n30,30,5\n30,-30,0.1\n", tmp_path)
    wi, wo = directions(found)
    assert wo[0] == pytest.approx(wi[0] * [-1, -1, 1])  # the mirror direction
    assert wo[1] == pytest.approx(wi[1])  # back to the lamp
    assert "plane of incidence" in str(found.notes[0])


def test_negative_polar_angles_lie_on_the_other_side(tmp_path: Path) -> None:
    found = read("theta_i (deg),theta_s (deg),delta_phi (deg),BRDF\n30,-20,180,5\n30,20,0,5\n", tmp_path)
    _, wo = directions(found)
    assert wo[0] == pytest.approx(wo[1], abs=1e-12)
    assert "1 polar angles are negative" in str(found.notes[0])


def test_astm_file(tmp_path: Path) -> None:
    text = "KEYWORD ignored\nNUM_POINTS 2\nVARS theta_i,phi_i,theta_s,phi_s,R,G,B\n"
    text += "0.5,0,0.6,3.14,1,2,3\n0.5,0,0.7,3.14,-1,2,3\n"
    found = read(text, tmp_path, "paint.astm")
    assert found.kind is Kind.BRDF
    assert found.axes[2].values.tolist() == [0.6, 0.7]  # rad
    assert found.comments == ("KEYWORD ignored", "NUM_POINTS 2")
    assert ReflectanceSamples.from_measurement(found).negatives.tolist() == [1, 0, 0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("theta_i,theta_s,BRDF\n30,40,1\n", 'must give the unit of "theta_i"'),
        (
            "theta_i (rad),theta_s (rad),BRDF\n0.5,0.2,1\n0.5,40,1\n",
            "line 3: theta_s is said to be in rad and reaches 40: is it in deg",
        ),
        ("theta_i (deg),theta_s (deg),BRDF\n0.5,1.2,1\n0.9,1.5,1\n", "none is above 1.5: are they in rad"),
        (
            "theta_i (deg),theta_s (deg),BRDF\n30,40,1\n30,95,1\n",
            "line 3: .* within 90° of the normal; theta_s is 95°",
        ),
        ("theta_i (deg),theta_s (deg),BRDF (%)\n30,40,1\n", 'must be in 1/sr; "BRDF" is in "%"'),
        (
            "theta_i (deg),theta_s (deg),BRDF\n30,x4,1\n",
            '"theta_s" must hold a number in every row; got "x4"',
        ),
        ("theta_i (deg),theta_s (deg),BRDF\n30,,1\n30,4,1\n", "line 2: theta_s must be given in every row"),
        ("theta_i (deg),theta_s (deg)\n30,40\n", "A column of BRDF values must stand beside"),
        ("theta_i (deg),theta_s (deg),R,G,B,sigma R,sigma G\n30,40,1,1,1,1,1\n", "one each; got 2 for 3"),
        ("theta_i (deg),theta_s (deg),wavelength,R,G\n30,40,500,1,1\n", "there must be one of values; got 2"),
        ("theta_i (deg),theta_s (deg),wavelength,f\n30,40,-5,1\n", "line 2: Wavelengths must be positive"),
        ("theta_i (furlong),theta_s (deg),f\n30,40,1\n", 'must give the unit of "theta_i"'),
    ],
)
def test_what_a_header_cannot_mean_is_refused(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(FileError, match=message):
        read(text, tmp_path)


def test_the_cosine_of_a_grazing_camera_is_not_divided_by(tmp_path: Path) -> None:
    s = samples("theta_i (deg),theta_s (deg),phi_s (deg),CCBSDF\n30,90,0,1\n30,60,0,1\n", tmp_path)
    assert s.usable.tolist() == [False, True]
