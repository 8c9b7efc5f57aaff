"""How far captures lie off is told of edges, not of a sensor's pattern."""

from dataclasses import replace

import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.light.radiance import Rendered
from analysis.gap.processed.overlap import shifts
from interchange.camera import Camera, Sensor
from interchange.light import Light, LightKind
from interchange.scene import Scene

LAMP, SIZE = "/lamp", (96, 64)


def lit(radiance: np.ndarray) -> Condition:
    """A condition whose captures are what the scene shows: (H, W) that its one lamp gives."""
    camera = Camera("/eye", sensor=Sensor(SIZE, (1e-6, 1e-6), responsivity=1000.0, full_well=1e4))
    scene = Scene(lights=(Light(LAMP, LightKind.SPHERE, (1.0, 1.0, 1.0)),))
    nothing = np.zeros((SIZE[1], SIZE[0], 3), np.float32)
    lamps = {LAMP: np.repeat(radiance[..., None], 3, axis=2).astype(np.float32)}
    shown = Rendered(scene, camera, lamps, {LAMP: np.ones(3)}, nothing, nothing, {}, {})
    bare = Condition((), scene, camera, nothing, None, np.ones(nothing.shape[:2], bool), rendered=shown)
    return replace(bare, mean=bare.simulated().dn)


def test_uneven_columns_are_no_shift_of_a_plain_plate() -> None:
    column, row = np.meshgrid(np.linspace(-1, 1, SIZE[0]), np.linspace(-1, 1, SIZE[1]))
    plate = lit(0.5 - 0.1 * (column**2 + row**2))
    gains = 1 + 0.02 * np.random.default_rng(1).standard_normal(SIZE[0])
    assert shifts([replace(plate, mean=plate.mean * gains[:, None])]) == {}


def test_an_edge_that_is_off_is_told() -> None:
    column, row = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    box = lit(np.where((np.abs(column - 40) < 20) & (np.abs(row - 30) < 16), 0.6, 0.2))
    (off,) = shifts([replace(box, mean=np.roll(box.mean, (4, 3), (0, 1)))]).values()
    assert abs(off - 5) < 0.3
