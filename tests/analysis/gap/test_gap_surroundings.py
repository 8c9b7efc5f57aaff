"""What the scene lacks around its parts is left out where captures show it, and kept where they are dark."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from analysis.gap.compared.conditions import Condition
from analysis.gap.light.radiance import Rendered
from analysis.gap.processed.surroundings import without_surroundings
from interchange.camera import Camera, Sensor
from interchange.light import Light, LightKind
from interchange.scene import Scene

LAMP, SIZE = "/lamp", (160, 120)
PART = np.zeros((SIZE[1], SIZE[0]), bool)
PART[16:48, 24:72] = True


def part(camera: str = "/eye") -> Condition:
    """A condition that shows a part before nothing, captured as it is."""
    eye = Camera(camera, sensor=Sensor(SIZE, (1e-6, 1e-6), responsivity=1000.0, full_well=1e4))
    scene = Scene(lights=(Light(LAMP, LightKind.SPHERE, (1.0, 1.0, 1.0)),))
    nothing = np.zeros((SIZE[1], SIZE[0], 3), np.float32)
    lamps = {LAMP: np.where(PART[..., None], 0.5, 0.0).repeat(3, axis=2).astype(np.float32)}
    passes = {"object_id": np.where(PART, 0, -1)}
    shown = Rendered(scene, eye, lamps, {LAMP: np.ones(3)}, nothing, nothing, {}, passes)
    bare = Condition((), scene, eye, nothing, None, np.ones(PART.shape, bool), rendered=shown)
    return replace(bare, mean=bare.simulated().dn)


def before_a_wall(c: Condition, share: float) -> Condition:
    """A wall behind the part, ``share`` as bright as it."""
    wall = share * (c.mean[PART] - c.simulated().black).mean()
    return replace(c, mean=c.mean + np.where(PART[..., None], 0.0, wall))


def without_light(c: Condition) -> Condition:
    lights = tuple(replace(light, intensity=(0.0, 0.0, 0.0)) for light in c.scene.lights)
    return replace(c, scene=replace(c.scene, lights=lights))


def test_a_wall_that_the_scene_lacks_is_left_out() -> None:
    (c,), (note,) = without_surroundings([before_a_wall(part(), 0.4)])
    assert c.mask[30, 40]
    assert not c.mask[~PART].any()
    assert not c.mask[16, 40], "a silhouette mixes with what is behind it"
    assert "40 % as bright" in note
    assert "eye" in note


@pytest.mark.parametrize("share", [0.0, 0.03])
def test_what_is_dark_is_kept(share: float) -> None:
    found, notes = without_surroundings([before_a_wall(part(), share)])
    assert found[0].mask.all()
    assert not notes


def test_each_camera_by_itself() -> None:
    found, notes = without_surroundings([before_a_wall(part("/a"), 0.4), part("/b")])
    assert not found[0].mask.all()
    assert found[1].mask.all()
    assert len(notes) == 1


def test_the_dark_is_no_reason() -> None:
    lit = part()
    found, notes = without_surroundings([replace(without_light(lit), mean=before_a_wall(lit, 0.4).mean)])
    assert found[0].mask.all()
    assert not notes


def test_a_black_level_is_no_surroundings() -> None:
    lit, dark = part(), without_light(part())
    level = 0.2 * lit.mean[PART].mean()
    higher = [replace(c, mean=c.simulated().dn + level) for c in (lit, dark)]
    found, notes = without_surroundings(higher)
    assert all(c.mask.all() for c in found)
    assert not notes


def test_what_a_blur_spreads_around_a_part_is_no_surroundings() -> None:
    c = part()
    found, notes = without_surroundings([replace(c, mean=cv2.GaussianBlur(c.mean, (0, 0), 5.0))])
    assert found[0].mask.all()
    assert not notes
