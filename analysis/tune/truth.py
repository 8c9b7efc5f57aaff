"""What an image truly shows, in its own pixels: CAD edges, gauged lines and circles, regions of parts and defects.

Points along the edges are projected through the camera's lens; a point counts as seen where the image's depth says
that nothing stands before it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from analysis.tune.features import CircleFeature, Features, LineFeature, PatternFeature
from analysis.tune.found import Circle, Line
from analysis.tune.wireframe import Wireframe, Wires, outline
from analysis.view.visibility import Renderer, named
from interchange.camera import Camera, Projection
from interchange.distortion import LensModel
from interchange.frames import apply
from interchange.image import Image
from interchange.problems import BrightfieldError, did_you_mean
from interchange.scene import Body, Scene

STEP = 1.0  # px between points of an edge
NEARER = 2e-3  # of the depth: what stands before a point must be nearer by that
MARGIN = 3.0  # px from the image's border that count as outside
WIDEST = 1.5  # of the image, to either side: what a bending lens is followed to
MOST = 40_000  # points of edges an image


@dataclass(frozen=True, eq=False)
class EdgeTruth:
    """Seen points every ``STEP`` px of the edges. ``points`` (n, 2) px; ``normals`` (n, 2) unit, across the edge;
    ``line`` (n,) int: points of one straight edge in the world have one number."""

    points: np.ndarray
    normals: np.ndarray
    line: np.ndarray

    @cached_property
    def tree(self) -> cKDTree:
        return cKDTree(self.points)

    def near(self, points: np.ndarray, roi: float) -> tuple[np.ndarray, np.ndarray]:
        """Distance (n,) px of ``points`` (n, 2) from the nearest true one, inf where it is more than ``roi``, and which
        that is."""
        if not len(points):
            return np.zeros(0), np.zeros(0, int)
        away, which = self.tree.query(points, distance_upper_bound=roi)
        return away, which.astype(int)

    def within(self, usable: np.ndarray) -> "EdgeTruth":
        """What of it lies in pixels that are usable, (H, W) bool."""
        column, row = np.rint(self.points).astype(int).T
        kept = usable[row, column]
        return EdgeTruth(self.points[kept], self.normals[kept], self.line[kept])


@dataclass(frozen=True)
class Square:
    """Where a pattern lies: ``middle`` (column, row) and its side, px."""

    middle: tuple[float, float]
    side: float


@dataclass(frozen=True, eq=False)
class Truth:
    """``lines``, ``circles`` and ``patterns`` by name, seen or not; ``regions`` (H, W) int32, 0 where nothing is to be
    found, k the k-th part or defect, or None where blobs were not asked for."""

    edges: EdgeTruth | None = None
    lines: Mapping[str, Line] = field(default_factory=dict)
    circles: Mapping[str, Circle] = field(default_factory=dict)
    patterns: Mapping[str, Square] = field(default_factory=dict)
    regions: np.ndarray | None = None

    def moved(self, by: np.ndarray) -> "Truth":
        """All places moved by (column, row) px; regions stay."""

        def at(place: tuple[float, float]) -> tuple[float, float]:
            return (float(place[0] + by[0]), float(place[1] + by[1]))

        edges = None if self.edges is None else replace(self.edges, points=self.edges.points + by)
        return Truth(
            edges,
            {n: Line(at(x.start), at(x.end)) for n, x in self.lines.items()},
            {n: Circle(at(x.middle), x.radius) for n, x in self.circles.items()},
            {n: Square(at(x.middle), x.side) for n, x in self.patterns.items()},
            self.regions,
        )


def truth(renderer: Renderer, scene: Scene, camera: Camera, wanted: Features, wires: Wires) -> Truth:
    """What ``camera`` sees of ``wanted``. Raises BrightfieldError for bodies that the scene lacks."""
    check_bodies(scene, wanted)
    dark = replace(scene, lights=())
    poses = {b.name: b.world_from_body for b in reversed(scene.bodies)}
    edges = None
    if wanted.edges:
        depth = renderer.render(dark, straight(camera), ["depth"], samples=1)
        edges = edge_truth(wires.of(named(scene, list(wanted.edges))), camera, depth)
    regions = None
    if wanted.blobs:
        sharp = replace(camera, lens=replace(camera.lens, f_stop=0.0))
        regions = _regions(scene, renderer.render(dark, sharp, ["object_id"], samples=1), wanted.blobs)
    return Truth(
        edges=edges,
        lines={n: _line(x, poses, camera) for n, x in wanted.lines.items()},
        circles={n: _circle(x, poses, camera) for n, x in wanted.circles.items()},
        patterns={n: _square(x, poses, camera) for n, x in wanted.patterns.items()},
        regions=regions,
    )


def check_bodies(scene: Scene, wanted: Features) -> None:
    """Raises BrightfieldError for features on bodies that the scene lacks."""
    for kind in (wanted.lines, wanted.circles, wanted.patterns):
        for name, feature in kind.items():
            if feature.body and feature.body not in scene.object_names:
                hint = did_you_mean(feature.body, scene.object_names)
                raise BrightfieldError(
                    f'The feature "{name}" must be on a body of the scene; "{feature.body}" is none.{hint}'
                )


def straight(camera: Camera) -> Camera:
    """A pinhole that sees what ``camera`` does, at its scale in the middle: depth, and quickly, where the lens bends
    what is straight."""
    lens = replace(camera.lens, f_stop=0.0, distortion=(), model=LensModel.OPENCV)
    if not camera.lens.distorts:
        return replace(camera, lens=lens)
    width, height = camera.sensor.resolution
    t = np.linspace(0, 1, 33)
    x, y = t * width - 0.5, t * height - 0.5
    rim = np.concatenate(
        [
            np.stack(np.broadcast_arrays(a, b), -1)
            for a, b in ((x, -0.5), (x, height - 0.5), (-0.5, y), (width - 0.5, y))
        ]
    )
    K = camera.K
    u, v = camera.lens.undistort((rim[:, 0] - K[0, 2]) / K[0, 0], (rim[:, 1] - K[1, 2]) / K[1, 1])
    known = np.isfinite(u) & np.isfinite(v)
    u, v = K[0, 0] * u[known], K[1, 1] * v[known]
    left, right = (float(np.clip(w, -WIDEST * width, WIDEST * width)) for w in (u.min(), u.max()))
    top, bottom = (float(np.clip(w, -WIDEST * height, WIDEST * height)) for w in (v.min(), v.max()))
    size = (int(np.ceil(right - left)) + 2, int(np.ceil(bottom - top)) + 2)
    return replace(
        camera,
        lens=lens,
        sensor=replace(camera.sensor, resolution=size),
        principal_point=(0.5 - left, 0.5 - top),
    )


def edge_truth(wires: Wireframe, camera: Camera, image: Image) -> EdgeTruth:
    """The points of ``wires`` that ``camera`` sees; ``image``: pass ``depth``, by the camera or by one
    that stands where it does."""
    eye, axis = camera.world_from_camera[:3, 3], camera.world_from_camera[:3, 2]
    telecentric = camera.lens.projection is not Projection.PERSPECTIVE
    there = outline(wires, eye, axis if telecentric else None)
    ends, line = wires.ends[there], wires.line[there]
    ends, line = _within(ends, line, camera)
    if not len(ends):
        return EdgeTruth(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0, int))
    width, height = camera.sensor.resolution
    a, b = camera.project(ends[:, 0]), camera.project(ends[:, 1])
    diagonal = float(np.hypot(width, height))
    length = np.nan_to_num(np.linalg.norm(b - a, axis=1), nan=0.0)
    count = np.maximum(1, np.ceil(np.minimum(length, 2 * diagonal) / STEP)).astype(int)
    if count.sum() > MOST:
        count = np.maximum(1, count * MOST // count.sum())
    which = np.repeat(np.arange(len(ends)), count)
    share = (np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[which]
    points = ends[which, 0] + share[:, None] * (ends[which, 1] - ends[which, 0])
    ahead = (ends[which, 1] - ends[which, 0]) * (0.25 / count[which])[:, None]
    pixel, tangent = camera.project(points), camera.project(points + ahead) - camera.project(points - ahead)
    depth = (points - eye) @ axis
    with np.errstate(invalid="ignore"):
        inside = (pixel >= MARGIN).all(axis=1) & (pixel < np.array([width, height]) - 1 - MARGIN).all(axis=1)
        inside &= np.isfinite(tangent).all(axis=1) & (np.linalg.norm(tangent, axis=1) > 0)
    which, pixel, tangent, depth = which[inside], pixel[inside], tangent[inside], depth[inside]
    seen = _unhidden(points[inside], depth, image, camera)
    tangent = tangent[seen] / np.linalg.norm(tangent[seen], axis=1, keepdims=True)
    normals = np.stack([-tangent[:, 1], tangent[:, 0]], axis=-1)
    return EdgeTruth(pixel[seen], normals, line[which[seen]])


def _within(ends: np.ndarray, line: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Edges cut off at the plane through the camera, so that every point of them can be projected."""
    if camera.lens.projection is not Projection.PERSPECTIVE:
        return ends, line
    z = (ends - camera.world_from_camera[:3, 3]) @ camera.world_from_camera[:3, 2]
    near = camera.clip[0]
    ends, line, z = ends[(z > near).any(axis=1)], line[(z > near).any(axis=1)], z[(z > near).any(axis=1)]
    cut = (z <= near).any(axis=1)
    t = np.where(cut, (near * 1.001 - z[:, 0]) / np.where(cut, z[:, 1] - z[:, 0], 1), 0)[:, None]
    at = ends[:, 0] + t * (ends[:, 1] - ends[:, 0])
    first = np.where((cut & (z[:, 0] <= near))[:, None], at, ends[:, 0])
    second = np.where((cut & (z[:, 1] <= near))[:, None], at, ends[:, 1])
    return np.stack([first, second], axis=1), line


def _unhidden(points: np.ndarray, depth: np.ndarray, image: Image, camera: Camera) -> np.ndarray:
    """(n,) bool: whether the image shows nothing that is nearer all around; what it does not reach is hidden."""
    shown = np.asarray(image.passes["depth"], np.float64)
    shown = np.pad(shown.reshape(shown.shape[:2]), 1, mode="edge")
    pixel = np.rint((image.camera or camera).project(points))
    with np.errstate(invalid="ignore"):
        inside = (pixel >= 0).all(axis=1) & (pixel < np.array(shown.shape[::-1]) - 2).all(axis=1)
    column, row = np.where(inside[:, None], pixel, 0).astype(int).T
    around = np.max([shown[row + j, column + i] for j in range(3) for i in range(3)], axis=0)
    return inside & (depth <= around * (1 + NEARER))


def _point(
    body: str, place: np.ndarray, poses: Mapping[str, np.ndarray], camera: Camera
) -> tuple[float, float]:
    x, y = camera.project(apply(poses[body] if body else np.eye(4), np.asarray(place)))
    return float(x), float(y)


def _line(feature: LineFeature, poses: Mapping[str, np.ndarray], camera: Camera) -> Line:
    return Line(
        _point(feature.body, feature.start, poses, camera), _point(feature.body, feature.end, poses, camera)
    )


def _circle(feature: CircleFeature, poses: Mapping[str, np.ndarray], camera: Camera) -> Circle:
    """The circle of least squared distances from the image of the rim, which is an ellipse for a slanted view."""
    from analysis.tune.algorithms.circle_gauge import fit_circle

    n = np.asarray(feature.normal, np.float64) / np.linalg.norm(feature.normal)
    u = np.cross(n, (0.0, 0.0, 1.0) if abs(n[2]) < 0.9 else (1.0, 0.0, 0.0))
    u /= np.linalg.norm(u)
    angle = np.linspace(0, 2 * np.pi, 90, endpoint=False)[:, None]
    rim = feature.middle + feature.radius * (np.cos(angle) * u + np.sin(angle) * np.cross(n, u))
    pixels = camera.project(apply(poses[feature.body] if feature.body else np.eye(4), rim))
    if not np.isfinite(pixels).all():
        return Circle((float("nan"), float("nan")), float("nan"))
    return fit_circle(pixels)


def _square(feature: PatternFeature, poses: Mapping[str, np.ndarray], camera: Camera) -> Square:
    """``side``: the mean of the pattern's two sides as they are seen."""
    half = feature.size / 2
    tips = [
        np.array(_point(feature.body, feature.middle + step, poses, camera))
        for step in half * np.array([[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0]])
    ]
    side = (np.linalg.norm(tips[1] - tips[0]) + np.linalg.norm(tips[3] - tips[2])) / 2
    return Square(_point(feature.body, feature.middle, poses, camera), float(side))


def _regions(scene: Scene, image: Image, words: tuple[str, ...]) -> np.ndarray:
    bodies: list[Body] = named(scene, list(words))
    ids = np.nan_to_num(
        np.asarray(image.passes["object_id"], np.float64).reshape(image.pixels.shape[:2]), nan=-1
    )
    regions = np.zeros(ids.shape, np.int32)
    for k, name in enumerate(dict.fromkeys(b.name for b in bodies)):
        regions[ids == image.object_names.index(name)] = k + 1
    return regions
