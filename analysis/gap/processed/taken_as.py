"""Cameras taken for what their captures are, where the scene file says otherwise."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

from analysis.gap.compared.conditions import Condition
from interchange.camera import Camera
from interchange.scene import Scene


class Told(Protocol):
    """What captures tell of one camera (analysis.gap.processed.encoded, analysis.gap.processed.compressed)."""

    @property
    def camera(self) -> str: ...

    def of(self, camera: Camera) -> Camera:
        """The camera as its captures are; others as they are."""
        ...


def taken_as(found: Sequence[Condition], told: Sequence[Told]) -> list[Condition]:
    """The conditions with their cameras as the captures are."""
    return [replace(c, camera=taken_for(c.camera, told)) for c in found]


def on_scene(scene: Scene, told: Sequence[Told]) -> Scene:
    """The same in a scene."""
    return replace(scene, cameras=tuple(taken_for(c, told) for c in scene.cameras))


def taken_for(camera: Camera, told: Sequence[Told]) -> Camera:
    """A camera as its captures are."""
    for one in told:
        camera = one.of(camera)
    return camera
