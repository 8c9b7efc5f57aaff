"""What a set-up shows of a workpiece; each thing is worked out once, when a measure or a constraint asks for it."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from analysis.optimise.noise import Signal, mean_of, signal
from analysis.tune.truth import EdgeTruth, edge_truth, straight
from analysis.tune.wireframe import Wires
from analysis.view.footprint import Footprint, footprint
from analysis.view.visibility import named
from interchange.camera import Camera
from interchange.image import Image
from interchange.problems import BrightfieldError
from interchange.scene import Scene

Render = Callable[
    [Scene, Camera, int], Image
]  # radiance with depth, position, normal and object_id; by a seed
REACH, STEP = 3.0, 0.5  # px to either side of an edge; between samples of its profile


class View:
    """``part``: the bodies that are inspected; ``defective``: the scene with its defects, None without any; ``live``: a
    rasteriser for what is geometry alone, ``render``: the renderer whose image counts.

    ``runs`` 2 renders everything twice, with seeds 0 and 1, so that squares can be taken as products of two images
    whose noise of the path tracer is not the same: their mean has no bias by it.
    """

    def __init__(
        self,
        scene: Scene,
        camera: Camera,
        part: Sequence[str],
        render: Render,
        live: Any,
        wires: Wires,
        defective: Scene | None = None,
        runs: int = 1,
    ) -> None:
        self.scene, self.camera, self.part, self.runs = scene, camera, tuple(part), runs
        self.defective, self._render, self._live, self._wires = defective, render, live, wires

    @cached_property
    def image(self) -> Image:
        return self._render(self.scene, self.camera, 0)

    @cached_property
    def signals(self) -> list[Signal]:
        """One a run."""
        more = [self._render(self.scene, self.camera, seed) for seed in range(1, self.runs)]
        return [signal(image, self.camera) for image in (self.image, *more)]

    @cached_property
    def signal(self) -> Signal:
        return mean_of(self.signals)

    @cached_property
    def defective_signals(self) -> list[Signal]:
        if self.defective is None:
            raise BrightfieldError("The visibility of defects needs one or more defects in the plan.")
        return [
            signal(self._render(self.defective, self.camera, seed), self.camera) for seed in range(self.runs)
        ]

    @cached_property
    def on_part(self) -> np.ndarray:
        """(H, W) bool: the pixels that show the part. Raises Unseen where there is none."""
        ids = np.asarray(self.image.passes["object_id"])
        ids = np.nan_to_num(ids.reshape(ids.shape[:2]).astype(np.float64), nan=-1)
        names = {b.name for b in named(self.scene, list(self.part))}
        shown = np.isin(ids, [k for k, n in enumerate(self.image.object_names) if n in names])
        if not shown.any():
            raise Unseen("Nothing of the part is seen.")
        return shown

    @cached_property
    def footprint(self) -> Footprint:
        return footprint(self.image, self.camera)

    @cached_property
    def edges(self) -> EdgeTruth:
        """The part's CAD edges. Raises Unseen where none is."""
        depth = self._live.render(_dark(self.scene), straight(self.camera), ["depth"], samples=1)
        found = edge_truth(self._wires.of(named(self.scene, list(self.part))), self.camera, depth)
        if not len(found.points):
            raise Unseen("No edge of the part is seen.")
        return found

    def across(self, plane: np.ndarray) -> np.ndarray:
        """(n, m) values of an (H, W) plane on the edges' profiles, every ``STEP`` px from -``REACH`` to ``REACH``."""
        import cv2

        t = np.arange(-REACH, REACH + STEP / 2, STEP)
        at = self.edges.points[:, None] + t[None, :, None] * self.edges.normals[:, None]
        return cv2.remap(
            np.ascontiguousarray(plane, np.float32),
            at[..., 0].astype(np.float32),
            at[..., 1].astype(np.float32),
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        ).astype(np.float64)


class Unseen(BrightfieldError):
    """A set-up that does not show what it is to be judged by."""


def squared(runs: Sequence[np.ndarray]) -> np.ndarray:
    """The square of what all ``runs`` are estimates of: of one run its own, of two their product."""
    return runs[0] * runs[-1]


def _dark(scene: Scene) -> Scene:
    return replace(scene, lights=())
