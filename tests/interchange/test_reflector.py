"""The parabolic reflector: Eq. 1 against rays that meet a paraboloid, its power and its even field."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from interchange.formats import ies_write, photometry
from interchange.formats.usd_author import author_scene
from interchange.formats.usd_read import SceneReader
from interchange.lamps.placing import total_power
from interchange.lamps.reflector import ReflectorDevice, hexagon
from interchange.problems import BrightfieldError
from interchange.scene import Scene

DEVICE = ReflectorDevice()


def mirrored(x: float, y: float, f: float) -> tuple[np.ndarray, np.ndarray]:
    """Where a ray that comes up parallel to z at (x, y) meets z = f - r²/4f, and the way that it then goes."""
    place = np.array([x, y, f - (x * x + y * y) / (4 * f)])
    normal = np.array([x / (2 * f), y / (2 * f), 1.0])  # gradient of z - f + r²/4f
    normal /= np.linalg.norm(normal)
    ray = np.array([0.0, 0, 1])
    return place, ray - 2 * (ray @ normal) * normal


@settings(deadline=None)
@given(r=st.floats(1e-3, 0.6), phi=st.floats(0, 6.28), f=st.floats(0.05, 0.4))
def test_equation_1_is_the_geometry_of_a_paraboloid(r: float, phi: float, f: float) -> None:
    device = ReflectorDevice(focal_length=f)
    place, ray = mirrored(r * np.cos(phi), r * np.sin(phi), f)
    along = -place @ ray
    assert np.linalg.norm(place + along * ray) < 1e-12  # it passes the focus
    theta = float(device.polar_angle(r))
    assert theta == pytest.approx(np.arctan2(4 * f * r, 4 * f * f - r * r))
    assert device.direction(phi, theta) == pytest.approx(-ray, abs=1e-12)
    assert device.distance(theta) == pytest.approx(along)
    assert device.radius(theta) == pytest.approx(r)
    if r > 2 * f:
        assert theta > np.pi / 2  # light from below the focal plane, as atan2 tells and atan would not


@settings(deadline=None)
@given(share=st.floats(0, 1), turn=st.floats(0, 6.28))
def test_a_spot_is_seen_from_the_focus_as_a_disk_of_its_own_size(share: float, turn: float) -> None:
    low, high = DEVICE.polar_range
    r = float(DEVICE.radius(low + share * (high - low)))
    s = 1e-5
    middle, _ = mirrored(r, 0.0, DEVICE.focal_length)
    edge, _ = mirrored(r + s * np.cos(turn), s * np.sin(turn), DEVICE.focal_length)
    angle = np.arccos(np.clip(middle @ edge / np.linalg.norm(middle) / np.linalg.norm(edge), -1, 1))
    assert angle * np.linalg.norm(middle) == pytest.approx(s, rel=1e-3)  # arccos near 1 has 1e-16 / angle


def test_the_series_has_24_by_6_directions() -> None:
    steps = DEVICE.steps()
    assert steps.shape == (144, 2)
    theta = np.unique(np.round(steps[:, 1], 9))
    assert len(theta) == 6
    assert np.diff(theta) == pytest.approx(np.diff(theta)[0])
    assert (theta[0], theta[-1]) == pytest.approx(DEVICE.polar_range)
    assert np.diff(steps[:24, 0]) == pytest.approx(2 * np.pi / 24)


def test_the_lamps_of_a_step_stand_on_the_reflector_and_have_its_power() -> None:
    device = replace(DEVICE, compensated=False, power=2.0)
    for phi, theta in device.steps(5, 3):
        lights = device.lights(phi, theta, rings=2)
        assert len(lights) == 19
        # chords of the lobe, 256 over five standard deviations: 3e-5
        assert total_power(lights[:1]) * 19 == pytest.approx([2.0 * 0.85] * 3, rel=1e-4)
        places = np.array([x.world_from_light[:3, 3] for x in lights])
        r2 = np.sum(places[:, :2] ** 2, axis=1)
        assert places[:, 2] == pytest.approx(device.focal_length - r2 / (4 * device.focal_length))
        for x in lights:
            to_focus = -x.world_from_light[:3, 3] / np.linalg.norm(x.world_from_light[:3, 3])
            assert -x.world_from_light[:3, 2] == pytest.approx(to_focus)
        assert sum(np.pi * x.radius**2 for x in lights) == pytest.approx(np.pi * device.spot_radius**2)
        mean = places.mean(axis=0)
        assert mean / np.linalg.norm(mean) == pytest.approx(
            device.direction(phi, theta), abs=1e-3
        )  # (s / d)² / 4


@pytest.mark.parametrize("rings", [0, 1, 2, 4])
def test_points_of_a_disk_share_its_area_and_its_second_moment(rings: int) -> None:
    points = hexagon(rings)
    assert len(points) == 1 + 3 * rings * (rings + 1)
    assert points.mean(axis=0) == pytest.approx([0, 0], abs=1e-12)
    if rings:  # a disk's mean of r² is one half; points without extent of their own have a little less
        assert np.mean(np.sum(points**2, axis=1)) == pytest.approx(0.5, abs=0.5 / len(points))


def test_the_field_is_even_over_15_mm() -> None:
    """The chapter: a circular area of radius about 15 mm of nearly homogeneous irradiance."""
    theta = np.linspace(*DEVICE.polar_range, 6)
    fields = [DEVICE.even_field(t) for t in theta]
    assert fields[0] == pytest.approx(0.015, abs=0.0005)
    assert np.all(np.diff(fields) > 0)
    E = [float(DEVICE.irradiance(t)) for t in theta]
    assert pytest.approx([E[0]] * 6) == E  # compensated
    # a duller reflector spreads the same power: the field grows with σ, the irradiance falls with σ² (small lobes)
    thin, thick = replace(DEVICE, dulling=0.02), replace(DEVICE, dulling=0.04)
    assert thick.even_field(1.0) / thin.even_field(1.0) == pytest.approx(2, rel=5e-3)
    assert float(thick.irradiance(1.0) / thin.irradiance(1.0)) == pytest.approx(0.25, rel=2e-3)


def test_the_field_integrates_to_the_power() -> None:
    """All of the lobe within 80 degrees passes the plane across the beam."""
    x = np.linspace(0, 3, 300001)
    E = DEVICE.irradiance(0.8, x)
    power = np.sum(E * 2 * np.pi * x) * x[1]
    assert power == pytest.approx(DEVICE.reflectance * DEVICE.spot_power(0.8), rel=1e-4)


def test_directions_outside_the_reflector_are_told() -> None:
    with pytest.raises(BrightfieldError, match=r"must lie in \[15\.\d+, 88\.\d+\] degrees; got 5"):
        DEVICE.lights(0.0, np.radians(5))
    with pytest.raises(BrightfieldError, match="must fit between the hole and the rim"):
        ReflectorDevice(diameter=0.07)


def test_a_series_is_time_samples_in_usd(tmp_path) -> None:
    ies_write.write(tmp_path / "lobe.ies", DEVICE.lobe())
    lobe = photometry.read(tmp_path / "lobe.ies")
    scenes = DEVICE.series(Scene(), DEVICE.steps(4, 2), lobe=lobe)
    assert [s.time for s in scenes] == list(range(8))
    stage = author_scene(scenes[0], frames=scenes[1:])
    reader = SceneReader(stage, "series.usda")
    for k in (0, 3, 7):
        back = reader.scene(float(k))
        for a, b in zip(scenes[k].lights, back.lights, strict=True):
            assert b.world_from_light == pytest.approx(a.world_from_light, abs=1e-9)
            assert b.intensity == pytest.approx(a.intensity, rel=1e-6)
            assert b.profile is not None
            assert b.cone_angle == pytest.approx(a.cone_angle, rel=1e-6)
