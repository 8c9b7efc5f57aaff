"""From where the light comes, by its reflection in a mirror sphere.

    w = 2 (n . v) n - v,    n the sphere's normal where the highlight is seen, v towards the camera

The sphere itself follows from its outline: a telecentric camera sees a circle; to any other camera rays r along the
outline form a cone, r . a = cos α, linear in a / cos α, and a sphere of radius R stands R / sin α away. Debevec:
Rendering synthetic objects into real scenes. SIGGRAPH 1998, for the mirror; the cone is exact.
"""

from dataclasses import dataclass

import numpy as np

from interchange.camera import Camera, Projection
from interchange.problems import BrightfieldError


@dataclass(frozen=True, eq=False)
class Sphere:
    """``center`` (3,) m, world; ``radius`` m."""

    center: np.ndarray
    radius: float


@dataclass(frozen=True, eq=False)
class Reflected:
    """``wi`` (L, 3) unit, to the lamps; ``points`` (L, 3) m on the sphere where they are reflected; ``pixels`` (L, 2)
    (column, row) of the highlights."""

    wi: np.ndarray
    points: np.ndarray
    pixels: np.ndarray


def sphere_of_outline(camera: Camera, outline: np.ndarray, radius: float, plane: float = 0.0) -> Sphere:
    """The sphere of ``radius`` m whose outline is seen at ``outline`` (N, 2) px (column, row).

    A telecentric camera does not tell how far away it is: its centre then lies at z = ``plane`` + radius. Raises
    BrightfieldError where the points are no outline of a sphere.
    """
    if len(outline) < 5:
        raise BrightfieldError(f"An outline must have five points or more; got {len(outline)}.")
    origin, ray = camera.rays(np.asarray(outline, np.float64))
    pose = np.asarray(camera.world_from_camera)
    if camera.lens.projection is Projection.ORTHOGRAPHIC:
        x, y = ((origin - pose[:3, 3]) @ pose[:3, :3])[:, :2].T
        # (x - a)² + (y - b)² = r²: linear in a, b and r² - a² - b²
        a, b, c = np.linalg.lstsq(np.stack([2 * x, 2 * y, np.ones_like(x)], 1), x**2 + y**2, rcond=None)[0]
        seen = float(np.sqrt(c + a * a + b * b))
        if not abs(seen / radius - 1) < 0.1:
            raise BrightfieldError(
                f"The outline must be that of a sphere of {radius:g} m; it has a radius of {seen:g} m."
            )
        across = pose[:3, 3] + a * pose[:3, 0] + b * pose[:3, 1]
        depth = (plane + radius - across[2]) / pose[2, 2]
        return Sphere(across + depth * pose[:3, 2], radius)
    axis = np.linalg.lstsq(ray, np.ones(len(ray)), rcond=None)[0]
    length = float(np.linalg.norm(axis))  # 1 / cos α
    if not length > 1:
        raise BrightfieldError("The points must lie on the outline of a sphere; their rays form no cone.")
    sine = np.sqrt(1 - 1 / length**2)
    return Sphere(pose[:3, 3] + axis / length * radius / sine, radius)


def outline_of(mask: np.ndarray) -> np.ndarray:
    """(N, 2) px (column, row), between pixels: the longest contour of ``mask`` (H, W), 1 inside, 0 outside.

    Values in between, as on an antialiased edge, place it more finely. Raises BrightfieldError where there is none.
    """
    from skimage.measure import find_contours

    contours = find_contours(np.asarray(mask, np.float64), 0.5)  # type: ignore[no-untyped-call]
    if not contours:
        raise BrightfieldError("The mask of a mirror sphere must have an inside and an outside.")
    return np.asarray(max(contours, key=len)[:, ::-1])


def highlights(images: np.ndarray, inside: np.ndarray | None = None, share: float = 0.5) -> np.ndarray:
    """(L, 2) px (column, row): the centroid of what is brighter than ``share`` of the brightest, next to that pixel.

    ``images`` (L, H, W); ``inside`` (H, W) bool limits the search. Raises BrightfieldError for an image without light.
    """
    import cv2

    found = np.empty((len(images), 2))
    for k, image in enumerate(np.asarray(images, np.float64)):
        seen = image if inside is None else np.where(inside, image, 0.0)
        top = float(np.nanmax(seen))
        if not top > 0:
            raise BrightfieldError(f"Image {k} of the mirror sphere shows no highlight.")
        bright = (seen > share * top).astype(np.uint8)
        _, labels = cv2.connectedComponents(bright, connectivity=8)
        row, column = np.unravel_index(int(np.nanargmax(seen)), seen.shape)
        weight = np.where(labels == labels[row, column], seen - share * top, 0.0)
        rows, columns = np.indices(seen.shape)
        found[k] = (weight * columns).sum() / weight.sum(), (weight * rows).sum() / weight.sum()
    return found


def lights_of_sphere(camera: Camera, sphere: Sphere, pixels: np.ndarray) -> Reflected:
    """Directions to the lamps whose highlights are seen at ``pixels`` (L, 2). BrightfieldError where one misses the
    sphere."""
    origin, ray = camera.rays(np.asarray(pixels, np.float64))
    to = np.broadcast_to(origin, ray.shape) - sphere.center
    along = np.einsum("lk,lk->l", to, ray)
    root = along**2 - (np.einsum("lk,lk->l", to, to) - sphere.radius**2)
    if not (root > 0).all():
        raise BrightfieldError(f"The highlight of image {int(np.argmin(root))} lies beside the sphere.")
    point = np.broadcast_to(origin, ray.shape) + (-along - np.sqrt(root))[:, None] * ray
    n = (point - sphere.center) / sphere.radius
    wi = ray - 2 * np.einsum("lk,lk->l", ray, n)[:, None] * n
    return Reflected(wi, point, np.asarray(pixels, np.float64))


def lamp_positions(seen: list[Reflected]) -> np.ndarray:
    """(L, 3) m: where the rays from two or more spheres come nearest to each other, by least squares.

    Raises BrightfieldError for one sphere, or where a lamp's rays are parallel: it is too far to be placed.
    """
    if len(seen) < 2:
        raise BrightfieldError("A lamp's place needs two spheres or more; one tells its direction.")
    w, p = np.stack([s.wi for s in seen]), np.stack([s.points for s in seen])
    across = np.eye(3) - w[..., :, None] * w[..., None, :]
    normal = across.sum(axis=0)
    if not (np.linalg.eigvalsh(normal)[:, 0] > 1e-6).all():
        raise BrightfieldError("The rays to a lamp are parallel: it is too far away to be placed.")
    right = np.einsum("slij,slj->li", across, p)
    return np.asarray(np.linalg.solve(normal, right[..., None])[..., 0])
