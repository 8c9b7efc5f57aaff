"""Bodies drawn through a distorting lens: the vertices are projected by its model, shaders/distort.glsl.

Between vertices a rasteriser draws straight lines, so faces with long edges are split in the tessellator, each edge by
its own length, distance and field angle, such that it lies less than ``tolerance`` px off (realtime.bend).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from realtime.bend import Bend
from realtime.bodies import Bodies, Group
from realtime.split import MOST_PATCHES, Split
from realtime.view import View

LIVE, STILL = 0.045, 0.02  # px: ``tolerance`` of a live image, and of one that is to be right
SIZE = 0.25  # of a face that the tessellator splits, over its least distance
LEVELS = 64  # pieces that the tessellator makes of an edge; OpenGL's least maximum


@dataclass(frozen=True, eq=False)
class Through:
    """One pass drawn through the model: ``view`` is that of the sensor's window, ``wide`` the clip matrix of all that
    the lens sees, undistorted; ``aperture``: the eye's shift over the distance in focus."""

    bend: Bend
    bodies: Bodies
    view: View
    wide: np.ndarray
    aperture: np.ndarray
    tolerance: float

    @cached_property
    def nearest(self) -> np.ndarray:
        """(B,) m: how near each body's surface may be, where it is seen."""
        if self.bend.telecentric:
            return np.ones(len(self.bodies.bodies))
        return np.maximum(self.bodies.nearest(self.view.world_from_eye[:3, 3]), self.view.near)

    @cached_property
    def lengths(self) -> np.ndarray:
        """(B,) m: how long an edge in the world may be that is drawn straight."""
        R, eye = self.view.world_from_eye[:3, :3], self.view.world_from_eye[:3, 3]
        centres, radii = (self.bodies.centres - self.bodies.origin - eye) @ R, self.bodies.radii
        off = np.hypot(centres[:, 0], centres[:, 1])
        if self.bend.telecentric:
            angle = off + radii
        else:
            distance = np.linalg.norm(centres, axis=1)
            with np.errstate(invalid="ignore", divide="ignore"):
                half = np.where(distance > radii, np.arcsin(np.minimum(radii / distance, 1)), np.pi)
            angle = np.arctan2(off, centres[:, 2]) + half
        reach = self.bend.reached(np.nan_to_num(angle, nan=np.pi))
        return np.asarray(self.nearest * np.sqrt(self.tolerance) * reach)

    @property
    def feasible(self) -> bool:
        """Whether no body is so near, for its size, that its faces would come to too many patches."""
        return all(g.geometry.patches(*self._lengths(g)) <= MOST_PATCHES for g in self.bodies.groups)

    def split(self, group: Group) -> Split | None:
        """A group's faces by whether they stay whole; None where all do."""
        return group.geometry.split(self.bodies.context, *self._lengths(group))

    def _lengths(self, group: Group) -> tuple[float, float]:
        """m, in the body's own frame: of edges that stay whole, and of those that the tessellator can split."""
        scale = float(self.bodies.scales[group.members, 1].max())
        length, nearest = float(self.lengths[group.members].min()), float(self.nearest[group.members].min())
        # inside of a patch of this size, nothing is more than 1 % nearer than its edges
        patch = LEVELS * length if self.bend.telecentric else min(LEVELS * length, SIZE * nearest)
        return length / scale, patch / scale

    @cached_property
    def uniforms(self) -> dict[str, object]:
        """Of shaders/distort.glsl and shaders/gbuffer_project.glsl."""
        view, bend = self.view, self.bend
        n, f = view.near, view.far
        depth = (-1 / (f - n), f / (f - n)) if view.telecentric else (-n / (f - n), n * f / (f - n))
        return {
            "eye_from_world": tuple(view.eye_from_world.T.ravel()),
            "window": (*(2 * view.focal / view.size), *(2 * view.centre / view.size - 1)),
            "depth": depth,
            "aperture": tuple(self.aperture),
            "radial": bend.radial[:4],
            "radial_high": bend.radial[4:],
            "prism": bend.prism,
            "tilt": bend.tilt or tuple(np.eye(3).ravel()),
            "field": bend.field,
        }

    def split_uniforms(self, group: Group) -> dict[str, object]:
        """Of shaders/gbuffer_tess_control.glsl."""
        return {
            "wide_from_world": tuple(self.wide.T.ravel()),
            "reach": tuple(np.sqrt(self.tolerance) * self.bend.reach),
            "widest": self.bend.widest,
            "shortest": float(self.lengths[group.members].min()),
            "nearest": float(self.nearest[group.members].min()),
        }
