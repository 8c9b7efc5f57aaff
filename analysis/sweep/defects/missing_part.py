"""A part that is not there. Its ground truth is where it would be seen."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from analysis.sweep.defect import Defect, Placed
from analysis.sweep.pieces import names_of, object_of
from analysis.sweep.surface import Anchor
from analysis.sweep.truth import alone, drawn_mask
from interchange.camera import Camera
from interchange.image import Image
from interchange.scene import Scene


@dataclass(frozen=True)
class MissingPart(Defect):
    source = "Presence control, the plainest task of inspection: VDI/VDE/VDMA 2632-2."

    def on(self, scene: Scene, target: str, anchor: Anchor, label: str) -> Placed:
        after = replace(scene, bodies=tuple(b for b in scene.bodies if object_of(b.name) != target))

        def truth(live: Any, camera: Camera, image: Image) -> tuple[np.ndarray, np.ndarray]:
            names = names_of(scene.object_names, target)
            return drawn_mask(live, scene, camera, names), alone(live, scene, camera, names)

        return Placed(after, truth)
