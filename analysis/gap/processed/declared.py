"""What the scene file says that a colour camera does to its pixels, taken back from captures before anything is fitted:
a colour matrix, and a mosaic whose captures are JPEGs. Where no JPEG is, the mosaic is taken back by what its pixels
measured (analysis.gap.processed.binned).

Mixed channels have another noise than pixels have, and interpolated ones share theirs; in a JPEG no pixel is left as it
was measured. What all of it makes of a JPEG's errors is simulated and weighed (analysis.gap.processed.compressed).
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from analysis.gap.processed.matrices import WORST, Matrix, unmixed, with_matrices
from analysis.gap.processed.processing import Processing
from analysis.gap.processed.taken import Taken
from interchange.camera import Camera
from interchange.captures import Captures
from interchange.formats.document import Document
from interchange.scene import Scene
from interchange.sensor import IDENTITY, Demosaic, Mosaic


@dataclass(frozen=True, eq=False)
class Declared:
    """``mixed``: the matrices that can be taken back; ``processed``: by name what cameras of JPEGs do."""

    mixed: tuple[Matrix, ...]
    processed: Mapping[str, Processing]

    def document(self, document: Document) -> Document:
        """``document`` without it."""
        return Taken(document, self._plain) if self.mixed or self.processed else document

    def _plain(self, scene: Scene) -> Scene:
        scene = with_matrices(scene, [replace(m, rows=np.eye(3)) for m in self.mixed])
        cameras = tuple(_of_all_channels(c, self.processed.get(c.name)) for c in scene.cameras)
        return replace(scene, cameras=cameras)


@dataclass(frozen=True, eq=False)
class Plain:
    """``captures`` as they were before what the file ``says``, and a ``document`` whose cameras do none of it."""

    captures: Captures
    document: Document
    says: Declared

    @property
    def processed(self) -> Mapping[str, Processing]:
        """By name what the cameras whose captures are JPEGs do."""
        return self.says.processed


def declared(captures: Captures, document: Document) -> Declared:
    """What a matrix mixes that hardly can be taken back stays as it is."""
    by: list[Matrix] = []
    processed: dict[str, Processing] = {}
    for c in document.scene().cameras:
        own = [x for x in captures.captures if x.camera == c.name]
        if not own or any(x.pixels.shape[2] != 3 for x in own):
            continue
        matrix = _matrix(c)
        if matrix is not None:
            by.append(matrix)
        elif c.sensor.color_correction != IDENTITY:
            continue
        if c.sensor.jpeg_quality:
            way = Demosaic.BILINEAR if c.sensor.demosaic is Demosaic.NONE else c.sensor.demosaic
            mosaic = c.sensor.mosaic if c.sensor.mosaic.is_bayer else Mosaic.NONE
            does = Processing(c, matrix, mosaic, way, mosaic_is_said=mosaic.is_bayer)
            if does.is_there:
                processed[c.name] = does
    return Declared(tuple(by), processed)


def without_declared(captures: Captures, document: Document) -> Plain:
    found = declared(captures, document)
    bits = {x.camera: x.bits for x in captures.captures}
    cameras = {c.name: of_bits(c, bits[c.name]) for c in document.scene().cameras if c.name in bits}
    return Plain(unmixed(captures, cameras, found.mixed), found.document(document), found)


def _matrix(camera: Camera) -> Matrix | None:
    """The camera's, if it mixes and can be taken back."""
    rows = np.array(camera.sensor.color_correction).reshape(3, 3)
    mixes = camera.sensor.color_correction != IDENTITY and np.linalg.cond(rows) < WORST
    return Matrix(camera.name, rows, (0.0,) * 6) if mixes else None


def of_bits(camera: Camera, bits: int) -> Camera:
    """The camera whose files have ``bits``: those of 8 are its highest ones."""
    few = bits == 8 and camera.sensor.bits_out > 8
    return replace(camera, sensor=replace(camera.sensor, output_bit_depth=8)) if few else camera


def _of_all_channels(camera: Camera, does: Processing | None) -> Camera:
    if does is None or not does.mosaic.is_bayer:
        return camera
    return replace(camera, sensor=replace(camera.sensor, mosaic=Mosaic.NONE))
