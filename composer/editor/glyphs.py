"""Lines that stand for what has no surface: lamps, cameras with their field of view, the grid, a selection's box.

Pure geometry: segments (N, 2, 3) in the world, m, and their way into a view's pixels.
"""

import numpy as np

from composer.editor.orbit import gl_matrices
from interchange.camera import Camera, Projection
from interchange.frames import apply
from interchange.light import Light, LightKind

ROUND = np.stack([np.cos(np.linspace(0, 2 * np.pi, 33)), np.sin(np.linspace(0, 2 * np.pi, 33))], axis=1)


def chain(points: np.ndarray) -> np.ndarray:
    """(N - 1, 2, 3): the segments of a line through points (N, 3)."""
    return np.stack([points[:-1], points[1:]], axis=1)


def ring(radius: float, z: float = 0.0, axis: int = 2) -> np.ndarray:
    points = np.zeros((len(ROUND), 3))
    others = [i for i in range(3) if i != axis]
    points[:, others] = radius * ROUND
    points[:, axis] = z
    return chain(points)


def lamp(light: Light, size: float, beam: bool = True) -> np.ndarray:
    """The emitting surface and the axis of a lamp, with the cone of its ``beam``; ``size``: m, where it has no extent
    of its own."""
    match light.kind:
        case LightKind.SPHERE:
            r = max(light.radius, 0.16 * size)
            own = [ring(r, axis=k) for k in range(3)]
        case LightKind.DISK:
            r = max(light.radius, 0.1 * size)
            own = [ring(r)]
        case LightKind.RECT:
            x, y = max(light.width, 1e-6) / 2, max(light.height, 1e-6) / 2
            own = [chain(np.array([[-x, -y, 0], [x, -y, 0], [x, y, 0], [-x, y, 0], [-x, -y, 0]], float))]
        case LightKind.CYLINDER:
            r, x = max(light.radius, 1e-6), light.length / 2
            rings = [ring(r, z, axis=0) for z in (-x, x)]
            own = [*rings, np.array([[[-x, r, 0], [x, r, 0]], [[-x, -r, 0], [x, -r, 0]]], float)]
        case LightKind.DISTANT:
            own = [ring(0.3 * size)]
            for a in np.linspace(0, 2 * np.pi, 6, endpoint=False):
                x, y = 0.3 * size * np.cos(a), 0.3 * size * np.sin(a)
                own.append(np.array([[[x, y, 0], [x, y, -size]]]))
        case LightKind.DOME:
            own = [ring(0.5 * size, axis=k) for k in range(3)]
    if light.kind not in (LightKind.DOME, LightKind.DISTANT):
        own.append(np.array([[[0, 0, 0], [0, 0, -size if beam else -0.5 * size]]], float))
        if beam and light.cone_angle < np.pi / 2:
            r = size * np.tan(min(light.cone_angle, np.radians(85)))
            own.append(ring(r, -size))
            for k in range(0, 32, 8):
                own.append(np.array([[[0, 0, 0], [r * ROUND[k, 0], r * ROUND[k, 1], -size]]]))
    return np.asarray(apply(light.world_from_light, np.concatenate(own)))


def frustum(camera: Camera, near: float, far: float) -> np.ndarray:
    """The field of view between two depths, m, with the lens's distortion in its edges."""
    width, height = camera.sensor.resolution
    t = np.linspace(0, 1, 9)
    edge = np.concatenate(
        [
            np.stack([-0.5 + width * t, np.full(9, -0.5)], 1),
            np.stack([np.full(9, width - 0.5), -0.5 + height * t], 1),
            np.stack([width - 0.5 - width * t, np.full(9, height - 0.5)], 1),
            np.stack([np.full(9, -0.5), height - 0.5 - height * t], 1),
        ]
    )
    origin, direction = camera.rays(edge)
    axis = camera.world_from_camera[:3, 2]
    start = camera.world_from_camera[:3, 3]
    lines = []
    for depth in (near, far):
        s = (depth - (origin - start) @ axis) / np.maximum(direction @ axis, 1e-9)
        lines.append(origin + s[:, None] * direction)
    corners = [0, 9, 18, 27]
    from_eye = camera.lens.projection is Projection.PERSPECTIVE
    first = np.broadcast_to(start, (4, 3)) if from_eye else origin[corners]
    segments = [chain(lines[0]), chain(lines[1]), np.stack([first, lines[1][corners]], axis=1)]
    up = camera.world_from_camera[:3, 1]
    top = lines[0][corners[0]], lines[0][corners[1]]
    tip = (top[0] + top[1]) / 2 - 0.35 * np.linalg.norm(top[1] - top[0]) * up
    segments.append(np.array([[top[0], tip], [tip, top[1]]]))
    found = np.concatenate(segments)
    return np.asarray(found[np.isfinite(found).all(axis=(1, 2))])


def box(bounds: np.ndarray) -> np.ndarray:
    """The twelve edges of a box (2, 3)."""
    c = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    pairs = [(a, b) for a in range(8) for b in range(a + 1, 8) if np.abs(c[a] - c[b]).sum() == 1]
    corners = bounds[0] + c * (bounds[1] - bounds[0])
    return np.array([[corners[a], corners[b]] for a, b in pairs])


def grid(distance: float) -> tuple[np.ndarray, float]:
    """Lines on the ground and their pitch, m: of a power of ten that suits the distance of the eye."""
    pitch = 10.0 ** np.floor(np.log10(max(distance, 1e-6) / 3))
    n = 20
    at = pitch * np.arange(-n, n + 1)
    reach = pitch * n
    zero = np.zeros_like(at)
    along = np.stack([np.stack([at, zero - reach, zero], 1), np.stack([at, zero + reach, zero], 1)], 1)
    across = np.stack([np.stack([zero - reach, at, zero], 1), np.stack([zero + reach, at, zero], 1)], 1)
    return np.concatenate([along, across]), float(pitch)


def on_screen(camera: Camera, segments: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pixels (M, 2, 2) of what of the segments lies before the camera, and which (M,) they are."""
    view, projection = gl_matrices(camera)
    clip = np.concatenate([segments, np.ones((*segments.shape[:2], 1))], axis=2) @ (projection @ view).T
    near = 1e-6 if camera.lens.projection is Projection.ORTHOGRAPHIC else camera.clip[0]
    w0, w1 = clip[:, 0, 3], clip[:, 1, 3]
    keep = np.flatnonzero((w0 > near) | (w1 > near))
    clip = clip[keep]
    w0, w1 = clip[:, 0, 3].copy(), clip[:, 1, 3].copy()
    a, b = clip[:, 0].copy(), clip[:, 1].copy()
    for w, here, other, wo in ((w0, a, b, w1), (w1, b, a, w0)):
        behind = w <= near
        t = ((near - w[behind]) / (wo[behind] - w[behind]))[:, None]
        here[behind] += t * (other[behind] - here[behind])
    ends = np.stack([a, b], axis=1)
    xy = ends[..., :2] / ends[..., 3:]
    width, height = camera.sensor.resolution
    pixels = np.stack([(xy[..., 0] + 1) / 2 * width, (1 - xy[..., 1]) / 2 * height], axis=-1)
    return pixels, keep


def distance_to(pixels: np.ndarray, at: tuple[float, float]) -> float:
    """px from a point to the nearest of segments (M, 2, 2); infinite without any."""
    if not len(pixels):
        return float("inf")
    a, b = pixels[:, 0], pixels[:, 1]
    d = b - a
    t = np.clip(((np.asarray(at) - a) * d).sum(1) / np.maximum((d * d).sum(1), 1e-12), 0, 1)
    return float(np.linalg.norm(a + t[:, None] * d - at, axis=1).min())
