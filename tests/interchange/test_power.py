"""Watts and lumens of every kind of lamp, against closed forms; radial profiles of data sheets."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from interchange.colorimetry import luminous_efficacy
from interchange.formats import ies_write, photometry
from interchange.illuminants import illuminant, led
from interchange.light import Light, LightKind, Profile, latlong_direction
from interchange.material import Texture, Wrap
from interchange.power import (
    emitted_power,
    from_candela,
    intensity_from_power,
    power_per_intensity,
    with_power,
)
from interchange.problems import BrightfieldError, FileError

ONE = (1.0, 2.0, 3.0)


def lamp(kind: LightKind, **about) -> Light:
    return Light("/lamp", kind, ONE, **about)


def test_a_point_has_four_pi_i() -> None:
    for radius in (0.0, 0.02):
        assert emitted_power(lamp(LightKind.SPHERE, radius=radius)) == pytest.approx(
            4 * np.pi * np.array(ONE)
        )


@pytest.mark.parametrize(
    "light",
    [lamp(LightKind.DISK, radius=0.03), lamp(LightKind.RECT, width=0.1, height=0.02), lamp(LightKind.DISK)],
)
def test_a_lambertian_face_has_pi_l_a(light: Light) -> None:
    assert emitted_power(light) == pytest.approx(np.pi * np.array(ONE))
    if not light.is_delta:
        assert emitted_power(light) == pytest.approx(np.pi * light.radiance * light.projected_area)


def test_a_cylinder_has_pi_times_its_radiance_times_its_side() -> None:
    light = lamp(LightKind.CYLINDER, radius=0.01, length=0.3)
    # the sine of the angle to x has a kink at its two ends
    assert emitted_power(light) == pytest.approx(np.pi * light.radiance * 2 * np.pi * 0.01 * 0.3, rel=1e-5)
    assert emitted_power(light) == pytest.approx(np.pi**2 * np.array(ONE), rel=1e-5)


def test_distant_and_dome_light_through_an_area() -> None:
    assert emitted_power(lamp(LightKind.DISTANT, angle=0.3), area=0.2) == pytest.approx(0.2 * np.array(ONE))
    assert emitted_power(lamp(LightKind.DOME), area=0.2) == pytest.approx(0.2 * np.pi * np.array(ONE))
    with pytest.raises(BrightfieldError, match="need an area"):
        emitted_power(lamp(LightKind.DOME))
    with pytest.raises(BrightfieldError, match="without an area"):
        emitted_power(lamp(LightKind.DISK), area=1.0)


@pytest.mark.parametrize("half_angle", [0.05, 0.7, 2.0])
def test_a_cone_lets_its_solid_angle_through(half_angle: float) -> None:
    light = lamp(LightKind.SPHERE, cone_angle=half_angle)
    assert power_per_intensity(light) == pytest.approx(2 * np.pi * (1 - np.cos(half_angle)))


@settings(deadline=None)
@given(focus=st.floats(0, 200))
def test_focus_is_a_power_of_the_cosine(focus: float) -> None:
    """∫ cos^n over the half-sphere is 2π / (n + 1); a disk has one cosine more."""
    light = lamp(LightKind.DISK, focus=focus)
    # a cosine to 200 is 4 degrees wide, a piece of the quadrature 3.75 with 8 nodes
    assert power_per_intensity(light) == pytest.approx(2 * np.pi / (focus + 2), rel=1e-6)


@pytest.mark.parametrize("softness", [0.3, 1.0])
def test_a_soft_cone_against_a_sum(softness: float) -> None:
    light = lamp(LightKind.SPHERE, cone_angle=0.9, cone_softness=softness)
    theta = (np.arange(200000) + 0.5) / 200000 * np.pi
    d = np.stack([np.sin(theta), 0 * theta, -np.cos(theta)], axis=-1)
    expected = 2 * np.pi * np.sum(light.shaping(d)[:, 0] * np.sin(theta)) * np.pi / 200000
    assert power_per_intensity(light)[0] == pytest.approx(expected, rel=1e-7)


@pytest.mark.parametrize("n", [1, 10, 80])
def test_a_profile_of_a_cosine_power(n: int) -> None:
    theta = np.radians(np.linspace(0, 90, 181))
    beam = Profile(np.zeros(1), theta, np.cos(theta)[None] ** n)
    # chords of the curve in steps of half a degree: second derivative n, 0.0087² / 8 n
    assert power_per_intensity(lamp(LightKind.SPHERE, profile=beam)) == pytest.approx(
        2 * np.pi / (n + 1), rel=1e-3
    )
    assert power_per_intensity(lamp(LightKind.DISK, profile=beam)) == pytest.approx(
        2 * np.pi / (n + 2), rel=1e-3
    )
    narrow = lamp(LightKind.SPHERE, profile=beam, profile_angle_scale=0.5)
    t = (np.arange(20000) + 0.5) / 20000 * np.pi / 4
    expected = 2 * np.pi * np.sum(np.cos(2 * t) ** n * np.sin(t)) * np.pi / 4 / 20000
    assert power_per_intensity(narrow) == pytest.approx(expected, rel=1e-3)


def test_textures_count() -> None:
    pixels = np.zeros((4, 4, 3), np.float32)
    pixels[:, :2] = (1.0, 0.5, 0.25)
    light = lamp(LightKind.RECT, width=0.1, height=0.1, texture=Texture(pixels, (Wrap.CLAMP, Wrap.CLAMP)))
    assert power_per_intensity(light) == pytest.approx(np.pi * np.array([0.5, 0.25, 0.125]), rel=1e-6)
    rng = np.random.default_rng(2)
    sky = Texture(rng.uniform(0, 1, (8, 16, 1)).astype(np.float32), (Wrap.REPEAT, Wrap.CLAMP))
    light = lamp(LightKind.DOME, texture=sky)
    from interchange.material import evaluate_texture

    n = 600
    u, v = np.meshgrid((np.arange(2 * n) + 0.5) / (2 * n), (np.arange(n) + 0.5) / n)
    uv = np.stack([u, v], -1)
    cosine = np.maximum(latlong_direction(uv)[..., 2], 0) * np.sin(np.pi * v)
    expected = np.sum(evaluate_texture(sky, uv)[..., 0] * cosine) * np.pi**2 / n**2
    assert power_per_intensity(light, area=1.0) == pytest.approx(expected, rel=1e-4)


def test_a_power_is_what_the_lamp_then_has() -> None:
    light = with_power(lamp(LightKind.DISK, radius=0.01, focus=7), watts=2.5)
    assert emitted_power(light) == pytest.approx([2.5] * 3)
    spectrum = illuminant("LED-B3")
    light = with_power(lamp(LightKind.SPHERE), lumens=806, spectrum=spectrum)
    watts = 806 / luminous_efficacy(spectrum)
    assert emitted_power(light).mean() == pytest.approx(watts)
    assert 2.4 < watts < 2.8  # a white LED has some 300 lm per radiant watt
    green = with_power(lamp(LightKind.SPHERE), lumens=683, spectrum=led(555, 0.5), color=(0, 1, 0))
    assert emitted_power(green) == pytest.approx([0, 1, 0], rel=1e-4)
    assert with_power(
        lamp(LightKind.SPHERE), watts=1, spectrum=illuminant("850 nm")
    ).intensity == pytest.approx([1 / (4 * np.pi)] * 3)


def test_candela_become_watts_per_steradian() -> None:
    """An IES profile's own flux in lm, over the efficacy, is the lamp's power."""
    theta = np.radians(np.linspace(0, 90, 91))
    beam = Profile(np.zeros(1), theta, 500 * np.cos(theta)[None] ** 5)
    spectrum = illuminant("LED-B1")
    light = Light("/l", LightKind.SPHERE, from_candela(spectrum), profile=beam)
    assert emitted_power(light) == pytest.approx([beam.power() / luminous_efficacy(spectrum)] * 3, rel=1e-4)


def test_mistakes_are_told() -> None:
    light = lamp(LightKind.SPHERE)
    with pytest.raises(BrightfieldError, match="in watts or in lumens, once"):
        with_power(light)
    with pytest.raises(BrightfieldError, match="Lumens need a spectrum"):
        with_power(light, lumens=3)
    with pytest.raises(BrightfieldError, match="not negative; got -1 W"):
        intensity_from_power(light, -1)
    with pytest.raises(BrightfieldError, match="lets none out"):
        intensity_from_power(lamp(LightKind.SPHERE, cone_angle=0.0), 1)


def radial(tmp_path, text: str) -> Profile:
    (tmp_path / "led.csv").write_text(text)
    return photometry.read(tmp_path / "led.csv")


def test_a_data_sheets_table_becomes_a_profile(tmp_path) -> None:
    profile = radial(tmp_path, "# OSRAM-like\nangle (deg),relative intensity (%)\n0,100\n30,50\n60,0\n")
    assert profile.evaluate(np.radians(15), 1.0) == pytest.approx(0.75)
    assert profile.evaluate(np.radians(61), 1.0) == 0
    assert len(profile.horizontal) == 1
    light = with_power(Light("/l", LightKind.SPHERE, (1, 1, 1), profile=profile), watts=1.5)
    assert emitted_power(light) == pytest.approx([1.5] * 3)
    # two chords: I (1 - θ / (π/3)) up to 60°: ∫ 2π sin θ (1 - 3 θ / π) dθ = 2π (1 - 3/π sin 60°)
    assert light.intensity[0] == pytest.approx(
        1.5 / (2 * np.pi * (1 - 3 / np.pi * np.sin(np.pi / 3))), rel=1e-6
    )


def test_two_sides_and_two_planes(tmp_path) -> None:
    profile = radial(tmp_path, "theta,I\n-40,0\n-20,0.5\n0,1\n20,0.8\n40,0\n")
    at = np.radians(20)
    assert profile.evaluate(at, 0.0) == pytest.approx(0.8)
    assert profile.evaluate(at, np.pi) == pytest.approx(0.5)
    assert profile.evaluate(at, np.pi / 2) == pytest.approx(0.65)
    profile = radial(tmp_path, "angle (rad);horizontal;vertical\n0;2;2\n0,5;1;0,5\n1;0;0\n")
    assert profile.evaluate(0.5, np.array([0, 0.5, 1, 1.5]) * np.pi) == pytest.approx([0.5, 0.25, 0.5, 0.25])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("wavelength,I\n400,1\n500,2\n", "must have a column of angles"),
        ("angle,I\n0,1\n0,2\n", "must increase"),
        ("angle,I\n10,1\n20,2\n", "begin at 0 or below"),
        ("angle,I\n0,1\n20,-2\n", "none of them negative"),
        ("angle (gon),I\n0,1\n20,2\n", "deg or rad; got gon"),
    ],
)
def test_tables_that_are_no_profile(text: str, message: str, tmp_path) -> None:
    with pytest.raises(FileError, match=message):
        radial(tmp_path, text)


def test_a_profile_written_as_ies_comes_back(tmp_path) -> None:
    theta, phi = np.radians(np.linspace(0, 72, 19)), np.radians(np.arange(0, 361, 30.0))
    values = 3 + np.cos(phi)[:, None] * np.sin(theta)
    profile = Profile(phi, theta, values)
    first, second = ies_write.saved(
        (lamp(LightKind.SPHERE, profile=profile), lamp(LightKind.DISK, profile=profile)), tmp_path
    )
    assert first.profile is second.profile
    back = photometry.read(first.profile.file)
    t, p = np.meshgrid(np.radians(np.linspace(0, 100, 57)), np.linspace(0, 6, 33))
    np.testing.assert_allclose(back.evaluate(t, p), profile.evaluate(t, p), atol=1e-6)
