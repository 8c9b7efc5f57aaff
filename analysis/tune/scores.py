"""How well an algorithm did on a frame, as numbers with a unit and a direction.

Edges: the two measures of the chapter (edge pixels inside the regions of interest; their distance from the straight
line that linear regression gives), distance from the projected CAD edges, precision and recall. Gauges and template
matches: error of place and size, and how often a good feature is rejected. Blobs: whether the right regions were hit.
Where nothing is found, a distance is half the width of the region of interest.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial import cKDTree

from analysis.tune.algorithms.base import Algorithm
from analysis.tune.algorithms.template_match import Pattern
from analysis.tune.found import Blobs, Circle, Edges, Line, Place
from analysis.tune.frames import Frame
from analysis.tune.truth import EdgeTruth
from interchange.camera import Projection
from interchange.problems import BrightfieldError

NONE = np.zeros((0, 2))
CORNERS = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])


@dataclass(frozen=True)
class Measure:
    """``best``: "high" or "low"."""

    unit: str
    best: str
    meaning: str


MEASURES = {
    "edge_pixels": Measure("1", "high", "edge pixels inside the regions of interest"),
    "line_distance": Measure("px", "low", "rms distance of them from the regression line of their edge"),
    "position": Measure("px", "low", "rms distance from the true place"),
    "size": Measure("px", "low", "rms error of the radius, or of the line's direction at its ends"),
    "precision": Measure("1", "high", "share of what is found that is true"),
    "recall": Measure("1", "high", "share of what is true that is found"),
    "f1": Measure("1", "high", "harmonic mean of precision and recall"),
    "overlap": Measure("1", "high", "area of both over area of either"),
    "false_rejects": Measure("1", "low", "share of good parts or features that are rejected"),
    "false_accepts": Measure("1", "low", "share of bad parts that are accepted"),
}


@dataclass(frozen=True, eq=False)
class Rules:
    """How results are judged. ``roi`` px: half the width of the regions of interest along the edges; ``reach`` px:
    what counts as the same edge; ``tolerance`` px: error of a place or radius at which a gauge rejects a good
    feature; ``placement`` px: rms by which a gauge is put down off the feature; ``registration`` px: rms by which the
    truth itself is put off, in each direction, as that of real images may be."""

    roi: float = 8.0
    reach: float = 2.0
    tolerance: float = 0.5
    placement: float = 1.5
    seed: int = 0
    registration: float = 0.0
    patterns: Mapping[str, tuple[Pattern, np.ndarray]] = field(default_factory=dict)


def measures_of(finds: type) -> tuple[str, ...]:
    """The measures that an algorithm's results have."""
    if finds is Edges:
        return ("edge_pixels", "line_distance", "position", "precision", "recall", "f1")
    if finds is Blobs:
        return ("precision", "recall", "f1", "overlap", "position", "false_rejects", "false_accepts")
    return ("position", "size", "false_rejects") if finds in (Circle, Line) else ("position", "false_rejects")


def score(algorithm: Algorithm, frame: Frame, rules: Rules) -> dict[str, float]:
    """Every measure of the algorithm's kind; NaN where the frame has nothing to be judged by."""
    if rules.registration > 0:
        rng = np.random.default_rng([rules.seed, *b"registration", *frame.name.encode()])
        frame = replace(frame, truth=frame.truth.moved(rules.registration * rng.standard_normal(2)))
    if algorithm.finds is Edges:
        edges = frame.truth.edges
        if edges is None:
            raise BrightfieldError(
                f"{frame.name} must tell the true edges; name the bodies whose edges count."
            )
        found = algorithm.run(frame.image)
        return edge_scores(found if isinstance(found, Edges) else Edges(NONE), edges, frame, rules)
    if algorithm.finds is Blobs:
        regions = frame.truth.regions
        if regions is None:
            raise BrightfieldError(
                f"{frame.name} must tell the true regions; name the bodies that are blobs."
            )
        blobs = algorithm.run(frame.image)
        labels = blobs.labels if isinstance(blobs, Blobs) else np.zeros(frame.image.shape, np.int32)
        return blob_scores(Blobs(labels), regions, frame.usable)
    return gauge_scores(algorithm, frame, rules)


def inside(points: np.ndarray, usable: np.ndarray | None, shape: tuple[int, int]) -> np.ndarray:
    """(n,) bool: the points in usable pixels of the image."""
    column, row = np.rint(points).astype(int).T
    h, w = shape
    good = (column >= 0) & (row >= 0) & (column < w) & (row < h)
    if usable is not None:
        good[good] = usable[row[good], column[good]]
    return good


def edge_scores(found: Edges, truth: EdgeTruth, frame: Frame, rules: Rules) -> dict[str, float]:
    if not len(truth.points):
        return dict.fromkeys(measures_of(Edges), float("nan"))
    points = np.asarray(found.points, np.float64).reshape(-1, 2)
    points = points[inside(points, frame.usable, frame.image.shape)]  # type: ignore[arg-type]
    places, normals, line = truth.points, truth.normals, truth.line
    away, nearest = truth.near(points, rules.roi)
    of_interest = np.isfinite(away)
    points, away, nearest = points[of_interest], away[of_interest], nearest[of_interest]
    if not len(points):
        return {"edge_pixels": 0.0, "line_distance": rules.roi, "position": rules.reach} | dict.fromkeys(
            ("precision", "recall", "f1"), 0.0
        )
    right = away <= rules.reach
    across = np.sum((points[right] - places[nearest[right]]) * normals[nearest[right]], axis=1)
    back, _ = cKDTree(points).query(places, distance_upper_bound=rules.reach)
    precision, recall = float(right.mean()), float(np.isfinite(back).mean())
    return {
        "edge_pixels": float(len(points)),
        "line_distance": line_distance(points, line[nearest], frame, rules.roi),
        "position": float(np.sqrt(np.mean(across**2))) if right.any() else rules.reach,
        "precision": precision,
        "recall": recall,
        "f1": 2 * precision * recall / (precision + recall) if precision + recall > 0 else 0.0,
    }


LEAST = 10  # points that a regression line needs


def line_distance(points: np.ndarray, line: np.ndarray, frame: Frame, worst: float) -> float:
    """rms, px, of the distances of the points of each straight edge from their own regression line (total least
    squares), the lens's distortion taken out. ``line`` (n,): which edge a point belongs to."""
    straight = _undistorted(points, frame)
    order = np.argsort(line, kind="stable")
    sorted_lines, p = line[order], straight[order]
    starts = np.flatnonzero(np.r_[True, np.diff(sorted_lines) != 0])
    count = np.diff(np.r_[starts, len(p)])
    group = np.repeat(np.arange(len(starts)), count)
    mean = np.add.reduceat(p, starts, axis=0) / count[:, None]
    d = p - mean[group]
    xx, yy, xy = (np.add.reduceat(v, starts) for v in (d[:, 0] ** 2, d[:, 1] ** 2, d[:, 0] * d[:, 1]))
    small = (xx + yy) / 2 - np.sqrt(((xx - yy) / 2) ** 2 + xy**2)  # least eigenvalue: Σ of squared distances
    long = count >= LEAST
    if not long.any():
        return worst
    return float(np.sqrt(np.maximum(small[long], 0).sum() / count[long].sum()))


def _undistorted(points: np.ndarray, frame: Frame) -> np.ndarray:
    lens, K = frame.camera.lens, frame.camera.K
    if not lens.distorts or lens.projection is not Projection.PERSPECTIVE:
        return points
    x, y = lens.undistort((points[:, 0] - K[0, 2]) / K[0, 0], (points[:, 1] - K[1, 2]) / K[1, 1])
    return np.stack([K[0, 0] * x + K[0, 2], K[1, 1] * y + K[1, 2]], axis=-1)


def blob_scores(found: Blobs, regions: np.ndarray, usable: np.ndarray | None) -> dict[str, float]:
    labels = np.where(usable, found.labels, 0) if usable is not None else found.labels
    regions = np.where(usable, regions, 0) if usable is not None else regions
    n, m = int(labels.max(initial=0)), int(regions.max(initial=0))
    area = np.bincount(labels.ravel(), minlength=n + 1)[1:]
    true_area = np.bincount(regions.ravel(), minlength=m + 1)[1:]
    both = np.zeros((n + 1, m + 1), int)
    np.add.at(both, (labels.ravel(), regions.ravel()), 1)
    touch = both[1:, 1:] > 0
    right, hit = touch.any(axis=1)[area > 0], touch.any(axis=0)[true_area > 0]
    offsets = []
    for k in np.flatnonzero(touch.any(axis=0)):
        best = int(np.argmax(both[1:, 1 + k]))
        a, b = (np.argwhere(x).mean(axis=0) for x in (labels == best + 1, regions == k + 1))
        offsets.append(float(np.linalg.norm(a - b)))
    bad = len(hit) > 0
    precision = float(right.mean()) if len(right) else 1.0
    recall = float(hit.mean()) if bad else float("nan")
    either = int(((labels > 0) | (regions > 0)).sum())
    sums = precision + (recall if bad else 0.0)
    return {
        "precision": precision,
        "recall": recall,
        "f1": 2 * precision * recall / sums if bad and sums > 0 else (0.0 if bad else float("nan")),
        "overlap": float(((labels > 0) & (regions > 0)).sum() / either) if either else 1.0,
        "position": float(np.sqrt(np.mean(np.square(offsets)))) if offsets else float("nan"),
        "false_rejects": float("nan") if bad else float(len(right) > 0),
        "false_accepts": float(not hit.any()) if bad else float("nan"),
    }


def gauge_scores(algorithm: Algorithm, frame: Frame, rules: Rules) -> dict[str, float]:
    """Each feature is gauged from a place that is ``rules.placement`` px rms off in each direction, as a part is never
    quite where the gauge was taught; the offsets depend on the frame's and the feature's names alone. Features that the
    image does not show as a whole are left out."""
    place, size, rejected = [], [], []
    worst = rules.roi  # not the algorithm's own reach, which a search would then make small
    for name, true in _features(algorithm, frame).items():
        rng = np.random.default_rng([rules.seed, *f"{frame.name}/{name}".encode()])
        off = rules.placement * rng.standard_normal(2)
        if isinstance(true, Circle):
            if not _seen(np.add(true.middle, true.radius * CORNERS), frame):
                continue
            near = Circle((true.middle[0] + off[0], true.middle[1] + off[1]), true.radius)
            found = algorithm.run(frame.image, near)
            errors = (worst, worst)
            if isinstance(found, Circle):
                errors = (
                    float(np.linalg.norm(np.subtract(found.middle, true.middle))),
                    abs(found.radius - true.radius),
                )
        elif isinstance(true, Line):
            if not _seen(np.array([true.start, true.end]), frame):
                continue
            (a, b), (c, d) = true.start, true.end
            found = algorithm.run(frame.image, Line((a + off[0], b + off[1]), (c + off[0], d + off[1])))
            errors = (worst, worst)
            if isinstance(found, Line):
                ends = found.across(np.array([true.start, true.end]))
                errors = (float(abs(ends.mean())), float(abs(ends[1] - ends[0]) / 2))
        else:
            pattern, inner = rules.patterns[name]
            if not _seen(np.add(true, pattern.pixels.shape[0] / 2 * CORNERS), frame):
                continue
            at = (true[0] - inner[0] + off[0], true[1] - inner[1] + off[1])
            found = algorithm.run(frame.image, Pattern(pattern.pixels, at))
            errors = (worst, 0.0)
            if isinstance(found, Place):
                errors = (float(np.linalg.norm(np.add(found.middle, inner) - true)), 0.0)
        place.append(errors[0])
        size.append(errors[1])
        rejected.append(found is None or max(errors) > rules.tolerance)
    if not place:
        return dict.fromkeys(measures_of(algorithm.finds), float("nan"))
    rms = [float(np.sqrt(np.mean(np.square(v)))) for v in (place, size)]
    found_all = {"position": rms[0], "size": rms[1], "false_rejects": float(np.mean(rejected))}
    return {n: v for n, v in found_all.items() if n in measures_of(algorithm.finds)}


def _seen(points: np.ndarray, frame: Frame) -> bool:
    """Whether a feature with these points (n, 2) lies in the image as a whole."""
    h, w = frame.image.shape
    return bool(np.isfinite(points).all() and (points >= 0).all() and (points <= np.array([w, h]) - 1).all())


def _features(algorithm: Algorithm, frame: Frame) -> Mapping[str, Circle | Line | tuple[float, float]]:
    if algorithm.finds is Circle:
        return frame.truth.circles
    if algorithm.finds is Line:
        return frame.truth.lines
    return {n: s.middle for n, s in frame.truth.patterns.items()}
