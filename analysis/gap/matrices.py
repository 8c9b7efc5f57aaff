"""Whether captures went through a colour matrix of which the scene file does not say: most colour cameras that give
out interpolated images have one set. Told from captures and taken back before anything is fitted: mixed channels have
another noise than pixels have, and what a matrix does to saturated colours would be taken for their albedo.

Colours of captures follow from those simulated by one matrix, whatever all three channels have in common: lamps'
powers, vignetting, exposures. Cells of like colour are what counts, by their medians and away from edges. Light that
leaks into other channels (color_crosstalk) has no negative share: a matrix that has some is a camera's.

Finlayson, Mohammadzadeh Darrodi, Mackiewicz: The alternating least squares technique for nonuniform intensity color
correction. Color Research and Application 40(3), 2015: brightness of each colour is its own there, too.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.optimize import least_squares

from analysis.gap.conditions import Condition
from analysis.gap.diagnosis import Estimate
from analysis.gap.encoded import is_linear
from analysis.gap.expected import SATURATED
from interchange.camera import Camera
from interchange.captures import Capture, Captures
from interchange.effects.parts import called
from interchange.formats.document import Document
from interchange.scene import Scene
from interchange.sensor import IDENTITY

CELLS = 40  # of a chromaticity from 0 to 1
LEAST = 30  # pixels of a cell
EVEN = 0.1  # of a pixel's signal, that neighbours differ by less: beside an edge a mosaic's channels see other things
BRIGHT = 0.02  # of the range above black, that a pixel's channels have in the mean
DISTINCT = 0.1  # least singular value of cells' colours: that of black, white and one of a chroma of 0.1
NEGATIVE = 0.05  # share of another channel that is taken off, from which on a matrix is a camera's
BETTER = 3.0  # times less that it leaves of colours than gains of the channels alone
GROUNDS = (
    "Colours of a camera's captures follow from those simulated by one matrix that takes light of other channels off, "
    "which no sensor does: it was taken back before anything was fitted."
)
NAMES = ("rg", "rb", "gr", "gb", "br", "bg")  # of ColorCrosstalk, in the order of a matrix's rows
Cells = tuple[
    np.ndarray, np.ndarray, np.ndarray
]  # colours simulated and captured (n, 3), sums 1; weights (n,)


@dataclass(frozen=True, eq=False)
class Matrix:
    """``rows`` (3, 3) of a camera's matrix, sums 1; ``sigma`` (6,) of what is not on its diagonal."""

    camera: str
    rows: np.ndarray
    sigma: tuple[float, ...]

    @property
    def beside_diagonal(self) -> tuple[float, ...]:
        return tuple(map(float, self.rows[~np.eye(3, dtype=bool)]))

    def taken_back(self, dn: np.ndarray, black: float) -> np.ndarray:
        """(H, W, 3) as it was before the matrix."""
        back = np.linalg.inv(self.rows).T.astype(np.float32)
        return (dn - np.float32(black)) @ back + np.float32(black)


def matrices(found: Sequence[Condition]) -> list[Matrix]:
    """Of the cameras whose captures are linear and mixed."""
    cameras: dict[str, list[Condition]] = {}
    for c in found:
        sensor = c.camera.sensor
        if is_linear(sensor) and sensor.color_correction == IDENTITY and c.mean.shape[2] == 3:
            cameras.setdefault(c.camera.name, []).append(c)
    return [m for name, own in cameras.items() if (m := _matrix(name, [_cells(c) for c in own]))]


def numbers(by: Sequence[Matrix]) -> dict[str, Estimate]:
    """What is not on the diagonals, as ColorCrosstalk has it; by camera where there are several."""
    return {
        (f"{called(m.camera)} {name}" if len(by) > 1 else name): Estimate(x, s, "1")
        for m in by
        for name, x, s in zip(NAMES, m.beside_diagonal, m.sigma, strict=True)
    }


def unmixed(captures: Captures, document: Document, by: Sequence[Matrix]) -> Captures:
    """Captures as they were before the matrices. A pixel with a channel that was cut off, at the highest DN or at 0, is
    masked: what was lost there is no longer in it alone. Those of 8 bits are rounded to such again, so that they are
    taken for what they are."""
    of = {m.camera: m for m in by}
    sensors = {c.name: c.sensor for c in document.scene().cameras}

    def back(capture: Capture) -> Capture:
        if capture.camera not in of:
            return capture
        sensor, pixels = sensors[capture.camera], capture.pixels
        few = capture.bits == 8 and sensor.bits_out > 8
        top = 255 if few else 2**sensor.bits_out - 1
        cut = (pixels.max(axis=2) >= SATURATED * top) | (pixels.min(axis=2) <= 0)
        mask = ~cut if capture.mask is None else ~cut & capture.mask
        black = sensor.black_level * top / (2**sensor.bit_depth - 1)
        before = of[capture.camera].taken_back(pixels, black)
        if few:
            return replace(capture, pixels=np.clip(np.rint(before), 0, top), mask=mask)
        return replace(capture, pixels=before, mask=mask, bits=0)

    return replace(captures, captures=tuple(map(back, captures.captures)))


def as_mixed(c: Condition, dn: np.ndarray, by: Sequence[Matrix]) -> np.ndarray:
    """What a simulation without a matrix is beside captures whose matrix was taken back."""
    black = c.simulated().black * c.simulated().top / (2**c.camera.sensor.bit_depth - 1)
    return next((m.taken_back(dn, black) for m in by if m.camera == c.camera.name), dn)


def with_matrices(scene: Scene, by: Sequence[Matrix]) -> Scene:
    """The scene with the matrices that its file does not say."""
    of = {m.camera: m for m in by}

    def there(camera: Camera) -> Camera:
        if camera.name not in of:
            return camera
        rows = tuple(map(float, of[camera.name].rows.ravel()))
        return replace(camera, sensor=replace(camera.sensor, color_correction=rows))

    return replace(scene, cameras=tuple(map(there, scene.cameras)))


def _cells(c: Condition) -> Cells:
    """What a condition shows of each colour."""
    simulated = c.simulated()
    black = simulated.black * simulated.top / (2**c.camera.sensor.bit_depth - 1)
    around = np.ones((3, 3), np.uint8)
    steps = cv2.dilate(simulated.dn, around) - cv2.erode(simulated.dn, around)
    even = (steps < EVEN * (simulated.dn.max(axis=2, keepdims=True) - black)).all(axis=2)
    ok = c.compared & c.above_zero & even
    x, y = (np.asarray(dn[ok] - black, np.float64) for dn in (simulated.dn, c.mean))
    bright = np.minimum(x.mean(axis=1), y.mean(axis=1)) > BRIGHT * (simulated.top - black)
    x, y = (v[bright] / v[bright].sum(axis=1, keepdims=True) for v in (x, y))
    cell = np.rint(CELLS * x[:, :2]).astype(int) @ [CELLS + 1, 1]
    names, index, counts = np.unique(cell, return_inverse=True, return_counts=True)
    kept = [np.flatnonzero(index == k) for k in range(len(names)) if counts[k] >= LEAST]
    medians = [np.array([np.median(v[own], axis=0) for own in kept]).reshape(-1, 3) for v in (x, y)]
    return medians[0], medians[1], np.array([np.sqrt(len(own)) for own in kept])


def _matrix(name: str, conditions: Sequence[Cells]) -> Matrix | None:
    if len(conditions) < 2:
        return None
    every = _together(conditions)
    if len(every[0]) < 4 or np.linalg.svd(every[0], compute_uv=False)[2] < DISTINCT:
        return None  # too few colours
    gains, mixed = _followed(every, np.eye(3, dtype=bool)), _followed(every, np.ones((3, 3), bool))
    others = ~np.eye(3, dtype=bool)
    rows = _of_sum_one(mixed)
    if rows[others].min() > -NEGATIVE or _missed(every, gains) < BETTER * _missed(every, mixed):
        return None
    without = [
        _of_sum_one(_followed(_together([*conditions[:k], *conditions[k + 1 :]]), np.ones((3, 3), bool)))
        for k in range(len(conditions))
    ]
    sigma = np.sqrt((len(conditions) - 1) * np.var(without, axis=0))[others]  # the jackknife's
    return Matrix(name, rows, tuple(map(float, sigma))) if sigma.max() < NEGATIVE else None


def _together(conditions: Sequence[Cells]) -> Cells:
    x, y, weights = zip(*conditions, strict=True)
    return np.concatenate(x), np.concatenate(y), np.concatenate(weights)


def _followed(cells: Cells, there: np.ndarray) -> np.ndarray:
    """(3, 3), zero but where it is ``there``, its sum 3: what makes captured colours of those simulated, but for their
    brightness."""
    start = np.eye(3)

    def by(numbers: np.ndarray) -> np.ndarray:
        out = np.zeros((3, 3))
        out[there] = numbers
        return out

    solved = least_squares(lambda numbers: _left(cells, by(numbers)), start[there])
    found = by(solved.x)
    return np.asarray(3 * found / found.sum())


def _left(cells: Cells, by: np.ndarray) -> np.ndarray:
    """What is left of captured colours, weighted; one more number for the sum, which colours say nothing of."""
    x, y, weights = cells
    made = x @ by.T
    left = (y - made / made.sum(axis=1, keepdims=True)) * weights[:, None]
    return np.append(left, by.sum() - 3)


def _missed(cells: Cells, by: np.ndarray) -> float:
    """Rms of what is left of captured colours."""
    return float(np.sqrt(np.square(_left(cells, by)).sum() / np.square(cells[2]).sum())) + 1e-9


def _of_sum_one(by: np.ndarray) -> np.ndarray:
    """Rows' sums are gains of the channels, which are told as such."""
    return np.asarray(by / by.sum(axis=1, keepdims=True))
