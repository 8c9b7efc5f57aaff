"""What is under the cursor in the overview: a lamp's or a camera's lines first, then the surface by its id."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from composer.editor.glyphs import distance_to, on_screen
from interchange.camera import Camera
from interchange.scene import Scene
from realtime.renderers.rasterizer import Rasterizer

REACH = 6.0  # px from a line


def line_at(camera: Camera, lines: Mapping[str, np.ndarray], at: tuple[float, float]) -> str:
    """The path whose segments (N, 2, 3) pass nearest to a pixel, within REACH; "" for none."""
    found = {path: distance_to(on_screen(camera, segments)[0], at) for path, segments in lines.items()}
    best = min(found, key=lambda p: found[p], default="")
    return best if best and found[best] <= REACH else ""


def body_at(renderer: Rasterizer, scene: Scene, camera: Camera, at: tuple[float, float]) -> tuple[str, float]:
    """(path of the body, its depth in m) at a pixel; ("", inf) where nothing is. Draws that pixel alone."""
    if not scene.bodies:
        return "", float("inf")
    K = camera.K
    column, row = int(np.floor(at[0])), int(np.floor(at[1]))
    one = replace(
        camera,
        sensor=replace(camera.sensor, resolution=(1, 1)),
        principal_point=(K[0, 2] - column, K[1, 2] - row),
    )
    image = renderer.render(replace(scene, lights=()), one, passes=("object_id", "depth"), samples=1)
    index = int(image.passes["object_id"][0, 0])
    return (
        (image.object_names[index], float(image.passes["depth"][0, 0])) if index >= 0 else ("", float("inf"))
    )
