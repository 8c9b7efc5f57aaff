"""Which mechanical limit a set-up breaks, "" for none; what costs no image is asked first."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from analysis.optimise.plan import Plan
from analysis.optimise.view import View
from analysis.sweep.constraint import Moment
from interchange.frames import apply
from interchange.scene import Body, Scene


def broken_before(plan: Plan, scene: Scene, live: Any) -> str:
    """By geometry alone: clearances, the plan's constraints, what the camera sees of the part."""
    camera = scene.camera(plan.camera)
    limits = plan.limits
    if limits.clearance > 0:
        poses = {x.name: x.world_from_light for x in scene.lights} | {
            c.name: c.world_from_camera for c in scene.cameras
        }
        for name in limits.clear:
            if distance(scene.bodies, poses[name][:3, 3]) < limits.clearance:
                return f"clearance of {name.rsplit('/', 1)[-1]}"
    moment = Moment(scene, (camera,), lambda: live)
    for constraint in plan.constraints:
        if constraint.breaks(moment):
            return constraint.told
    if limits.seen > 0:
        found = moment.visibility(camera, plan.part)
        if found is None or found.seen < limits.seen - 1e-9:
            return "part seen"
    return ""


def broken_by_image(plan: Plan, view: View) -> str:
    """By the image: saturated pixels on the part."""
    if (
        plan.limits.saturated < 1
        and float(view.signal.saturated[view.on_part].mean()) > plan.limits.saturated
    ):
        return "saturation"
    return ""


def distance(bodies: Sequence[Body], point: np.ndarray) -> float:
    """m from a point (3,) to the nearest surface; inf without bodies."""
    from trimesh import triangles

    library: Any = triangles  # without annotations
    nearest = float("inf")
    for body in bodies:
        corners = apply(body.world_from_body, body.mesh.vertices)[body.mesh.faces]
        if not len(corners):
            continue
        low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        if np.linalg.norm(np.maximum(np.maximum(low - point, point - high), 0)) >= nearest:
            continue
        there = library.closest_point(corners, np.broadcast_to(point, (len(corners), 3)))
        nearest = min(nearest, float(np.linalg.norm(there - point, axis=1).min()))
    return nearest
