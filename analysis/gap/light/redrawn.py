"""A rendering made anew where effects of the scene are in force: of what they can change alone.

Light straight from the lamps, and reflected light, where objects or their shadows can be seen to be elsewhere, of the
lamps that change where no other can; further away the reflected light's difference alone, which changes slowly over
the image: told by two renderings of half the sensor's grid with the same paths.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from analysis.gap.light.knots import lit_by, part_of
from analysis.gap.light.named import drawn, fingerprint, kept_on_disk
from analysis.gap.light.radiance import (
    FINE,
    PASSES,
    Changes,
    Paths,
    Render,
    Rendered,
    changed,
    finely_lit,
    pixels,
    render_all,
)
from analysis.gap.light.reach import cropped
from interchange.scene import Scene

COARSER = 4  # times, of the grid that far reflected light is drawn on
Planes = dict[str, np.ndarray]


def redrawn(
    base: Rendered, standing: Changes, render: Render, settings: dict[str, Any], cache: Path
) -> Rendered:
    """``base`` with ``standing`` in force. Without a finer grid, or of a renderer that draws no reflected light, all of
    it is rendered as ``base`` was. Kept in ``cache``."""
    after = changed(base.scene, standing)
    if not base.fine or not settings.get("indirect"):
        return replace(render_all([(after, base.camera)], render, settings, cache)[0], standing=standing)
    before, after = lit_by(standing, replace(base.scene, cameras=()), replace(after, cameras=()))
    camera = drawn(base.camera)
    part = part_of(before, after, standing, camera)
    both = (before.bodies, before.lights, after.bodies, after.lights)
    key = fingerprint((*both, camera, settings, base.finer if base.fine else FINE, COARSER, part is None))
    arrays = kept_on_disk(
        cache / f"{key[:32]}.npz",
        lambda: _near(after, base, part, render) | (_far(before, after, base, render) if part else {}),
    )
    return replace(_put(base, part, arrays, before), scene=changed(base.scene, standing), standing=standing)


def _near(scene: Scene, base: Rendered, part: tuple[slice, slice] | None, render: Render) -> Planes:
    """The lamps' light on the finer grid, the reflected share, and the passes."""
    camera = drawn(base.camera)
    eye = cropped(camera, *part) if part else camera
    lamps, rest = finely_lit(scene, eye, base.finer, render, True)
    return {f"fine:{k}": (p / base.scale).astype(np.float16) for k, p in lamps.items()} | rest


def _far(before: Scene, after: Scene, base: Rendered, render: Render) -> Planes:
    """How much more reflected light there is of each lamp, (H / COARSER, W / COARSER, 3)."""
    camera = drawn(base.camera)
    eye = camera.resized(max(camera.sensor.resolution[0] // COARSER, 1))
    there, here = (render(s, eye, ("indirect",), True, 1, Paths.REFLECTED).passes for s in (after, before))
    return {
        f"more:{k.removeprefix('indirect:')}": there[k] - here[k]
        for k in there
        if k.startswith("indirect:") and k in here
    }


def _put(base: Rendered, part: tuple[slice, slice] | None, arrays: Planes, lit: Scene) -> Rendered:
    n, (w, h) = base.finer, base.camera.sensor.resolution
    rows, columns = part or (slice(0, h), slice(0, w))
    inner = slice(n * rows.start, n * rows.stop), slice(n * columns.start, n * columns.stop)
    fine, indirect = dict(base.fine), dict(base.indirect)
    for name in (x.name for x in lit.lights if f"fine:{x.name}" in arrays):
        plane = base.fine[name].copy()
        if f"more:{name}" in arrays:
            more = cv2.resize(arrays[f"more:{name}"], (w, h), interpolation=cv2.INTER_LINEAR) / base.scale
            finely = np.repeat(np.repeat(more, n, axis=0), n, axis=1)
            plane = np.maximum(plane.astype(np.float32) + finely, 0).astype(np.float16)
        plane[inner] = arrays[f"fine:{name}"]
        fine[name] = plane
        share = indirect[name].copy()
        share[rows, columns] = arrays[f"indirect:{name}"]
        indirect[name] = share
    passes = dict(base.passes)
    for name in (k for k in arrays if k.split(":")[0] in PASSES and k in passes):
        whole = passes[name].copy()
        whole[rows, columns] = arrays[name]
        passes[name] = whole
    lamps = {name: pixels(plane, base.scale, base.camera) for name, plane in fine.items()}
    return replace(base, fine=fine, lamps=lamps, indirect=indirect, passes=passes)
