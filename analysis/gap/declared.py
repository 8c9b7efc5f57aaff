"""What the scene file says that a colour camera does to its pixels, taken back from captures before anything is fitted:
a colour matrix, and a mosaic whose captures are JPEGs. Where no JPEG is, the mosaic is taken back by what its pixels
measured (analysis.gap.binned).

Mixed channels have another noise than pixels have, and interpolated ones share theirs; in a JPEG no pixel is left as it
was measured. What all of it makes of a JPEG's errors is simulated and weighed (analysis.gap.compressed).
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from analysis.gap.matrices import WORST, Matrix, unmixed, with_matrices
from analysis.gap.processing import Processing
from analysis.gap.taken import Taken
from interchange.camera import Camera
from interchange.captures import Captures
from interchange.formats.document import Document
from interchange.scene import Scene
from interchange.sensor import IDENTITY, Demosaic, Mosaic


@dataclass(frozen=True, eq=False)
class Plain:
    """``captures`` as they were before, and a ``document`` whose cameras do none of it; ``processed``: by name what the
    cameras whose captures are JPEGs do."""

    captures: Captures
    document: Document
    processed: Mapping[str, Processing]


def without_declared(captures: Captures, document: Document) -> Plain:
    """What a matrix mixes that hardly can be taken back stays as it is."""
    by: list[Matrix] = []
    cameras: dict[str, Camera] = {}
    processed: dict[str, Processing] = {}
    for c in document.scene().cameras:
        own = [x for x in captures.captures if x.camera == c.name]
        if not own or any(x.pixels.shape[2] != 3 for x in own):
            continue
        matrix = _matrix(c)
        if matrix is not None:
            few = own[0].bits == 8 and c.sensor.bits_out > 8
            cameras[c.name] = replace(c, sensor=replace(c.sensor, output_bit_depth=8)) if few else c
            by.append(matrix)
        elif c.sensor.color_correction != IDENTITY:
            continue
        if c.sensor.jpeg_quality:
            way = Demosaic.BILINEAR if c.sensor.demosaic is Demosaic.NONE else c.sensor.demosaic
            mosaic = c.sensor.mosaic if c.sensor.mosaic.is_bayer else Mosaic.NONE
            does = Processing(c, matrix, mosaic, way, is_said=True)
            if does.is_there:
                processed[c.name] = does
    if not by and not processed:
        return Plain(captures, document, {})

    def plain(scene: Scene) -> Scene:
        unmixed_scene = with_matrices(scene, [replace(m, rows=np.eye(3)) for m in by])
        return replace(
            unmixed_scene, cameras=tuple(_of_all_channels(c, processed) for c in unmixed_scene.cameras)
        )

    return Plain(unmixed(captures, cameras, by), Taken(document, plain), processed)


def _matrix(camera: Camera) -> Matrix | None:
    """The camera's, if it mixes and can be taken back."""
    rows = np.array(camera.sensor.color_correction).reshape(3, 3)
    mixes = camera.sensor.color_correction != IDENTITY and np.linalg.cond(rows) < WORST
    return Matrix(camera.name, rows, (0.0,) * 6) if mixes else None


def _of_all_channels(camera: Camera, processed: Mapping[str, Processing]) -> Camera:
    if camera.name not in processed or not processed[camera.name].mosaic.is_bayer:
        return camera
    return replace(camera, sensor=replace(camera.sensor, mosaic=Mosaic.NONE))
