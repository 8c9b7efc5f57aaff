"""Families without a cause, which compete with the effects on equal terms, so that the unknown is named as unknown.

Each says what the gap is fixed to: the image (smooth, in places, or in stripes), the surface, a lamp's light on the
surface, a capture, a mirrored copy, how bright the surroundings or its line of pixels are, or edges.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.compared.state import State
from analysis.gap.terms.base import Cells, Family, Field, Term, in_cells
from analysis.gap.terms.chain import differ
from analysis.gap.terms.left import EDGED, SMOOTH, UNNAMED, falling
from analysis.gap.terms.stripe import WAVES, stripe_terms
from interchange.captures import Tolerances

ORDER = 5  # cosines a side
GRID = (12, 9)  # places of an image, columns and rows
BOX = 8  # places of the scene's longest side
SPARE = 0.0005  # rms of places, over the signal, that no twin gets right
DRIFTS = 0.4  # of a lamp's tolerance: how captures differ in brightness
SLOWEST, COLORED = (
    2,
    0.5,
)  # cosines of what channels' flat fields differ by, and how much of the tolerance that is
UNEVEN = 0.5  # of an albedo's tolerance: how uneven a surface may be that is right on the whole
DARK = 1e-3  # DN above black of a whole image that shows nothing
AROUND = 1 / 12  # of the image's width: the surroundings of a pixel

FACTOR, OFFSET = "fixed to the image, multiplicative", "fixed to the image, additive"
SPOT, GLOW = "fixed to places of the image, multiplicative", "fixed to places of the image, additive"
FIXED_TO_THE_IMAGE = (FACTOR, OFFSET, SPOT, GLOW, WAVES)
SHARP = "edges sharper than the lens gives them"
BLURS = ("defocus", "motion_blur")
SURFACE, PATCH, EXTRA = (
    "fixed to the surface",
    "fixed to places of the surface",
    "light on places of the surface",
)
SHADE = "light of one lamp on places of the surface"
MIRROR, CAPTURE, PLACE = "mirrored copy", "fixed to a capture", "fixed to places of a capture"
SMEAR = {0: "light smeared along columns", 1: "light smeared along rows"}  # by the axis that it runs along
GATHERED, FOLLOWING = "what is gathered as it is read out", "a fixed share of each line's light"
SURROUNDINGS = "depends on the surroundings' brightness"


def generic_terms(conditions: Sequence[Condition], tolerances: Tolerances) -> list[Term]:
    t = tolerances
    terms = []
    waves = [(i, j) for i in range(ORDER) for j in range(ORDER) if 0 < i + j < ORDER + 1]
    part = falling(waves)
    seldom = UNNAMED * t.flat_field
    cameras = tuple(dict.fromkeys(c.camera.name for c in conditions))
    for camera in cameras:
        for i, j in waves:
            label = f"{i},{j}"
            own = part[i, j] * t.flat_field
            terms.append(_term(FACTOR, camera, label, own, image_wave(camera, i, j, True)))
            terms.append(_term(OFFSET, camera, label, SMOOTH * own, image_wave(camera, i, j, False)))
    terms += [
        _term(SURFACE, "", f"{i},{j}", UNEVEN * part[i, j] * t.albedo, _surface(i, j)) for i, j in waves
    ]
    for way, axes in (("turned by 180 degrees", (0, 1)), ("left to right", (1,)), ("top to bottom", (0,))):
        terms.append(_term(MIRROR, "", way, seldom, _mirrored(axes)))
    terms.append(_term(SURROUNDINGS, "", "gain", seldom, _surroundings))
    times = sorted({c.camera.t_exp for c in conditions})
    ways = {FOLLOWING: 0.0}
    if differ(times):
        ways[GATHERED] = times[-1]
    smeared = [
        _term(cause, "", word, seldom, _smeared(axis, t_exp))
        for axis, cause in SMEAR.items()
        for word, t_exp in ways.items()
    ]  # no charge is less than none: of a plate, less would be a shutter that opens late
    terms += [replace(t, low=0.0, held=True) if t.parameter == GATHERED else t for t in smeared]
    sharp = _term(SHARP, "", "gain", EDGED / 2 * t.flat_field, _sharper)
    terms.append(replace(sharp, low=0.0, against=BLURS))  # both together are a blur of another shape
    terms += [
        _term(CAPTURE, c.name, "gain", DRIFTS * t.light_intensity, _capture(c.name)) for c in conditions
    ]
    for camera in cameras:
        terms += stripe_terms(camera, conditions, seldom, ORDER + 2)
    return [*terms, *_places(cameras, conditions)]


def _places(cameras: Sequence[str], conditions: Sequence[Condition]) -> list[Term]:
    columns, rows = GRID
    spots = [
        f"{c * 100 // columns + 3} % right, {r * 100 // rows + 4} % down"
        for r in range(rows)
        for c in range(columns)
    ]
    terms = []
    for camera in cameras:
        terms += in_cells(SPOT, camera, SPARE, Family(_spots(camera, True), tuple(spots)))
        terms += in_cells(GLOW, camera, SPARE, Family(_spots(camera, False), tuple(spots)))
    low, high = conditions[0].shown.scene.bounds
    boxes = Boxes.of(conditions, low, max(float((high - low).max()) / BOX, 1e-9))
    terms += in_cells(PATCH, "", SPARE, Family(_patches(boxes, None), boxes.names))
    terms += in_cells(EXTRA, "", SPARE, Family(_patches(boxes, ""), boxes.names))
    lamps = tuple(dict.fromkeys(name for c in conditions for name in c.lamps))
    if len(lamps) > 1:
        for lamp in lamps:
            terms += in_cells(SHADE, lamp, SPARE, Family(_patches(boxes, lamp), boxes.names))
    quarters = [f"{25 * c + 12} % right, {33 * r + 16} % down" for r in range(3) for c in range(4)]
    for c in conditions:
        terms += in_cells(PLACE, c.name, SPARE, Family(_quarters(c.name), tuple(quarters)))
    return terms


def _term(cause: str, target: str, parameter: str, spike: float, field: Field) -> Term:
    return Term(cause, target, parameter, "1", spike, field, relative=True, generic=True)


def image_wave(camera: str, i: int, j: int, factor: bool) -> Field:
    """Cosines of ``i`` and ``j`` half waves across the image and down, times the signal or 100 DN."""

    def field(s: State) -> np.ndarray | None:
        if s.camera.name != camera:
            return None
        w, h = s.camera.sensor.resolution
        along = np.cos(np.pi * i * (s.grid[0][0].astype(np.float64) + 0.5) / w)
        down = np.cos(np.pi * j * (s.grid[1][:, 0].astype(np.float64) + 0.5) / h)
        wave = np.multiply.outer(down, along).astype(np.float32)[..., None]
        return s.signal * wave if factor else np.broadcast_to(100 * wave, s.signal.shape)

    return field


def _surface(i: int, j: int) -> Field:
    def field(s: State) -> np.ndarray | None:
        return s.signal * (_over_surface(s, 0, i) * _over_surface(s, 1, j))[..., None]

    return field


def _over_surface(s: State, axis: int, k: int) -> np.ndarray:
    """(h, w): a cosine of ``k`` half waves across the scene, which needs no more than seven digits."""
    key = ("over the surface", axis, k)
    if key not in s.kept:
        s.kept[key] = np.cos(np.float32(np.pi * k) * s.on_surface[..., axis].astype(np.float32))
    return np.asarray(s.kept[key])


def _mirrored(axes: tuple[int, ...]) -> Field:
    return lambda s: s.take(np.flip(s.simulation.dn - s.simulation.black, axes))


def _surroundings(s: State) -> np.ndarray | None:
    whole = np.ascontiguousarray(s.simulation.dn - s.simulation.black, np.float32)
    mean = float(whole.mean())
    if mean < DARK:
        return None
    h, w, channels = whole.shape
    sigma = AROUND * w
    n = max(1, int(sigma / 5))  # so much coarser a grid tells as well
    small = cv2.resize(whole, (max(w // n, 1), max(h // n, 1)), interpolation=cv2.INTER_AREA)
    small = cv2.GaussianBlur(small, (0, 0), sigma / n)
    wide = cv2.resize(small, (w, h), interpolation=cv2.INTER_LINEAR).reshape(h, w, channels)
    return s.signal * (s.take(wide) / mean - 1)


def _smeared(axis: int, t_exp: float) -> Field:
    """What a whole line of pixels has in the mean, on each of them: a share, as of an amplifier that follows its line's
    load; or what it has of that in a time that is no exposure's, over ``t_exp`` s, as of charge that is read out
    through a lit column."""

    def field(s: State) -> np.ndarray | None:
        mean = np.maximum(s.simulation.dn - s.simulation.black, 0).mean(axis=axis, keepdims=True)
        if mean.max() < DARK:
            return None
        per_time = t_exp / s.camera.t_exp if t_exp else 1.0
        return s.take(np.broadcast_to(np.float32(per_time * mean), s.simulation.dn.shape))

    return field


def _sharper(s: State) -> np.ndarray:
    whole = np.ascontiguousarray(s.simulation.dn, np.float32)
    return s.take(whole - cv2.GaussianBlur(whole, (0, 0), 1.0).reshape(whole.shape))


def _capture(name: str) -> Field:
    return lambda s: s.signal if s.condition.name == name else None


def _hats(s: State, columns: int, rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Number and share (h, w, 4) of the places around a pixel: bilinear, ``columns`` x ``rows`` of them."""
    w, h = s.camera.sensor.resolution
    return bilinear((s.grid[0] + 0.5) / w * columns - 0.5, (s.grid[1] + 0.5) / h * rows - 0.5, columns, rows)


def bilinear(x: np.ndarray, y: np.ndarray, columns: int, rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Numbers (..., 4) of the places around (x, y), counted row by row, and the share of each."""
    x, y = np.clip(x, 0, columns - 1), np.clip(y, 0, rows - 1)
    i, j = np.minimum(x.astype(np.int32), columns - 2), np.minimum(y.astype(np.int32), rows - 2)
    fx, fy = x - i, y - j
    ids = np.stack([(j + b) * columns + i + a for b in (0, 1) for a in (0, 1)], axis=-1)
    share = np.stack([(fx if a else 1 - fx) * (fy if b else 1 - fy) for b in (0, 1) for a in (0, 1)], axis=-1)
    return ids, share.astype(np.float32)


def _spots(camera: str, factor: bool) -> Cells:
    def cells(s: State) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        if s.camera.name != camera:
            return None
        return *_hats(s, *GRID), s.signal if factor else np.full_like(s.signal, 100.0)

    return cells


@dataclass(frozen=True, eq=False)
class Boxes:
    """Cubes of the scene that are seen: ``number`` of each, by its place (i, j, k) from ``low`` m, -1 where none is."""

    low: np.ndarray
    side: float
    number: np.ndarray
    names: tuple[str, ...]

    @classmethod
    def of(cls, conditions: Sequence[Condition], low: np.ndarray, side: float) -> "Boxes":
        views = {id(c.shown): c.shown.passes for c in conditions}.values()
        every = np.concatenate([_whole((v["position"][v["object_id"] >= 0] - low) / side) for v in views])
        shape = tuple(every.max(axis=0) + 1) if len(every) else (1, 1, 1)
        places = np.stack(np.unravel_index(np.unique(np.ravel_multi_index(every.T, shape)), shape), axis=-1)
        number = np.full(shape, -1, np.int32)
        number[tuple(places.T)] = np.arange(len(places))
        centres = 1e3 * (low + (places + 0.5) * side)
        return cls(low, side, number, tuple(f"({x:.0f}, {y:.0f}, {z:.0f}) mm" for x, y, z in centres))

    def ids(self, s: State) -> np.ndarray:
        """(h, w, 1) int32."""
        places = np.clip(_whole((s.position - self.low) / self.side), 0, np.array(self.number.shape) - 1)
        found = self.number[tuple(np.moveaxis(places, -1, 0))]
        return np.where(s.take(s.shown.passes["object_id"]) < 0, -1, found)[..., None]


def _whole(x: np.ndarray) -> np.ndarray:
    return np.maximum(np.nan_to_num(x), 0).astype(np.int32)


def _patches(boxes: Boxes, lamp: str | None) -> Cells:
    """``lamp``: None takes all light there, "" adds light that is always on, else that lamp's alone."""

    def cells(s: State) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        if lamp and lamp not in s.lamps:
            return None
        unit = s.signal if lamp is None else s.lamps[lamp] if lamp else s.per_radiance
        ids = boxes.ids(s)
        return ids, np.ones(ids.shape, np.float32), unit

    return cells


def _quarters(name: str) -> Cells:
    def cells(s: State) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        return (*_hats(s, 4, 3), s.signal) if s.condition.name == name else None

    return cells
