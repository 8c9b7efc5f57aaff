"""A scene at one moment: what is there, what lights it, who looks at it. World frame, metres, z up."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from interchange.camera import Camera
from interchange.frames import apply
from interchange.light import Light
from interchange.material import Material
from interchange.mesh import Mesh
from interchange.problems import BrightfieldError, Where, did_you_mean


@dataclass(frozen=True, eq=False)
class Body:
    """A surface of one material. A prim with several materials is several bodies with one ``name``."""

    name: str  # the object's prim path
    mesh: Mesh
    material: Material
    world_from_body: np.ndarray = field(default_factory=lambda: np.eye(4))  # (4, 4); scale and shear allowed
    where: Where = field(default=Where(), compare=False)


@dataclass(frozen=True, eq=False)
class Scene:
    """Records of what does not change with time are the same objects in every frame, so renderers keep them."""

    bodies: tuple[Body, ...] = ()
    lights: tuple[Light, ...] = ()
    cameras: tuple[Camera, ...] = ()
    time: float = 0.0  # time code
    seconds: float = 0.0  # s: when an exposure of it begins, by the clock that strobes go by
    source: str = ""  # file
    digest: str = ""  # SHA-256 of the file and of all it refers to

    @cached_property
    def object_names(self) -> tuple[str, ...]:
        """``object_names[i]`` is what pass ``object_id`` calls i."""
        return tuple(dict.fromkeys(b.name for b in self.bodies))

    @cached_property
    def material_names(self) -> tuple[str, ...]:
        """``material_names[i]`` is what pass ``material_id`` calls i."""
        return tuple(dict.fromkeys(b.material.name for b in self.bodies))

    def camera(self, name: str = "") -> Camera:
        """The camera of that name (a prim path or its last part); without a name, the only one."""
        if not self.cameras:
            raise BrightfieldError(f"The scene has no camera. ({self.source})")
        if not name:
            if len(self.cameras) == 1:
                return self.cameras[0]
            raise BrightfieldError(
                f"The scene has {len(self.cameras)} cameras; name one: {self._camera_list()}."
            )
        for camera in self.cameras:
            if name in (camera.name, camera.name.rsplit("/", 1)[-1]):
                return camera
        hint = did_you_mean(name, [n for c in self.cameras for n in (c.name, c.name.rsplit("/", 1)[-1])])
        raise BrightfieldError(
            f'No camera is called "{name}".{hint} There are {self._camera_list()}. ({self.source})'
        )

    def _camera_list(self) -> str:
        return ", ".join(c.name for c in self.cameras)

    @cached_property
    def bounds(self) -> np.ndarray:
        """(2, 3) m: lowest and highest world coordinates of the bodies; zeros for an empty scene."""
        corners = [apply(b.world_from_body, b.mesh.vertices) for b in self.bodies if len(b.mesh.vertices)]
        if not corners:
            return np.zeros((2, 3))
        return np.stack([np.min([c.min(0) for c in corners], 0), np.max([c.max(0) for c in corners], 0)])
