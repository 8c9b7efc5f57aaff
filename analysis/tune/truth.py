"""What an image truly shows, in its own pixels: CAD edges, gauged lines and circles, regions of parts and defects.

Points along the edges are projected through the camera's lens; a point counts as seen where the image's depth says
that nothing stands before it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from analysis.tune.features import CircleFeature, Features, LineFeature, PatternFeature
from analysis.tune.found import Circle, Line
from analysis.tune.wireframe import Wireframe, outline
from analysis.view.visibility import Renderer, named
from interchange.camera import Camera, Projection
from interchange.frames import apply
from interchange.image import Image
from interchange.scene import Body, Scene

STEP = 0.5  # px between points of an edge
NEARER = 2e-3  # of the depth: what stands before a point must be nearer by that
MARGIN = 3.0  # px from the image's border that count as outside
MOST = 40_000  # points of edges an image


@dataclass(frozen=True, eq=False)
class EdgeTruth:
    """Seen points every ``STEP`` px of the edges. ``points`` (n, 2) px; ``normals`` (n, 2) unit, across the edge;
    ``line`` (n,) int: points of one straight edge in the world have one number."""

    points: np.ndarray
    normals: np.ndarray
    line: np.ndarray

    @property
    def length(self) -> float:
        """px of edge that are seen."""
        return STEP * len(self.points)


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


def truth(renderer: Renderer, scene: Scene, camera: Camera, wanted: Features, wires: Wireframe) -> Truth:
    """What ``camera`` sees of ``wanted``; ``wires``: the edges of the bodies at ``scene``'s moment."""
    sharp = _pinhole(camera)
    image = renderer.render(scene, sharp, ["depth", "object_id"], samples=1)
    poses = {b.name: b.world_from_body for b in reversed(scene.bodies)}
    return Truth(
        edges=edge_truth(wires, camera, image) if wanted.edges else None,
        lines={n: _line(x, poses, camera) for n, x in wanted.lines.items()},
        circles={n: _circle(x, poses, camera) for n, x in wanted.circles.items()},
        patterns={n: _square(x, poses, camera) for n, x in wanted.patterns.items()},
        regions=_regions(scene, image, wanted.blobs) if wanted.blobs else None,
    )


def edge_truth(wires: Wireframe, camera: Camera, image: Image) -> EdgeTruth:
    """The points of ``wires`` that ``camera`` sees; ``image``: pass ``depth`` at pixel centres."""
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
    shown = np.asarray(image.passes["depth"], np.float64).reshape(height, width)
    column, row = np.rint(pixel).astype(int).T
    around = np.max([shown[row + j, column + i] for j in (-1, 0, 1) for i in (-1, 0, 1)], axis=0)
    seen = depth <= around * (1 + NEARER)
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


def _pinhole(camera: Camera) -> Camera:
    return replace(camera, lens=replace(camera.lens, f_stop=0.0))  # depth is a matter of pinholes


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
