"""Surfaces whose truth is known, small ones for illumination series: textured plastic with the defects of Fig. 9, a
circuit board as in Fig. 10, a coin as in Fig. 8, a ball.

Gruna, Irgenfried: Reflectance modeling in machine vision. 2012. Their shapes and materials are ours: heights as
functions of x and y, the Ward model with mapped parameters, so that no feature below is of the model that was drawn.
A telecentric camera looks along -z; world x is right, y up in the image.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter

from interchange.brdf.lambert import Lambert
from interchange.brdf.ward import Ward
from interchange.camera import Camera, Lens, Projection, Sensor
from interchange.formats.gprims import box
from interchange.frames import look_at
from interchange.material import Material, Texture, Wrap
from interchange.mesh import Mesh
from interchange.scene import Body, Scene

SENSOR = {"full_well": 30000.0, "bit_depth": 12, "black_level": 64.0, "read_noise": 8.0, "prnu": 0.004}
Height = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class Specimen:
    """``truth`` (H, W): index into ``classes``, 0 the sound or the most common; ``normals`` (H, W, 3) at the pixels'
    centres."""

    scene: Scene
    camera: Camera
    truth: np.ndarray
    classes: tuple[str, ...]
    normals: np.ndarray


def camera_above(size: int, field: float) -> Camera:
    """A telecentric camera of ``size`` by ``size`` px over ``field`` m around the origin."""
    pitch = field / size
    return Camera(
        "/camera",
        look_at(np.array([0, 0, 0.4]), np.zeros(3), up=(0, 1, 0)),
        Lens(projection=Projection.ORTHOGRAPHIC),
        Sensor((size, size), (pitch, pitch), responsivity=1e4, mosaic="mono", **SENSOR),  # type: ignore[arg-type]
    )


def pixel_grid(size: int, field: float) -> tuple[np.ndarray, np.ndarray]:
    """World x and y (size, size), m, of the pixels' centres."""
    step = (np.arange(size) + 0.5) / size * field - field / 2
    x, y = np.meshgrid(step, -step)
    return x, y


def relief(height: np.ndarray, field: float) -> tuple[Mesh, np.ndarray]:
    """The mesh of ``height`` (N, N) m over a square of ``field`` m, row 0 at +y, and its normals (N, N, 3)."""
    n = len(height)
    x, y = np.meshgrid(np.linspace(-field / 2, field / 2, n), np.linspace(field / 2, -field / 2, n))
    step = field / (n - 1)
    down, right = np.gradient(height, step)
    normals = np.stack([-right, down, np.ones_like(height)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    i, j = np.meshgrid(np.arange(n - 1), np.arange(n - 1), indexing="ij")
    a = (i * n + j).ravel()
    faces = np.concatenate([np.stack([a, a + n, a + 1], 1), np.stack([a + 1, a + n, a + n + 1], 1)])
    u, v = np.meshgrid(np.linspace(0, 1, n), np.linspace(1, 0, n))
    mesh = Mesh(
        np.stack([x, y, height], axis=-1).reshape(-1, 3),
        faces.astype(np.int32),
        normals.reshape(-1, 3),
        np.stack([u, v], axis=-1).reshape(-1, 2),
    )
    return mesh, normals


def _at_pixels(values: np.ndarray, size: int) -> np.ndarray:
    """Values (N, N, ...) on the corners of a square, bilinear at the centres of its ``size`` pixels."""
    n = len(values)
    at = (np.arange(size) + 0.5) / size * (n - 1)
    k = np.minimum(at.astype(int), n - 2)
    w = (at - k).reshape(-1, *[1] * (values.ndim - 1))
    rows = values[k] * (1 - w) + values[k + 1] * w
    w = (at - k).reshape(1, -1, *[1] * (values.ndim - 2))
    return np.asarray(rows[:, k] * (1 - w) + rows[:, k + 1] * w)


def _map(values: np.ndarray) -> Texture:
    return Texture(np.asarray(values, np.float32)[..., None], (Wrap.CLAMP, Wrap.CLAMP))


def _specimen(
    height: np.ndarray,
    maps: dict[str, np.ndarray],
    truth: np.ndarray,
    classes: tuple[str, ...],
    size: int,
    field: float,
) -> Specimen:
    mesh, normals = relief(height, field)
    material = Material("/surface", Ward(), {name: _map(values) for name, values in maps.items()})
    camera = camera_above(size, field)
    at = _at_pixels(normals, size)
    at /= np.linalg.norm(at, axis=-1, keepdims=True)
    scene = Scene((Body("/specimen", mesh, material),), (), (camera,))
    return Specimen(scene, camera, truth, classes, at)


def grain(size: int, field: float, rng: np.random.Generator, length: float, slope: float) -> np.ndarray:
    """(size, size) m: Gaussian bumps of correlation length ``length`` m and rms slope ``slope``."""
    z = gaussian_filter(rng.normal(size=(size, size)), length / field * size / 2, mode="wrap")
    down, right = np.gradient(z, field / (size - 1))
    return np.asarray(z * slope / np.sqrt(np.mean(down**2 + right**2) / 2))


def textured_plastic(size: int = 128, seed: int = 0, defects: bool = True, field: float = 15e-3) -> Specimen:
    """A grained plastic plate, 15 mm, with (1) scratches, (2) a paint stain, (3) a groove, (4) a dent: Fig. 9."""
    rng = np.random.default_rng(seed)
    fine = 2 * size + 1
    z = grain(fine, field, rng, 0.45e-3, 0.07)
    step = np.linspace(-1, 1, fine) * field / 2
    x, y = np.meshgrid(step, -step)
    diffuse, specular, alpha = np.full_like(z, 0.25), np.full_like(z, 0.05), np.full_like(z, 0.22)
    diffuse = diffuse * (1 + 0.04 * gaussian_filter(rng.normal(size=z.shape), 2.0) * 2 * np.sqrt(np.pi) * 2)
    truth = np.zeros((size, size), np.int64)
    px, py = pixel_grid(size, field)
    if defects:
        mm = 1e-3
        for ax, ay, bx, by in ((-6, 5.5, -1.5, 6.2), (-6.2, 3.2, -2.5, 4.6), (-4.8, 6.6, -3.4, 2.6)):
            ends = np.array([[ax, ay], [bx, by]]) * mm
            z -= 25e-6 * np.exp(-0.5 * (distance_to_segment(x, y, *ends) / 0.05e-3) ** 2)
            near = np.exp(-0.5 * (distance_to_segment(x, y, *ends) / 0.07e-3) ** 2)
            alpha, specular = alpha + 0.12 * near, specular + 0.03 * near
            truth[distance_to_segment(px, py, *ends) < 0.12e-3] = 1

        def blob(u: np.ndarray, v: np.ndarray) -> np.ndarray:
            angle = np.arctan2(v - 3.8 * mm, u - 3.8 * mm)
            radius = np.hypot(u - 3.8 * mm, v - 3.8 * mm)
            return radius / ((1.25 + 0.25 * np.cos(3 * angle) + 0.12 * np.sin(5 * angle)) * mm)

        paint = 1 / (1 + np.exp((blob(x, y) - 1) * 25))
        diffuse = diffuse * (1 - paint) + 0.33 * paint
        specular, alpha = specular * (1 - 0.5 * paint), alpha + 0.08 * paint
        truth[blob(px, py) < 1] = 2
        ends = np.array([[-6.0, -2.2], [-0.8, -5.8]]) * mm
        z -= 60e-6 * np.exp(-0.5 * (distance_to_segment(x, y, *ends) / 0.16e-3) ** 2)
        truth[distance_to_segment(px, py, *ends) < 0.36e-3] = 3
        z -= 220e-6 * np.exp(-0.5 * np.square(np.hypot(x - 3.6 * mm, y + 3.9 * mm) / (0.55 * mm)))
        truth[np.hypot(px - 3.6 * mm, py + 3.9 * mm) < 1.2 * mm] = 4
    maps = {"diffuse": np.clip(diffuse, 0, 1), "specular": specular, "alpha": alpha}
    return _specimen(z, maps, truth, ("sound", "scratch", "stain", "groove", "dent"), size, field)


def distance_to_segment(x: np.ndarray, y: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """m from points (x, y) to the segment from ``a`` to ``b``."""
    d = b - a
    t = np.clip(((x - a[0]) * d[0] + (y - a[1]) * d[1]) / (d @ d), 0, 1)
    return np.hypot(x - a[0] - t * d[0], y - a[1] - t * d[1])


# diffuse, specular, alpha (Ward), and rms slope of the surface: after what such materials look like, not measured
BOARD = {
    "substrate": (0.16, 0.035, 0.30, 0.03),
    "gold": (0.06, 0.42, 0.17, 0.03),
    "silver": (0.10, 0.68, 0.30, 0.05),
    "paint": (0.62, 0.03, 0.45, 0.03),
}


def circuit_board(size: int = 128, seed: int = 0, field: float = 15e-3) -> Specimen:
    """A piece of a circuit board: substrate, gold pads and tracks, silver solder, white paint: Fig. 10."""
    rng = np.random.default_rng(seed)
    px, py = pixel_grid(size, field)
    labels = board_layout(px, py)
    fine = 4 * size
    x, y = pixel_grid(fine, field)
    texture = board_layout(x, y)
    table = np.array(list(BOARD.values()))
    vary = 1 + 0.05 * gaussian_filter(rng.normal(size=texture.shape), 4.0) * 8 * np.sqrt(np.pi)
    maps = {
        name: np.clip(gaussian_filter(table[texture, k] * vary, 0.7), 1e-3, 1)
        for k, name in enumerate(("diffuse", "specular", "alpha"))
    }
    corner = np.linspace(-1, 1, 2 * size + 1) * field / 2
    cx, cy = np.meshgrid(corner, -corner)
    slope = gaussian_filter(table[board_layout(cx, cy), 3], 1.0)
    z = grain(2 * size + 1, field, rng, 0.5e-3, 1.0) * slope
    return _specimen(z, maps, labels, tuple(BOARD), size, field)


def board_layout(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Index of the material at (x, y), m: 0 substrate, 1 gold, 2 silver, 3 paint."""
    u, v = x * 1e3, y * 1e3  # mm
    out = np.zeros(np.shape(x), np.int64)
    for k in range(6):  # a row of pads with tracks that leave them
        cx = -5.6 + 2.25 * k
        out[(np.abs(u - cx) < 0.62) & (np.abs(v - 4.6) < 1.1)] = 1
        out[(np.abs(u - cx) < 0.2) & (v < 4.6) & (v > 1.2 - 0.4 * k)] = 1
    out[(np.abs(v + 0.3) < 0.28) & (u > -6.4) & (u < 6.4)] = 1
    for k in range(5):  # solder in rings of gold
        r = np.hypot(u + 5.2 - 2.6 * k, v + 3.1)
        out[r < 1.05] = 1
        out[r < 0.72] = 2
    out[(np.abs(u - 4.6) < 1.7) & (np.abs(v + 5.9) < 0.7)] = 2
    frame = np.maximum(np.abs(u + 2.6) / 3.9, np.abs(v + 5.8) / 0.95)
    out[(frame < 1) & (frame > 0.72)] = 3
    out[(np.abs(u + 2.6) < 2.0) & (np.abs(v + 5.8) < 0.25)] = 3
    out[np.hypot(u - 6.1, v - 1.6) < 0.75] = 3
    return out


def coin(size: int = 128, seed: int = 0, field: float = 18e-3) -> Specimen:
    """A struck metal disc: rim, a ring of beads, a star; classes ground and coin. Fig. 8."""
    rng = np.random.default_rng(seed)
    fine = 2 * size + 1
    step = np.linspace(-1, 1, fine) * field / 2
    x, y = np.meshgrid(step, -step)
    r, angle = np.hypot(x, y) * 1e3, np.arctan2(y, x)  # mm

    def edge(distance: np.ndarray, width: float) -> np.ndarray:
        return 1 / (1 + np.exp(-distance / width))

    disc = edge(8.0 - r, 0.06)
    rim = edge(r - 7.2, 0.06) * disc
    beads = np.zeros_like(r)
    for k in range(36):
        a = 2 * np.pi * k / 36
        beads = np.maximum(
            beads,
            np.exp(-0.5 * ((x * 1e3 - 6.5 * np.cos(a)) ** 2 + (y * 1e3 - 6.5 * np.sin(a)) ** 2) / 0.17**2),
        )
    star = edge((4.2 + 1.5 * np.cos(5 * (angle - np.pi / 2))) * 0.9 - r, 0.09)
    boss = np.sqrt(np.maximum(1 - (r / 2.2) ** 2, 0))
    z = 1e-3 * (0.45 * disc + 0.25 * rim + 0.16 * beads + 0.16 * star + 0.3 * boss)
    z += grain(fine, field, rng, 0.2e-3, 0.025)
    maps = {
        "diffuse": 0.05 + 0.06 * disc,
        "specular": 0.02 + 0.48 * disc,
        "alpha": np.full_like(r, 0.3) - 0.08 * disc,
    }
    px, py = pixel_grid(size, field)
    truth = (np.hypot(px, py) < 8e-3).astype(np.int64)
    return _specimen(z, maps, truth, ("ground", "coin"), size, field)


def fixture_relief(size: int = 64, gloss: float = 0.0, field: float = 16e-3) -> Specimen:
    """A light plastic relief, a boss, a bowl and a valley, between the jaws of a fixture that stand 3 mm above it.

    ``gloss``: albedo of its Ward lobe. No slope is steeper than 40 degrees, so that lamps up to 45 degrees off the
    axis leave no part dark by itself; the jaws throw shadows and light onto it.
    """
    step = np.linspace(-1, 1, 2 * size + 1) * field / 2
    x, y = np.meshgrid(step * 1e3, -step * 1e3)  # mm
    z = 1.6 * np.exp(-((x + 3) ** 2 + (y - 3) ** 2) / (2 * 1.5**2))
    z -= 1.9 * np.exp(-((x - 3) ** 2 + (y - 2.5) ** 2) / (2 * 1.6**2))
    z -= 1.0 * np.exp(-((y + 3.5 + 0.1 * x) ** 2) / (2 * 0.9**2))
    maps = {
        "diffuse": np.full_like(z, 0.7),
        "specular": np.full_like(z, gloss),
        "alpha": np.full_like(z, 0.15),
    }
    made = _specimen(1e-3 * z, maps, np.zeros((size, size), np.int64), ("plastic",), size, field)
    jaw = Material("/jaw", Lambert(diffuse=(0.6,) * 3))
    jaws = []
    for side in (-1, 1):
        block = box(1.0)
        pose = np.diag([2e-3, 1.2 * field, 8e-3, 1.0])
        pose[:3, 3] = side * (field / 2 + 1.2e-3), 0, -1e-3
        jaws.append(Body(f"/jaw{side}", block, jaw, pose))
    scene = Scene((*made.scene.bodies, *jaws), (), made.scene.cameras)
    return Specimen(scene, made.camera, made.truth, made.classes, made.normals)


SPECIMENS: dict[str, Callable[[int, int], Specimen]] = {
    "plastic": textured_plastic,
    "board": circuit_board,
    "coin": coin,
}
