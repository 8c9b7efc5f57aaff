"""Photometric files: closed forms of the flux, two formats of one lamp, every symmetry and goniometer."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from interchange.formats import photometry
from interchange.formats.document import open_file
from interchange.formats.luminous_intensity import full_angle
from interchange.problems import FileError

ASSETS = Path(__file__).parents[2] / "assets" / "photometry"


def ies(
    horizontal: np.ndarray,
    vertical: np.ndarray,
    candela: np.ndarray,
    kind: int = 1,
    header: str = "IESNA:LM-63-2002\n[TEST] 1",
    tilt: str = "TILT=NONE",
    lamp: str = "2 500 1",
    unit: str = "2 0.1 0.2 0.3",
    ballast: str = "1 1 40",
) -> str:
    """``candela`` (H, V)."""
    rows = [horizontal, *candela]
    counts = f"{lamp} {len(vertical)} {len(horizontal)} {kind} {unit}"
    body = [" ".join(f"{x:.9g}" for x in row) for row in [vertical, *rows]]
    return "\n".join([header, tilt, counts, ballast, *body]) + "\n"


def ldt(symmetry: int, planes: int, gamma: np.ndarray, per_klm: np.ndarray, flux: float = 2000.0) -> str:
    """``per_klm``: (planes that the symmetry leaves, gamma)."""
    lines = ["Works", "1", symmetry, planes, 360 / planes, len(gamma), gamma[1] - gamma[0], "report", "lamp"]
    lines += ["no. 7", "file", "2026-01-01", 200, 100, 50, 180, 90, 0, 0, 0, 0, 100, 80, 1, 0, 1]
    lines += [1, "LED", flux, "4000", "80", 20, *([0] * 10)]
    lines += [*(np.arange(planes) * 360 / planes), *gamma, *np.ravel(per_klm)]
    return "\r\n".join(map(str, lines)) + "\r\n"


def load(text: str, path: Path) -> photometry.Photometry:
    path.write_text(text)
    return photometry.load(path)


def test_isotropic_light_has_four_pi_lumens_a_candela(tmp_path: Path) -> None:
    vertical = np.arange(0, 181, 5)
    lamp = load(ies(np.zeros(1), vertical, np.full((1, 37), 100.0)), tmp_path / "a.ies")
    # power() integrates sin by the trapezium rule in steps of 0.25 degrees: 1.6e-6 below
    assert lamp.profile.power() == pytest.approx(400 * np.pi, rel=3e-6)
    lamp = load(ldt(1, 24, vertical, np.full((1, 37), 100.0)), tmp_path / "a.ldt")
    assert lamp.profile.power() == pytest.approx(2 * 400 * np.pi, rel=3e-6)


@pytest.mark.parametrize("power", [1, 4, 30])
def test_cosine_beam(power: int, tmp_path: Path) -> None:
    vertical = np.linspace(0, 90, 361)
    candela = 1000 * np.cos(np.radians(vertical)) ** power
    lamp = load(ies(np.zeros(1), vertical, candela[None]), tmp_path / "a.ies")
    # integral of cos^n over the half-sphere: 2 pi / (n + 1); chords of the curve in steps of 0.25 degrees
    assert lamp.profile.power() == pytest.approx(1000 * 2 * np.pi / (power + 1), rel=2e-4)
    for share in (0.5, 0.1):
        expected = 2 * np.degrees(np.arccos(share ** (1 / power)))
        assert full_angle(lamp.profile, share) == pytest.approx(expected, abs=0.05)
    assert lamp.profile.evaluate(np.radians(100), 0.3) == 0


def test_the_beam_angle_of_a_tilted_beam_is_its_own_width() -> None:
    from interchange.light import Profile

    theta, phi = np.radians(np.linspace(0, 180, 721)), np.radians(np.arange(0, 361, 1.0))
    x = np.sin(theta) * np.cos(phi[:, None])
    cos = x * np.sin(0.5) + np.cos(theta) * np.cos(0.5)
    lamp = Profile(phi, theta, np.maximum(cos, 0) ** 40)
    assert full_angle(lamp, 0.5) == pytest.approx(2 * np.degrees(np.arccos(0.5 ** (1 / 40))), abs=0.1)
    isotropic = Profile(np.zeros(1), theta, np.ones((1, len(theta))))
    assert full_angle(isotropic, 0.5) == 360


def test_one_lamp_in_two_formats() -> None:
    a = photometry.load(ASSETS / "luxpy_test_lid_file.ies")
    b = photometry.load(ASSETS / "luxpy_test_lid_file.ldt")
    np.testing.assert_allclose(a.profile.candela, b.profile.candela, rtol=1e-12)
    np.testing.assert_allclose(a.profile.horizontal, b.profile.horizontal)
    assert (a.symmetry, a.lumens, a.watts) == (b.symmetry, b.lumens, b.watts) == ("quadrants", 6000, 43.5)
    # the EULUMDAT header states that 88.0 % of 6000 lm leave the luminaire
    assert b.efficiency == 0.88
    assert b.profile.power() == pytest.approx(0.88 * 6000, rel=5e-4)
    assert a.keywords["LUMINAIRE"] == "LDT test lamp / 6klm"


def test_a_file_without_header_from_before_1991() -> None:
    lamp = photometry.load(ASSETS / "luxpy_test_lid_file2t.ies")
    assert lamp.standard == "LM-63 before 1991"
    assert lamp.profile.evaluate(np.pi, 0.0) == pytest.approx(936.6)  # the table's last value, straight up
    assert lamp.size == pytest.approx((0.4063 * 0.3048, 4 * 0.3048, 0.5104 * 0.3048))
    # plane 337.5 is plane 22.5 by the two mirrors
    assert lamp.profile.evaluate(np.radians(20), np.radians(337.5)) == pytest.approx(1577)


def lobe(phi: np.ndarray, theta: np.ndarray, center: tuple[float, float, float]) -> np.ndarray:
    direction = [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)]
    return 10 + sum(c * d for c, d in zip(center, direction, strict=True))


SYMMETRIES = {
    "quadrants": ((0, 0, 5), 0, 90, 4),
    "plane 0-180": ((3, 0, 5), 0, 180, 2),
    "plane 90-270": ((0, 3, 5), 90, 270, 3),
    "none": ((3, 2, 5), 0, 360, 0),
}


@pytest.mark.parametrize("symmetry", SYMMETRIES)
@pytest.mark.parametrize("file", ["ies", "ldt"])
def test_every_symmetry_gives_the_whole_sphere(symmetry: str, file: str, tmp_path: Path) -> None:
    center, first, last, indicator = SYMMETRIES[symmetry]
    vertical = np.arange(0, 181, 10.0)
    if file == "ies":
        horizontal = np.arange(first, last + 1, 15.0)
        values = lobe(np.radians(horizontal)[:, None], np.radians(vertical), center)
        lamp = load(ies(horizontal, vertical, values), tmp_path / "a.ies")
    else:
        ranges = {"quadrants": (0, 90), "plane 0-180": (0, 180), "plane 90-270": (270, 450), "none": (0, 345)}
        planes = np.arange(ranges[symmetry][0], ranges[symmetry][1] + 1, 15.0)
        values = lobe(np.radians(planes)[:, None], np.radians(vertical), center)
        lamp = load(ldt(indicator, 24, vertical, values, 1000.0), tmp_path / "a.ldt")
    assert lamp.symmetry == symmetry
    phi, theta = np.radians(np.arange(0, 361, 15.0)), np.radians(vertical)
    found = lamp.profile.evaluate(theta, phi[:, None])
    np.testing.assert_allclose(found, lobe(phi[:, None], theta, center), rtol=1e-7)
    np.testing.assert_allclose(lamp.profile.horizontal, phi, atol=1e-12)


def test_a_missing_last_plane_is_the_first(tmp_path: Path) -> None:
    horizontal, vertical = np.arange(0, 360, 15.0), np.arange(0, 181, 10.0)
    values = lobe(np.radians(horizontal)[:, None], np.radians(vertical), (3, 2, 5))
    lamp = load(ies(horizontal, vertical, values), tmp_path / "a.ies")
    np.testing.assert_array_equal(lamp.profile.candela[-1], lamp.profile.candela[0])
    with pytest.raises(FileError, match="from 0 to 90, 180 or 360, or from 90 to 270 degrees; got 0 to 45"):
        load(ies(horizontal[:4], vertical, values[:4]), tmp_path / "a.ies")


@pytest.mark.parametrize(("kind", "goniometer"), [(2, "B"), (3, "A")])
@pytest.mark.parametrize("mirrored", [False, True])
def test_other_goniometers_show_the_same_directions(
    kind: int, goniometer: str, mirrored: bool, tmp_path: Path
) -> None:
    first = 0 if mirrored else -90
    horizontal, vertical = np.arange(first, 91, 2.0), np.arange(first, 91, 2.0)
    h, v = np.radians(horizontal)[:, None], np.radians(vertical)
    if goniometer == "B":  # planes turn around x: the direction is lifted by V, then swung out by H
        x, y, w = np.sin(h), np.cos(h) * np.sin(v), np.cos(h) * np.cos(v)
    else:  # planes turn around y
        x, y, w = np.cos(v) * np.sin(h), np.sin(v), np.cos(v) * np.cos(h)
    side = (0.0, 0.0) if mirrored else (3.0, 2.0)

    def intensity(x: np.ndarray, y: np.ndarray, w: np.ndarray) -> np.ndarray:
        return 100 + side[0] * x + side[1] * y + 50 * w**3 + 20 * x * x

    lamp = load(ies(horizontal, vertical, intensity(x, y, w), kind), tmp_path / "a.ies")
    assert lamp.goniometer == goniometer
    rng = np.random.default_rng(kind)
    theta, phi = rng.uniform(0, np.pi / 2 - 0.02, 500), rng.uniform(0, 2 * np.pi, 500)
    found = lamp.profile.evaluate(theta, phi)
    expected = intensity(np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta))
    # chords over steps of 2 degrees: second derivative (below 600) x (0.035 rad)^2 / 8
    np.testing.assert_allclose(found, expected, atol=0.1)
    assert lamp.profile.evaluate(np.radians(100), 1.0) == 0


def test_a_type_b_beam_keeps_its_flux(tmp_path: Path) -> None:
    angle = np.arange(-90, 91, 1.0)
    h, v = np.radians(angle)[:, None], np.radians(angle)
    candela = 1e4 * np.maximum(np.cos(h) * np.cos(v), 0) ** 100
    lamp = load(ies(angle, angle, candela, 2), tmp_path / "a.ies")
    # 2 pi / (n + 1); chords over 1 degree of a beam 13 degrees wide
    assert lamp.profile.power() == pytest.approx(1e4 * 2 * np.pi / 101, rel=3e-3)


@pytest.mark.parametrize(
    ("header", "ballast", "factor"),
    [
        ("IESNA:LM-63-2002", "0.9 1.00001 40", 0.9),
        ("IES:LM-63-2019", "0.9 1.10010 40", 0.9),
        ("IESNA:LM-63-1995", "0.9 0.5 40", 0.9),
        ("IESNA91", "0.9 0.5 40", 0.45),
        ("any text", "0.9 0.5 40", 0.45),
    ],
)
def test_factors_by_edition(header: str, ballast: str, factor: float, tmp_path: Path) -> None:
    text = ies(np.zeros(1), np.array([0.0, 90]), np.full((1, 2), 10.0), lamp="3 500 2", header=header)
    lamp = load(text.replace("\n1 1 40\n", f"\n{ballast}\n"), tmp_path / "a.ies")
    assert lamp.profile.candela[0, 0] == pytest.approx(20 * factor)
    assert (lamp.lamps, lamp.lumens, lamp.watts) == (3, 1500, 40)


def test_tilt_included_in_a_file_or_missing(tmp_path: Path) -> None:
    args = np.zeros(1), np.array([0.0, 90]), np.full((1, 2), 10.0)
    lamp = load(ies(*args, tilt="TILT=INCLUDE\n1\n3\n0 45 90\n0.8 0.9 1"), tmp_path / "a.ies")
    assert lamp.profile.candela[0, 0] == pytest.approx(8)
    (tmp_path / "lamp.tlt").write_text("1\n2\n0 90\n0.7, 1\n")
    assert load(ies(*args, tilt="TILT=lamp.tlt"), tmp_path / "a.ies").factor == pytest.approx(0.7)
    with pytest.raises(FileError, match=r"line 3: The file \"none.tlt\" that TILT names cannot be read"):
        load(ies(*args, tilt="TILT=none.tlt"), tmp_path / "a.ies")


def test_absolute_photometry_and_keywords(tmp_path: Path) -> None:
    header = "IESNA:LM-63-2002\n[LUMINAIRE] long\n[MORE] name\n[_OWN] x"
    text = ies(np.zeros(1), np.array([0.0, 90]), np.ones((1, 2)), lamp="1 -1 1", header=header)
    lamp = load(text, tmp_path / "a.ies")
    assert lamp.lumens is None
    assert lamp.keywords == {"LUMINAIRE": "long\nname", "_OWN": "x"}
    assert load(text + "left over\n", tmp_path / "a.ies").notes[0].severity == "loss"


def test_all_problems_at_once_each_with_its_line(tmp_path: Path) -> None:
    text = ies(np.zeros(1), np.array([0.0, 90]), np.ones((1, 2)), kind=7, unit="5 0 0 0", ballast="0 1 40")
    with pytest.raises(FileError) as caught:
        load(text, tmp_path / "a.ies")
    assert [p.where.prim for p in caught.value.problems] == ["line 4"] * 3
    text = ies(np.zeros(1), np.array([90.0, 0.0]), np.array([[1.0, -2.0]]))
    with pytest.raises(FileError, match=r"Vertical angles must increase[^$]*\n.*line 8: Candela must not be"):
        load(text, tmp_path / "a.ies")
    text = ldt(4, 6, np.array([0.0, 90.0]), np.ones((2, 2))).replace("\r\n20\r\n", "\r\nx\r\n")
    with pytest.raises(FileError, match=r"line 4: .*multiple of 4; got 6\.\n.*line 32: .*got \"x\""):
        load(text, tmp_path / "a.ldt")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("IESNA:LM-63-2002\n", "must have a line TILT"),
        ("TILT=NONE\n1 2 3", "the file ends after 0"),
        ("TILT=NONE\n1 500 1 99999 99999 1 2 0 0 0 1 1 0", "candela values must follow"),
        ("TILT=NONE\n1 500 1 nan 1 1 2 0 0 0 1 1 0", "must be finite"),
        ("TILT=NONE\n1 500 one 2 1 1 2 0 0 0 1 1 0", 'got "one"'),
        (" \n", "empty"),
    ],
)
def test_damaged_files(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(FileError, match=message):
        load(text, tmp_path / "a.ies")


@pytest.mark.parametrize("name", ["luxpy_test_lid_file2t.ies", "luxpy_test_lid_file.ldt"])
@given(at=st.floats(0, 1), cut=st.booleans(), value=st.binary(min_size=1, max_size=12))
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_overwritten_bytes_end_in_sentences_or_a_lamp(
    name: str, at: float, cut: bool, value: bytes, tmp_path: Path
) -> None:
    data = bytearray((ASSETS / name).read_bytes())
    start = int(at * len(data))
    data[start : len(data) if cut else start + len(value)] = value
    path = tmp_path / name
    path.write_bytes(data)
    try:
        lamp = open_file(path)
    except FileError:
        return
    assert np.isfinite(lamp.profile.candela).all()
