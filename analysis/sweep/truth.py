"""The ground truth of a frame: where each thing is seen, told by the renderer's own ids at the pixels' centres.

``seen`` are the pixels that show it, ``whole`` those that would if nothing stood before it: the same geometry drawn
alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from analysis.sweep.pieces import names_of
from interchange.camera import Camera
from interchange.formats.rle import encode
from interchange.image import Image
from interchange.scene import Scene


@dataclass(frozen=True, eq=False)
class Instance:
    """``name``: an object's path, or ``defects.scratch[0]``; ``kind``: "object", or the defect's. (H, W) bool masks.
    ``number``: of the object's model, from 1; 0 has none."""

    name: str
    kind: str
    seen: np.ndarray
    whole: np.ndarray
    number: int = 0

    def record(self) -> dict[str, Any]:
        """JSON-ready: run lengths and boxes (column, row, width, height) px."""
        return {
            "name": self.name,
            "kind": self.kind,
            "pixels": int(self.seen.sum()),
            "pixels_whole": int(self.whole.sum()),
            "box": box(self.seen),
            "rle": encode(self.seen),
        }


def box(mask: np.ndarray) -> list[int]:
    """Column, row, width, height of what is True; zeros where nothing is."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return [0, 0, 0, 0]
    return [int(columns[0]), int(rows[0]), int(np.ptp(columns)) + 1, int(np.ptp(rows)) + 1]


def ids_of(image: Image) -> np.ndarray:
    """(H, W) index into ``object_names``, -1 for nothing."""
    ids = np.asarray(image.passes["object_id"])
    return np.nan_to_num(ids.reshape(ids.shape[:2]).astype(np.float64), nan=-1).astype(int)


def mask_of(image: Image, names: Sequence[str]) -> np.ndarray:
    """(H, W) where one of the objects is seen."""
    return np.isin(ids_of(image), [k for k, name in enumerate(image.object_names) if name in names])


def alone(live: Any, scene: Scene, camera: Camera, names: Sequence[str]) -> np.ndarray:
    """(H, W) where the objects would be seen if there were nothing else. ``live``: a rasteriser."""
    bodies = tuple(b for b in scene.bodies if b.name in names)
    sharp = replace(camera, lens=replace(camera.lens, f_stop=0.0))
    image = live.render(replace(scene, bodies=bodies, lights=()), sharp, ("object_id",), samples=1)
    return ids_of(image) >= 0


def drawn_mask(live: Any, scene: Scene, camera: Camera, names: Sequence[str]) -> np.ndarray:
    """(H, W) where the objects are seen in a scene that is not the image's own."""
    sharp = replace(camera, lens=replace(camera.lens, f_stop=0.0))
    return mask_of(live.render(replace(scene, lights=()), sharp, ("object_id",), samples=1), names)


def instances(
    live: Any,
    scene: Scene,
    camera: Camera,
    image: Image,
    objects: Sequence[str],
    whole: bool,
) -> list[Instance]:
    """Every object of ``objects`` that the scene has, in that order. ``whole``: also what is hidden."""
    found = []
    for k, name in enumerate(objects):
        names = names_of(scene.object_names, name)
        if not names:
            continue
        seen = mask_of(image, names)
        full = seen | alone(live, scene, camera, names) if whole else seen
        found.append(Instance(name, "object", seen, full, k + 1))
    return found
