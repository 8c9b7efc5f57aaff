"""What inspection algorithms make of two images: do they find the same edges, corners and segments, and where?

Both images go through the same algorithm with the same settings, which are taken from the first; then results are
paired. Agreement of results says whether a difference matters; it does not say where it comes from.

Canny: A computational approach to edge detection. PAMI 1986. Sub-pixel edges: the maximum of a parabola through the
gradient along its direction. Devernay: A non-maxima suppression method for edge detection with sub-pixel accuracy.
INRIA RR-2724, 1995. Corners: Shi, Tomasi: Good features to track. CVPR 1994. Segments: Otsu: A threshold selection
method from gray-level histograms. IEEE Trans. SMC 1979.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.spatial import cKDTree
from skimage.filters import threshold_otsu

from interchange.image import Image, same_quantity

REACH = 3.0  # px within which results are the same one
HIGH, LOW = 0.10, 0.04  # Canny's thresholds, of the strongest gradients of the first image
LINE = 1024  # places that are looked up beside each other
ALONE = 0.8  # of the strongest gradient within 3 px, by which an edge's place is measured
STRONGEST = 99.9  # percentile
ALONG = 30.0  # degrees by which paired edges may differ in direction
CORNERS, QUALITY, APART = 400, 0.02, 5.0


@dataclass(frozen=True)
class Matched:
    """``found``: how many in a and in b; ``paired``: how many of a's; offsets b less a, px, NaN without a pair."""

    found: tuple[int, int]
    paired: int
    recall: float
    precision: float
    mean_px: float
    rms_px: float

    @property
    def f1(self) -> float:
        both = self.recall + self.precision
        return 2 * self.recall * self.precision / both if both > 0 else 0.0


@dataclass(frozen=True)
class Segmented:
    """Pixels above Otsu's threshold of each image: their shares, the share of pixels that agree, and overlap over
    union (intersection of both over what either has)."""

    threshold: tuple[float, float]
    area: tuple[float, float]
    agreement: float
    overlap: float


@dataclass(frozen=True, eq=False)
class Results:
    """``edge_points``: of a and b, (n, 2) column, row; ``segments``: (H, W) bool each."""

    edges: Matched
    corners: Matched
    segmentation: Segmented
    edge_points: tuple[np.ndarray, np.ndarray]
    segments: tuple[np.ndarray, np.ndarray]


def results(a: Image, b: Image) -> Results:
    """Raises BrightfieldError where quantity or size differ."""
    same_quantity(a, b)
    planes = [i.pixels.mean(axis=2).astype(np.float32) for i in (a, b)]
    slope = np.hypot(*_gradient(planes[0]))
    strongest = float(np.percentile(slope, STRONGEST))
    found = [edge_points(p, strongest) for p in planes]
    points = [corner_points(p) for p in planes]
    limits = [_threshold(p) for p in planes]
    above = [p > t for p, t in zip(planes, limits, strict=True)]
    union = int((above[0] | above[1]).sum())
    return Results(
        edges=_edges(*found),
        corners=_corners(*points),
        segmentation=Segmented(
            threshold=(limits[0], limits[1]),
            area=(float(above[0].mean()), float(above[1].mean())),
            agreement=float((above[0] == above[1]).mean()),
            overlap=int((above[0] & above[1]).sum()) / union if union else 1.0,
        ),
        edge_points=(found[0][:, :2], found[1][:, :2]),
        segments=(above[0], above[1]),
    )


def _threshold(plane: np.ndarray) -> float:
    if np.ptp(plane) == 0:
        return float(plane.flat[0])
    return float(threshold_otsu(plane))  # type: ignore[no-untyped-call]


def _gradient(plane: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Along columns and along rows, per px, of the image blurred by 1 px rms."""
    smooth = cv2.GaussianBlur(plane, (0, 0), 1.0)
    gy, gx = np.gradient(smooth.astype(np.float64))
    return gx, gy


def _at(plane: np.ndarray, column: np.ndarray, row: np.ndarray) -> np.ndarray:
    """(n,): cubic between pixels at n places, in lines of ``LINE``, as OpenCV takes no image of 2^15 px or more."""
    n = len(column)
    lines = [np.resize(x.astype(np.float32), (n // LINE + 1, LINE)) for x in (column, row)]
    found = cv2.remap(plane.astype(np.float32), lines[0], lines[1], cv2.INTER_CUBIC)
    return np.asarray(found.reshape(-1)[:n], np.float64)


def edge_points(plane: np.ndarray, strongest: float) -> np.ndarray:
    """(n, 5): column, row, and unit normal towards the brighter side of Canny's edges, to a part of a pixel; and 1
    where no stronger edge or crossing is near, so that the place can be measured.

    ``plane`` (H, W) float32; ``strongest``: the gradient by which the thresholds are set, per px.
    """
    if not strongest > 0:
        return np.zeros((0, 5))
    gx, gy = _gradient(plane)
    to_short = 16000.0 / max(float(np.abs(gx).max()), float(np.abs(gy).max()), strongest)
    short = [np.rint(to_short * g).astype(np.int16) for g in (gx, gy)]
    canny = cv2.Canny(
        short[0], short[1], LOW * strongest * to_short, HIGH * strongest * to_short, L2gradient=True
    )
    canny[:2], canny[-2:], canny[:, :2], canny[:, -2:] = 0, 0, 0, 0
    row, column = np.nonzero(canny)
    slope = np.hypot(gx, gy)
    normal = (
        np.stack([gx[row, column], gy[row, column]], axis=-1) / np.maximum(slope[row, column], 1e-30)[:, None]
    )
    around = [_at(slope, column + k * normal[:, 0], row + k * normal[:, 1]) for k in (-1, 0, 1)]
    bend = around[0] - 2 * around[1] + around[2]
    with np.errstate(divide="ignore", invalid="ignore"):
        shift = np.where(bend < 0, 0.5 * (around[0] - around[2]) / bend, np.inf)
    good = np.abs(shift) <= 1.0
    place = np.stack([column, row], axis=-1)[good] + shift[good, None] * normal[good]
    around_it = cv2.dilate(slope, np.ones((7, 7)))[row, column]
    alone = slope[row, column] > ALONE * around_it
    return np.concatenate([place, normal[good], alone[good, None]], axis=1)


def _edges(a: np.ndarray, b: np.ndarray) -> Matched:
    if not len(a) or not len(b):
        return _matched(len(a), len(b), 0, 0, np.zeros(0))
    forward, there = cKDTree(b[:, :2]).query(a[:, :2], distance_upper_bound=REACH)
    back, here = cKDTree(a[:, :2]).query(b[:, :2], distance_upper_bound=REACH)
    alike = np.cos(np.radians(ALONG))
    near = np.isfinite(forward)
    near[near] = np.sum(a[near, 2:4] * b[there[near], 2:4], axis=1) > alike
    also = np.isfinite(back)
    also[also] = np.sum(b[also, 2:4] * a[here[also], 2:4], axis=1) > alike
    sure = near.copy()
    sure[near] = (a[near, 4] > 0) & (b[there[near], 4] > 0)
    across = np.sum((b[there[sure], :2] - a[sure, :2]) * a[sure, 2:4], axis=1)
    return _matched(len(a), len(b), int(near.sum()), int(also.sum()), across)


def corner_points(plane: np.ndarray) -> np.ndarray:
    """(n, 2) column, row of corners, refined to a part of a pixel."""
    high = float(np.percentile(plane, STRONGEST))
    if not high > 0:
        return np.zeros((0, 2))
    scaled = np.clip(plane / high, 0, 1).astype(np.float32)
    found = cv2.goodFeaturesToTrack(scaled, CORNERS, QUALITY, APART)
    if found is None:
        return np.zeros((0, 2))
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 40, 1e-4)
    return np.asarray(cv2.cornerSubPix(scaled, found, (3, 3), (-1, -1), stop)[:, 0], np.float64)


def _corners(a: np.ndarray, b: np.ndarray) -> Matched:
    if not len(a) or not len(b):
        return _matched(len(a), len(b), 0, 0, np.zeros(0))
    forward, there = cKDTree(b).query(a, distance_upper_bound=REACH)
    _, here = cKDTree(a).query(b, distance_upper_bound=REACH)
    near = np.flatnonzero(np.isfinite(forward))
    near = near[here[there[near]] == near]
    return _matched(len(a), len(b), len(near), len(near), forward[near])


def _matched(n: int, m: int, of_a: int, of_b: int, offsets: np.ndarray) -> Matched:
    there = len(offsets) > 0
    return Matched(
        found=(n, m),
        paired=of_a,
        recall=of_a / n if n else 1.0,
        precision=of_b / m if m else 1.0,
        mean_px=float(offsets.mean()) if there else float("nan"),
        rms_px=float(np.sqrt(np.mean(offsets**2))) if there else float("nan"),
    )
