"""Whether captures went through a colour matrix of which the scene file does not say: most colour cameras that give
out interpolated images have one set, before their curve. Told from captures and taken back before anything is fitted:
mixed channels have another noise than pixels have, and what a matrix does to saturated colours would be taken for their
albedo.

Colours of captures follow from those simulated by one matrix, whatever all three channels have in common: lamps'
powers, vignetting, exposures. Cells of like colour are what counts, by their medians and away from edges. Light that
leaks into other channels (color_crosstalk) has no negative share: a matrix that has some is a camera's.

Finlayson, Mohammadzadeh Darrodi, Mackiewicz: The alternating least squares technique for nonuniform intensity color
correction. Color Research and Application 40(3), 2015: brightness of each colour is its own there, too.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.optimize import least_squares

from analysis.gap.compared.conditions import Condition
from analysis.gap.finding import Estimate
from analysis.gap.parallel import each
from analysis.gap.sensor.expected import SATURATED
from interchange.camera import Camera
from interchange.captures import Capture, Captures
from interchange.effects.color_crosstalk import ColorCrosstalk
from interchange.effects.parts import called
from interchange.effects.response_curve import ResponseCurve
from interchange.scene import Scene
from interchange.sensor import IDENTITY

CELLS = 100  # of a chromaticity from 0 to 1
LEAST = 30  # pixels of a cell
EVEN = 0.1  # of a pixel's signal, that neighbours differ by less: beside an edge a mosaic's channels see other things
BRIGHT = 0.02  # of the range above black, that a pixel's channels have in the mean
FAR, WHOLE = 3.0, 0.98  # σ above DN 0, that so many of a cell's pixels have in a channel that was not cut off
APART = 0.1  # of chromaticities, summed, from which on colours are others
FEWEST = 5  # colours: four determine a matrix, whatever is off
NEAR, OFTEN = 7, 0.03  # px; of such a neighbourhood at DN 0: one pixel of 49 is kept
DISTINCT = 0.1  # least singular value of cells' colours: that of black, white and one of a chroma of 0.1
WORST = 1e3  # condition of a matrix that is taken back
UNSURE = (
    0.5  # σ of a share, from which on none is told; crosstalk in the fit takes what is left of the matrix
)
USUAL, OFF = 0.5, 0.01  # of shares, in cameras' matrices; of colours' medians, by which paints may be off
NEGATIVE = 0.05  # share of another channel that is taken off, from which on a matrix is a camera's
# times less that it leaves of colours than gains of the channels alone. Of what a curve does that makes them stronger
# (γ 1.1 to 2.2) it leaves 3 to 5.5 times less; of a matrix 8 times in 8 bits by sRGB's curve, 34 in 12 bits
BETTER = 6.5
GROUNDS = (
    "Colours of a camera's captures follow from those simulated by one matrix that takes light of other channels off, "
    "which no sensor does: it was taken back before anything was fitted."
)
WORDS = "colour matrix (color crosstalk)"
BESIDE = ~np.eye(3, dtype=bool)  # the diagonal
NAMES = ("rg", "rb", "gr", "gb", "br", "bg")  # of ColorCrosstalk, in the order of a matrix's rows
# colours simulated and captured over the light simulated, and weights of each channel, (n, 3); below 0 where it was cut
# off, of which is known that there was no light
Cells = tuple[np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True, eq=False)
class Matrix:
    """``rows`` (3, 3) of a camera's matrix, sums 1; ``sigma`` (6,) of what is not on its diagonal."""

    camera: str
    rows: np.ndarray
    sigma: tuple[float, ...]

    def taken_back(self, dn: np.ndarray, camera: Camera) -> np.ndarray:
        """(H, W, 3) DN as they were before the matrix, with what the camera does after it."""
        return encoded_above(linear_above(dn, camera) @ np.linalg.inv(self.rows).T, camera)


def matrices(found: Sequence[Condition]) -> list[Matrix]:
    """Of the cameras whose captures are mixed."""
    cameras: dict[str, list[Condition]] = {}
    for c in found:
        if c.camera.sensor.color_correction == IDENTITY and c.mean.shape[2] == 3:
            cameras.setdefault(c.camera.name, []).append(c)
    told = each(lambda name: _matrix(name, _together([_cells(c) for c in cameras[name]])), cameras)
    return [m for m in told if m is not None]


def numbers(by: Sequence[Matrix], before: Mapping[str, Estimate]) -> dict[str, Estimate]:
    """What is not on the diagonals, as ColorCrosstalk has it; by camera where there are several. ``before``: crosstalk
    that was found in captures whose matrix was taken back; it corrects the matrix, and knows it better."""
    found = {n: before[n] for n in NAMES if n in before}
    leaks = ColorCrosstalk(**{n: x.value for n, x in found.items()}).matrix
    told = {}
    for m in by:
        values = _of_sum_one(m.rows @ leaks)[BESIDE]
        for name, x, s in zip(NAMES, values, m.sigma, strict=True):
            told[f"{called(m.camera)} {name}" if len(by) > 1 else name] = Estimate(
                float(x), found[name].sigma if name in found else s, "1"
            )
    return told


def unmixed(captures: Captures, cameras: Mapping[str, Camera], by: Sequence[Matrix]) -> Captures:
    """Captures as they were before the matrices, which stand before the curves of their ``cameras`` if they have some.
    A pixel with a channel at the highest DN is masked, and whole neighbourhoods in which 0 occurs, so that no noise is
    chosen by its sign: what was cut off there is no longer in one channel alone. Those of 8 bits are rounded to such
    again, so that they are taken for what they are."""
    of = {m.camera: m for m in by}

    def back(capture: Capture) -> Capture:
        if capture.camera not in of:
            return capture
        camera, pixels = cameras[capture.camera], capture.pixels
        top = 2**camera.sensor.bits_out - 1
        zero = cv2.blur((pixels.min(axis=2) <= 0).astype(np.float32), (NEAR, NEAR)) > OFTEN
        cut = (pixels.max(axis=2) >= SATURATED * top) | zero
        mask = ~cut if capture.mask is None else ~cut & capture.mask
        before = of[capture.camera].taken_back(pixels, camera)
        if capture.bits == 8:
            return replace(capture, pixels=np.clip(np.rint(before), 0, top), mask=mask)
        return replace(capture, pixels=before, mask=mask, computed=True)

    return replace(captures, captures=tuple(map(back, captures.captures)))


def as_mixed(c: Condition, dn: np.ndarray, by: Sequence[Matrix]) -> np.ndarray:
    """What a simulation without a matrix is beside captures whose matrix was taken back."""
    return next((m.taken_back(dn, c.camera) for m in by if m.camera == c.camera.name), dn)


def linear_above(dn: np.ndarray, camera: Camera) -> np.ndarray:
    """Of DN those above black that were there before a camera's curve."""
    s, curve = camera.sensor, ResponseCurve.of(camera)
    x = np.arange(2**s.bit_depth)
    return np.interp(dn, curve.output(x, s.bit_depth, s.black_level), x) - s.black_level


def encoded_above(above: np.ndarray, camera: Camera) -> np.ndarray:
    """The DN of a camera whose curve gets so many above black."""
    s = camera.sensor
    dn = ResponseCurve.of(camera).output(above + s.black_level, s.bit_depth, s.black_level)
    return np.asarray(dn, np.float32)


def with_matrices(scene: Scene, by: Sequence[Matrix]) -> Scene:
    """The scene with these matrices, whatever its file says of them."""
    of = {m.camera: m for m in by}

    def there(camera: Camera) -> Camera:
        if camera.name not in of:
            return camera
        rows = tuple(map(float, of[camera.name].rows.ravel()))
        return replace(camera, sensor=replace(camera.sensor, color_correction=rows))

    return replace(scene, cameras=tuple(map(there, scene.cameras)))


def mixed_further(scene: Scene, by: Sequence[Matrix]) -> Scene:
    """The scene with these matrices before those that its file says, which were taken back first."""
    said = {c.name: np.array(c.sensor.color_correction).reshape(3, 3) for c in scene.cameras}
    return with_matrices(scene, [replace(m, rows=said[m.camera] @ m.rows) for m in by if m.camera in said])


def _cells(c: Condition) -> Cells:
    """What a condition shows of each colour."""
    simulated, captured = (linear_above(dn, c.camera) for dn in (c.simulated().dn, c.mean))
    around = np.ones((3, 3), np.uint8)
    steps = cv2.dilate(simulated, around) - cv2.erode(simulated, around)
    even = (steps < EVEN * simulated.max(axis=2, keepdims=True)).all(axis=2)
    s = c.camera.sensor
    range_ = 2**s.bit_depth - 1 - s.black_level
    bright = np.minimum(simulated.mean(axis=2), captured.mean(axis=2)) > BRIGHT * range_
    noise = np.sqrt((s.K * s.read_noise) ** 2 + s.K * np.maximum(captured, 0))
    ok = c.compared & even & bright
    x, y, there = simulated[ok], captured[ok], (captured + s.black_level > FAR * noise)[ok]
    light = x.sum(axis=1, keepdims=True)
    x, y = x / light, y / light
    cell = np.rint(CELLS * x[:, :2]).astype(int) @ [CELLS + 1, 1]
    names, index, counts = np.unique(cell, return_inverse=True, return_counts=True)
    kept = [np.flatnonzero(index == k) for k in range(len(names)) if counts[k] >= LEAST]
    medians = [np.array([np.median(v[own], axis=0) for own in kept]).reshape(-1, 3) for v in (x, y)]
    whole = np.array([there[own].mean(axis=0) > WHOLE for own in kept]).reshape(-1, 3)
    told = whole.any(axis=1)
    weights = np.sqrt(np.array([len(own) for own in kept])).reshape(-1, 1)
    return medians[0][told], medians[1][told], np.where(whole, weights, -weights)[told]


def _matrix(name: str, every: Cells) -> Matrix | None:
    """What all cells follow, and whichever colour is left out: one paint that is off is no matrix."""
    colours = _colours(every[0])
    whole = np.ones((3, 3), bool)
    if len(colours) < FEWEST or _distinct(every) < DISTINCT:
        return None
    gains, mixed = _followed(every, ~BESIDE), _followed(every, whole)
    rows = _of_sum_one(mixed)
    if rows[BESIDE].min() > -NEGATIVE or _missed(every, gains) < BETTER * _missed(every, mixed):
        return None
    kept = [(x[own], y[own], w[own]) for own in colours for x, y, w in [every]]
    without = [_of_sum_one(_followed(cells, whole)) for cells in kept if _distinct(cells) >= DISTINCT]
    if len(without) < len(colours) or max(r[BESIDE].min() for r in without) > -NEGATIVE / 2:
        return None
    sigma = np.sqrt((len(without) - 1) * np.var(without, axis=0))[BESIDE]  # the jackknife's
    return Matrix(name, rows, tuple(map(float, sigma))) if sigma.max() < UNSURE else None


def _colours(x: np.ndarray) -> list[np.ndarray]:
    """For each colour of cells (n, 3) which of them have others (n,)."""
    centres: list[np.ndarray] = []
    for colour in x:
        if all(np.abs(colour - c).sum() > APART for c in centres):
            centres.append(colour)
    of = np.array([np.argmin([np.abs(colour - c).sum() for c in centres]) for colour in x], int)
    return [of != k for k in range(len(centres))]


def _distinct(cells: Cells) -> float:
    return float(np.linalg.svd(cells[0], compute_uv=False)[2]) if len(cells[0]) > 2 else 0.0


def _together(conditions: Sequence[Cells]) -> Cells:
    x, y, weights = zip(*conditions, strict=True)
    return np.concatenate(x), np.concatenate(y), np.concatenate(weights)


def _followed(cells: Cells, there: np.ndarray) -> np.ndarray:
    """(3, 3), zero but where it is ``there``, its sum 3: what makes captured colours of those simulated, but for their
    brightness. Few paints, of which channels are cut off, leave some of it open: shares are no larger than they must
    be, by their ``USUAL`` size."""
    start = np.eye(3)
    usual = OFF / USUAL * np.sqrt(np.square(cells[2]).mean())

    def by(numbers: np.ndarray) -> np.ndarray:
        out = np.zeros((3, 3))
        out[there] = numbers
        return out

    def left(numbers: np.ndarray) -> np.ndarray:
        return np.append(_left(cells, by(numbers)), usual * by(numbers)[BESIDE])

    solved = least_squares(left, start[there])
    found = by(solved.x)
    return np.asarray(3 * found / found.sum())


def _left(cells: Cells, by: np.ndarray) -> np.ndarray:
    """What is left of captured colours, weighted; one more number for the sum, which colours say nothing of."""
    x, y, weights = cells
    made = x @ by.T
    seen = weights > 0
    bright = (seen * y * made).sum(axis=1) / np.maximum((seen * made * made).sum(axis=1), 1e-12)
    off = np.where(seen, y / np.maximum(bright, 1e-6)[:, None] - made, np.maximum(made, 0))
    left = off * np.abs(weights)
    return np.append(left, by.sum() - 3)


def _missed(cells: Cells, by: np.ndarray) -> float:
    """Rms of what is left of captured colours."""
    return float(np.sqrt(np.square(_left(cells, by)).sum() / np.square(cells[2]).sum())) + 1e-9


def _of_sum_one(by: np.ndarray) -> np.ndarray:
    """Rows' sums are gains of the channels, which are told as such."""
    return np.asarray(by / by.sum(axis=1, keepdims=True))
