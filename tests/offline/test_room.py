"""Ambient light that is brighter to one side: a closed form, and the path tracer under that light itself."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.gap.light.radiance import render_all
from analysis.gap.renderers import renderer
from interchange.brdf.lambert import Lambert
from interchange.effects.ambient_light import AXES, AmbientLight
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.scene import Body, Scene
from offline.renderers.cycles import Cycles
from offline.settings import CyclesSettings
from tests.offline.conftest import Build

LIGHT = AmbientLight(L=0.8, x=0.3, y=-0.2, z=0.25)


def _ball_on_a_floor(build: Build) -> Scene:
    bodies = (
        Body("/floor", build.plane(0.2), Material("/m/floor", Lambert((0.6, 0.5, 0.4)))),
        Body(
            "/ball", build.sphere(0.05), Material("/m/ball", Lambert((0.5, 0.5, 0.5))), build.at(0, 0, 0.05)
        ),
    )
    return Scene(
        bodies, (Light("/lamp", LightKind.SPHERE, (1.0,) * 3, build.at(0.2, -0.2, 0.4), radius=0.01),)
    )


def test_of_a_ball_that_floats_by_its_normal(build: Build, tmp_path: Path) -> None:
    """Radiance g · ω gives a matte surface with normal n, which sees half of the directions, 2/3 g · n of what radiance
    1 from everywhere gives it: ∫ (g · ω)(n · ω) dω over the half is 2π/3 g · n, and π without g. The slope over some
    ninety pixels with a noise of 0.07 each, of normals with a deviation of 0.5, is good to 0.04 (three deviations)."""
    ball = _ball_on_a_floor(build).bodies[1]
    lamp = _ball_on_a_floor(build).lights
    camera = build.camera((0.2, -0.3, 0.2), (0, 0, 0.05), field=24.0, size=(73, 61))
    with renderer("offline", 81) as (render, settings):
        shown = render_all([(Scene((ball,), lamp), camera)], render, settings, tmp_path)[0]
    on = shown.passes["object_id"] == 0
    assert on.sum() > 500
    for k, axis in enumerate(AXES):
        assert shown.leaning[axis].shape == (61, 73, 3)
        slope, offset = np.polyfit(
            shown.passes["normal"][on][:, k], shown.leaning[axis][on][:, 1].astype(float), 1
        )
        assert slope == pytest.approx(2 / 3, abs=0.04)
        assert offset == pytest.approx(0, abs=0.03)


@pytest.mark.slow
def test_together_with_what_comes_from_everywhere_it_is_the_light_itself(
    build: Build, cycles: Cycles, tmp_path: Path
) -> None:
    """On a ball, on the floor around it, which it shades, and of light that went to and fro: against an image under
    that light. Of means over 6 x 6 pixels of one surface, whose noise is a hundredth of both: two hundredths rms."""
    scene = _ball_on_a_floor(build)
    camera = build.camera((0.2, -0.3, 0.25), (0, 0, 0.03), field=30.0, size=(72, 60))
    with renderer("offline", 64) as (render, settings):
        shown = render_all([(scene, camera)], render, settings, tmp_path)[0]
    told = LIGHT.L * shown.ambient + sum(g * shown.leaning[a] * shown.ambient
                                         for a, g in zip(AXES, LIGHT.toward, strict=True))  # fmt: skip
    dark = replace(scene, lights=())
    image = cycles.render(LIGHT.on_scene(dark), camera, CyclesSettings(samples=256, denoise=1))
    ids = shown.passes["object_id"]
    whole = np.all([np.roll(ids, step, (0, 1)) == ids for step in ((0, 1), (1, 0), (0, -1), (-1, 0))], axis=0)
    off = (np.stack([told, LIGHT.L * shown.ambient]) - image.pixels) / image.pixels[ids >= 0].mean()
    found = []
    for body in (0, 1):
        own = (whole & (ids == body)).reshape(10, 6, 12, 6, 1)
        n = own.sum(axis=(1, 3))
        blocks = (off.reshape(2, 10, 6, 12, 6, 3) * own).sum(axis=(2, 4)) / np.maximum(n, 1)
        found.append(blocks[:, n[..., 0] >= 18])
    rms, even = np.sqrt(np.mean(np.concatenate(found, axis=1) ** 2, axis=(1, 2)))
    assert rms < 0.02 < 0.1 < even
