"""Samples from images: what a renderer drew with a BRDF comes back as that BRDF, pixel by pixel."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.image_samples import samples_of_image, samples_of_series
from interchange.brdf.lafortune import Lafortune
from interchange.camera import Camera, Lens, Sensor
from interchange.formats import gprims
from interchange.frames import look_at
from interchange.image import Image, Quantity
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.problems import BrightfieldError
from interchange.scene import Body, Scene
from realtime.renderers.rasterizer import Rasterizer

PAINT = Lafortune((0.3, 0.2, 0.1), weight=[(0.6, 0.6, 0.6)], C=[(-1, -1, 1)], n=[10])


def posed(x: float, y: float, z: float) -> np.ndarray:
    pose = look_at(np.array([x, y, z]), np.zeros(3))
    pose[:3, 1:3] *= -1
    return pose


@pytest.fixture(scope="module")
def images() -> list[tuple[Image, Light]]:
    """A ball under a spot, a bulb, and distant light, one after the other."""
    camera = Camera(
        "c",
        look_at(np.array([0, -0.8, 0.5]), np.zeros(3)),
        Lens(focal_length=3e-3),
        Sensor((80, 80), (1e-5, 1e-5)),
    )
    lights = [
        Light("/spot", LightKind.DISK, (1.0, 2.0, 3.0), posed(0.5, -0.6, 0.7), focus=2.0),
        Light("/bulb", LightKind.SPHERE, (2.0, 2.0, 2.0), posed(-0.6, -0.3, 0.5)),
        Light("/sun", LightKind.DISTANT, (3.0, 2.0, 1.0), posed(0.1, -0.5, 1.0)),
    ]
    bodies = (Body("/ball", gprims.sphere(0.1, 160), Material("paint", PAINT)),)
    with Rasterizer() as renderer:
        return [
            (
                renderer.render(Scene(bodies, (light,)), camera, ["position", "normal", "lit"], samples=1),
                light,
            )
            for light in lights
        ]


def test_a_rendered_ball_gives_its_brdf_back(images: list[tuple[Image, Light]]) -> None:
    samples = samples_of_series(images)
    used = samples.masked()
    assert len(used) > 1000
    assert used.f == pytest.approx(
        PAINT.evaluate(used.wi, used.wo), rel=5e-3
    )  # 160 x 80 faces, single precision
    assert used.theta[0].max() > np.radians(75)
    assert len(samples) > len(used)


def test_noise_and_masks_go_along(images: list[tuple[Image, Light]]) -> None:
    image, light = images[1]
    mask = np.zeros((80, 80), bool)
    mask[:, :40] = True
    s = samples_of_image(image, light, mask=mask, sigma=0.01)
    whole = samples_of_image(image, light)
    assert 0 < s.usable.sum() < whole.usable.sum()
    assert s.sigma is not None
    at = s.usable
    pixel = image.pixels[np.isfinite(image.passes["position"]).all(-1)][at]
    assert s.sigma[at] / s.f[at] == pytest.approx(0.01 / pixel, rel=1e-5)


def test_shadow_is_left_out(images: list[tuple[Image, Light]]) -> None:
    image, light = images[1]
    lit = np.ones((80, 80), np.float32)
    lit[:, 30:] = 0.0
    dark = samples_of_image(replace(image, passes={**image.passes, "lit:/bulb": lit}), light)
    assert 0 < dark.usable.sum() < samples_of_image(image, light).usable.sum()
    assert "pixels are in shadow" in str(dark.notes[0])


def test_what_has_no_direction_is_refused(images: list[tuple[Image, Light]]) -> None:
    image, light = images[1]
    with pytest.raises(BrightfieldError, match="/bulb must be a small lamp or distant light; it is a dome"):
        samples_of_image(image, replace(light, kind=LightKind.DOME))
    large = samples_of_image(image, replace(light, radius=0.5))
    assert not large.usable.any()
    with pytest.raises(BrightfieldError, match="must hold radiance; it holds DN"):
        samples_of_image(replace(image, quantity=Quantity.DN), light)
    with pytest.raises(BrightfieldError, match="normal is missing"):
        samples_of_image(replace(image, passes={"position": image.passes["position"]}), light)
