"""Devices made of lamps: their power is conserved, their parts stand and look where they should."""

from dataclasses import replace

import numpy as np
import pytest

from interchange.camera import Camera, Lens, Sensor
from interchange.exposure import responsivity
from interchange.frames import look_at
from interchange.lamps import composite
from interchange.lamps.placing import total_power
from interchange.light import Profile
from interchange.power import emitted_power
from interchange.problems import BrightfieldError

theta = np.radians(np.linspace(0, 90, 91))
NARROW = Profile(np.zeros(1), theta, np.cos(theta)[None] ** 20)
CAMERA = Camera("/top", look_at(np.array([0.1, 0.2, 0.5]), np.array([0.1, 0.2, 0.0])))
TILTED = look_at(np.array([0.1, -0.2, 0.3]), np.zeros(3))

DEVICES = {
    "ring": lambda: composite.ring(3.0, 0.04, 12, 0.5, world_from_lamp=TILTED),
    "ring of narrow LEDs": lambda: composite.ring(3.0, 0.04, 12, 0.5, beam=NARROW),
    "dark field": lambda: composite.dark_field_ring(3.0, 0.05),
    "bar": lambda: composite.bar(3.0, 0.2, 0.02, world_from_lamp=TILTED),
    "bar of LEDs": lambda: composite.bar(3.0, 0.2, 0.02, 2, 10, beam=NARROW, world_from_lamp=TILTED),
    "line": lambda: composite.line(3.0, 0.3, 0.004, np.radians(8)),
    "backlight": lambda: composite.backlight(3.0, 0.1, 0.1),
    "coaxial": lambda: composite.coaxial(6.0, CAMERA, 0.05, 0.05),
}


@pytest.mark.parametrize("device", DEVICES)
def test_power_is_conserved(device: str) -> None:
    lights = DEVICES[device]()
    assert total_power(lights) == pytest.approx([3.0] * 3, rel=1e-6)
    assert len({x.name for x in lights}) == len(lights)


@pytest.mark.parametrize("hole", [0.0, 0.03])
def test_a_domes_power_leaves_through_its_base(hole: float) -> None:
    """L = P / (π² R² cos² θ_h)."""
    (light,) = composite.dome(3.0, 0.1, hole)
    assert emitted_power(light, area=np.pi * 0.1**2) == pytest.approx([3.0] * 3)
    sine = hole / 0.2
    # the hole's edge is 1e-5 rad wide
    assert light.radiance == pytest.approx(3.0 / (np.pi**2 * 0.1**2 * (1 - sine**2)), rel=1e-5)
    up, side = np.array([0.0, 0, -1]), np.array([np.sin(1.0), 0, -np.cos(1.0)])
    assert light.shaping(up)[0] == (0.0 if hole else 1.0)
    assert light.shaping(side)[0] == 1.0
    assert light.shaping(-side)[0] == 0.0


def test_a_rings_beams_cross_on_its_axis() -> None:
    lights = composite.ring(1.0, 0.04, 8, tilt=np.radians(30))
    for x in lights:
        place, along = x.world_from_light[:3, 3], -x.world_from_light[:3, 2]
        meet = place + along * 0.04 / np.sin(np.radians(30))
        assert meet == pytest.approx([0, 0, -0.04 / np.tan(np.radians(30))], abs=1e-12)
        assert np.linalg.det(x.world_from_light[:3, :3]) == pytest.approx(1)


def test_dark_field_comes_in_flat() -> None:
    for x in composite.dark_field_ring(1.0, 0.05, np.radians(12), 6):
        assert x.world_from_light[2, 2] == pytest.approx(np.sin(np.radians(12)))
    with pytest.raises(BrightfieldError, match="between 0 and 90 degrees"):
        composite.dark_field_ring(1.0, 0.05, np.radians(95))


def test_a_line_has_half_its_intensity_at_its_half_angle() -> None:
    (light,) = composite.line(1.0, 0.3, 0.004, np.radians(8))
    at = np.array([0, np.sin(np.radians(8)), -np.cos(np.radians(8))])
    assert light.shaping(at)[0] * np.cos(np.radians(8)) == pytest.approx(0.5)


def test_coaxial_light_runs_along_the_cameras_axis_both_ways() -> None:
    (light,) = composite.coaxial(1.0, CAMERA, 0.05, 0.05, distance=0.1, reflectance=0.4)
    assert -light.world_from_light[:3, 2] == pytest.approx(CAMERA.world_from_camera[:3, 2])
    assert light.world_from_light[:3, 3] == pytest.approx([0.1, 0.2, 0.4])
    assert total_power([light]) == pytest.approx([0.4] * 3)
    assert not light.visible
    for responsive in (100.0, 0.0):
        sensor = Sensor(responsivity=responsive, quantum_efficiency=(0.5, 0.5, 0.5))
        camera = replace(CAMERA, sensor=sensor, lens=Lens(f_stop=4.0))
        behind = composite.through_splitter(camera, 0.6)
        ratio = np.array(responsivity(behind.lens, behind.sensor)) / responsivity(camera.lens, camera.sensor)
        assert ratio == pytest.approx(0.6)
