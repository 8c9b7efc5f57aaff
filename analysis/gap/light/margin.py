"""What lies beyond the frame, where the image as found shows it: a lens that draws its image further in than the scene
file's, or a camera that looks aside, images what the file's would not.

Rendered as strips around what there is, on the finer grid alone, of the width that is asked for.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from analysis.gap.light.named import drawn, fingerprint, kept_on_disk
from analysis.gap.light.radiance import Render, Rendered, finely_lit
from analysis.gap.light.reach import cropped
from interchange.camera import Camera

LEAST = 1.0  # px: less is interpolation's own reach, and a registration's
SPARE = 2  # px more than a fit shows, as it goes on from there
MOST = 0.25  # of the image's shorter side: a fit that is further off is astray


def beyond(flow: np.ndarray | None) -> float:
    """How many px outside the frame an image lies that moves by ``flow`` (H, W, 2) px, where that is furthest."""
    if flow is None:
        return 0.0
    far = 0.0
    for axis, n in ((0, flow.shape[1]), (1, flow.shape[0])):
        along = np.arange(n, dtype=np.float32)
        place = (along if axis == 0 else along[:, None]) - flow[..., axis]
        far = max(far, float(-place.min()), float(place.max()) - (n - 1))
    return far


def margin_for(far: float, camera: Camera) -> int:
    """Pixels around the frame that ``far`` px outside of it ask for; 0 where interpolation reaches."""
    most = int(MOST * min(camera.sensor.resolution))
    return min(int(np.ceil(far)) + SPARE, most) if far > LEAST else 0


def widened(base: Rendered, margin: int, render: Render, settings: dict[str, Any], cache: Path) -> Rendered:
    """``base`` and what it has beside it, with ``margin`` pixels around. Without a finer grid there are none. Kept in
    ``cache``."""
    if not base.fine or margin <= base.margin:
        return base
    m, n, (w, h) = margin, base.finer, base.camera.sensor.resolution
    camera = drawn(base.camera)
    scene = replace(base.scene, cameras=())
    key = fingerprint((scene.bodies, scene.lights, camera, settings, n, base.scale, m))
    strips = {
        "above": (slice(-m, 0), slice(-m, w + m)),
        "below": (slice(h, h + m), slice(-m, w + m)),
        "left": (slice(0, h), slice(-m, 0)),
        "right": (slice(0, h), slice(w, w + m)),
    }

    def made() -> dict[str, np.ndarray]:
        found: dict[str, np.ndarray] = {}
        for word, strip in strips.items():
            lamps, _ = finely_lit(scene, cropped(camera, *strip), n, render, bool(settings.get("indirect")))
            found |= {f"{word}:{k}": (p / base.scale).astype(np.float16) for k, p in lamps.items()}
        return found

    arrays = kept_on_disk(cache / f"{key[:32]}.npz", made)
    inner = base.frame
    fine = {}
    for name, plane in base.fine.items():
        whole = np.zeros((n * (h + 2 * m), n * (w + 2 * m), plane.shape[2]), plane.dtype)
        whole[n * m : n * (m + h), n * m : n * (m + w)] = plane[inner]
        for word, (rows, columns) in strips.items():
            if f"{word}:{name}" in arrays:
                there = tuple(slice(n * (x.start + m), n * (x.stop + m)) for x in (rows, columns))
                whole[there] = arrays[f"{word}:{name}"]
        fine[name] = whole
    others = tuple(widened(x, margin, render, settings, cache) for x in base.elsewhere)
    moved = base.moved and widened(base.moved, margin, render, settings, cache)
    return replace(base, fine=fine, margin=margin, elsewhere=others, moved=moved)
