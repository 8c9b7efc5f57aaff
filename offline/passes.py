"""From a worker's arrays to the passes of interchange.image."""

from collections.abc import Sequence

import numpy as np

from interchange.camera import Camera
from interchange.frames import apply
from interchange.scene import Scene
from offline.protocol import unwrap_normal


def assemble(
    arrays: dict[str, np.ndarray],
    scene: Scene,
    camera: Camera,
    asked: Sequence[str],
    per_light: bool,
    next_scene: Scene | None,
) -> dict[str, np.ndarray]:
    """The passes in ``asked``; arrays as ``offline.frame`` describes them."""
    passes: dict[str, np.ndarray] = {}
    if "direct" in asked:
        passes["direct"] = arrays["direct"]
    if "indirect" in asked:
        passes["indirect"] = arrays["pixels"] - arrays["direct"]
    if "lit" in asked:
        for k, light in enumerate(scene.lights):
            passes[f"lit:{light.name}"] = arrays["lit"][..., k]
    if per_light:
        for k, light in enumerate(scene.lights):
            passes[f"light:{light.name}"] = arrays["light"][k]
            if "indirect" in asked:
                passes[f"indirect:{light.name}"] = arrays["light_indirect"][k]
    if "truth" not in arrays:
        return passes
    body = np.rint(arrays["truth"][..., 2]).astype(np.int64) - 1
    hit = body >= 0
    position = np.where(hit[..., None], arrays["position"].astype(np.float64), np.nan)
    if "position" in asked:
        passes["position"] = position.astype(np.float32)
    if "depth" in asked:
        depth = apply(camera.camera_from_world, position)[..., 2]
        passes["depth"] = np.where(hit, depth, np.inf).astype(np.float32)
    if "normal" in asked:
        normal = unwrap_normal(arrays["truth"])
        passes["normal"] = np.where(hit[..., None], normal, np.nan).astype(np.float32)
    for name, names, of in (
        ("object_id", scene.object_names, [b.name for b in scene.bodies]),
        ("material_id", scene.material_names, [b.material.name for b in scene.bodies]),
    ):
        if name in asked:
            index = {n: k for k, n in enumerate(names)}
            table = np.array([*(index[n] for n in of), -1], np.int32)
            passes[name] = table[np.where(hit, body, -1)]
    if "motion" in asked and next_scene is not None:
        passes["motion"] = motion(position, body, scene, next_scene, camera)
    return passes


def motion(position: np.ndarray, body: np.ndarray, scene: Scene, after: Scene, camera: Camera) -> np.ndarray:
    """(H, W, 2) px (column, row) that each point moves until the next frame; NaN where it is not known.

    The point keeps its place on its body; ``after`` holds the same bodies in the same order, or by their names.
    """
    if len(after.bodies) == len(scene.bodies):
        partner = list(after.bodies)
    else:
        by_name = {(b.name, b.material.name): b for b in after.bodies}
        partner = [by_name.get((b.name, b.material.name), b) for b in scene.bodies]
    later = np.full(position.shape, np.nan)
    for k, (now, then) in enumerate(zip(scene.bodies, partner, strict=True)):
        on = body == k
        if on.any():
            later[on] = apply(then.world_from_body @ np.linalg.inv(now.world_from_body), position[on])
    next_camera = next((c for c in after.cameras if c.name == camera.name), camera)
    return (next_camera.project(later) - camera.project(position)).astype(np.float32)
