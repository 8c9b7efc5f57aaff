"""What a lamp's numbers mean."""

import numpy as np
import pytest

from interchange.light import Light, LightKind, Profile


def test_sphere_of_any_radius_has_the_same_radiant_intensity():
    small, large = (Light("a", LightKind.SPHERE, (2, 2, 2), radius=r) for r in (0.001, 0.1))
    for lamp in (small, large):
        assert lamp.radiance * np.pi * lamp.radius**2 == pytest.approx([2, 2, 2])
    assert Light("a", LightKind.SPHERE, (2, 2, 2)).is_delta


def test_cone_ends_where_it_says_and_softens_inside():
    """UsdLux: 1 - smoothstep from (1 - softness) cutoff to cutoff; half-way it is one half."""
    lamp = Light("a", LightKind.SPHERE, (1, 1, 1), cone_angle=1.0, cone_softness=0.5)

    def at(theta):
        return lamp.shaping(np.array([np.sin(theta), 0, -np.cos(theta)]))[0]

    assert at(0.4) == 1
    assert at(0.75) == pytest.approx(0.5)
    assert at(1.01) == 0


def test_focus_is_a_cosine_power_with_its_tint():
    lamp = Light("a", LightKind.DISK, (1, 1, 1), focus=2, focus_tint=(1, 0, 0))
    direction = np.array([np.sin(1), 0, -np.cos(1)])
    assert lamp.shaping(direction) == pytest.approx([1, np.cos(1) ** 2, np.cos(1) ** 2])


def test_isotropic_profile_has_4_pi_times_its_candela():
    vertical = np.linspace(0, np.pi, 19)
    profile = Profile(np.array([0.0]), vertical, np.full((1, 19), 100.0))
    assert profile.power() == pytest.approx(400 * np.pi, rel=1e-5)


def test_profile_is_bilinear_and_ends_with_its_angles():
    profile = Profile(
        np.array([0, np.pi, 2 * np.pi]), np.array([0, np.pi / 2]), np.array([[10.0, 0], [20.0, 10], [10, 0]])
    )
    assert profile.evaluate(np.array(np.pi / 4), np.array(np.pi / 2)) == pytest.approx(10.0)
    assert profile.evaluate(np.array(np.pi * 0.75), np.array(0.0)) == 0
