"""What every defect is: declared parameters, a place on an object, and one function that puts it into a scene.

    seen   where the image shows it;    whole   where it would be shown if nothing else stood before it

``present`` is a parameter as any other, so that its rate is sampled and weighed like the rest.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from analysis.sweep.carve import carve
from analysis.sweep.footprint import Footprint
from analysis.sweep.pieces import names_of, object_of, piece, pieces_of
from analysis.sweep.surface import Anchor, OffSurface, frame_at, runs_over_edge
from analysis.sweep.truth import alone, mask_of
from interchange.camera import Camera
from interchange.image import Image
from interchange.material import Material
from interchange.parameter import freeze, parameter
from interchange.scene import Body, Scene

Truth = Callable[[Any, Camera, Image], tuple[np.ndarray, np.ndarray]]  # rasteriser, camera, the frame's image


@dataclass(frozen=True, eq=False)
class Placed:
    """The scene with a defect in it, and its ground truth."""

    scene: Scene
    truth: Truth


@dataclass(frozen=True)
class Defect:
    source: ClassVar[str]
    needs_place: ClassVar[bool] = False

    present: float = parameter(1.0, "b", "1", 0, 1, "whether it is there: at 0.5 and more")

    def __post_init__(self) -> None:
        freeze(self)

    def on(self, scene: Scene, target: str, anchor: Anchor, label: str) -> Placed:
        """``target``: the object's path; ``label``: what the defect's surface is called among the object's pieces
        (analysis.sweep.pieces). Raises OffSurface where there is no room for it."""
        raise NotImplementedError


@dataclass(frozen=True)
class SurfaceDefect(Defect):
    """One that changes a piece of the surface: geometry within its outline, or the material there."""

    needs_place = True

    x: float = parameter(0.0, "x", "mm", -1e4, 1e4, "from the anchor, across the view onto the surface")
    y: float = parameter(0.0, "y", "mm", -1e4, 1e4, "from the anchor, upwards in the view onto the surface")
    angle: float = parameter(0.0, "φ", "mrad", -6300, 6300, "turned counter-clockwise about the normal")

    def footprint(self) -> Footprint:
        raise NotImplementedError

    def material(self, material: Material) -> Material:
        """What the surface within the outline is made of."""
        return material

    def on(self, scene: Scene, target: str, anchor: Anchor, label: str) -> Placed:
        shape = self.footprint()
        bodies = pieces_of(scene, [target])
        if not bodies:
            raise OffSurface(f"{label} must lie on {target}; it is not there.")
        defect_from_world = frame_at(bodies, anchor, 1e-3 * self.x, 1e-3 * self.y, 1e-3 * self.angle)
        if not shape.is_flat and runs_over_edge(bodies, defect_from_world, shape):
            raise OffSurface(f"{label} must lie on {target}; it runs over an edge.")
        new: list[Body] = []
        for body in scene.bodies:
            if object_of(body.name) != target:
                new.append(body)
                continue
            rest, own = carve(body.mesh, defect_from_world @ body.world_from_body, shape)
            if rest is not None:
                new.append(body if own is None else replace(body, mesh=rest))
            if own is not None:
                name = piece(body.name, label)
                new.append(replace(body, name=name, mesh=own, material=self.material(body.material)))
        after = replace(scene, bodies=tuple(new))
        if not names_of(after.object_names, target, label):
            raise OffSurface(f"{label} must lie on {target}; no surface is there.")

        def truth(live: Any, camera: Camera, image: Image) -> tuple[np.ndarray, np.ndarray]:
            names = names_of(
                image.object_names, target, label
            )  # later defects may have cut it into more pieces
            return mask_of(image, names), alone(
                live, after, camera, names_of(after.object_names, target, label)
            )

        return Placed(after, truth)
