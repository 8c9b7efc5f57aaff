"""A twin of the printed discs before the Flea3 (assets/flea3): where they lie in the raw mosaic, and a scene that has
them there.

Where the pictures were cut from the sensor is known from the source's own script (assets/flea3/README.md), so that the
lens's axis is taken where the sensor has its middle, up and left of the cut.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from analysis.calibration.boards.circles import Circles
from benchmarks.twin_flea3 import PITCH, SITES, blobs, camera_of, green, patches, posed, raw, rims
from interchange.brdf.lambert import Lambert
from interchange.camera import Camera, Sensor
from interchange.effects.vignetting import Vignetting
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.mesh import from_corners
from interchange.scene import Body

FOLDER = Path(__file__).parents[1] / "assets" / "flea3"
CUT, SENSOR = (
    (1632, 1364),
    (2448, 2048),
)  # px: column and row that the cut begins with; columns and rows of all
AXIS = tuple((n - 1) / 2 - start for n, start in zip(SENSOR, CUT, strict=True))  # of the lens, px of the cut
COLOURS = {"red": 650, "green": 550, "blue": 450}  # nm of the filter that each colour of sites is shown
WHITE = 0.85  # reflectance of paper, taken so: lamps are as bright as it looks
FULL_WELL = 8000.0  # e- that read as 255 DN, taken so: noise alone follows from it
NEAREST, FARTHEST = 0.1, 5.0  # m before the paper, between which a lamp is looked for
CORNERS = 96  # of a disc


@dataclass(frozen=True, eq=False)
class Discs:
    """``camera`` in the frame of the paper, of the cut; ``centres`` (n, 3) m of the discs that are seen as a whole, and
    ``near`` (n, 2) px; ``between`` (m, 3) m: paper amid four discs; ``radius`` m; ``off`` px rms an axis by which the
    lattice misses them."""

    camera: Camera
    centres: np.ndarray
    near: np.ndarray
    between: np.ndarray
    radius: float
    off: float


def picture(nm: int, ms: int) -> np.ndarray:
    return raw(FOLDER / f"disks_{nm}nm_{ms:04d}ms.png")


def taught(real: np.ndarray) -> Discs:
    """Pose and diameter from the discs' edges in the green sites of one raw picture."""
    index, near = blobs(green(real))
    size = index.max(axis=0) + 1
    board = Circles(int(size[0]) + 2, int(size[1]) + 2, PITCH, 0.4)
    grid = board.points.reshape(board.rows, board.columns, 3)
    centres = grid[index[:, 1] + 1, index[:, 0] + 1]
    start = replace(camera_of(real.shape[::-1]), principal_point=AXIS)
    camera = posed(start, centres, near)
    for _ in range(4):
        edges, found = rims(green(real), camera, centres, board.radius)
        camera = posed(start, centres, found)
        px = np.linalg.norm(camera.project(centres[0] + [PITCH, 0, 0]) - camera.project(centres[0]))
        board = replace(board, diameter=float(board.diameter + 2 * np.nanmedian(edges.offset) / px))
    between = (grid[:-1, :-1] + grid[1:, 1:]).reshape(-1, 3) / 2
    at = camera.project(between)
    inside = ((at > 8) & (at < np.array(real.shape[::-1]) - 9)).all(axis=1)
    missed = camera.project(centres) - found
    return Discs(camera, centres, near, between[inside], board.radius, float(np.sqrt(np.mean(missed**2))))


def sheet(discs: Discs, ink: Sequence[float]) -> tuple[Body, Body]:
    """Paper and discs that reflect ``ink`` (R, G, B) of what it does, wherever the picture may show them.

    Paper has holes where discs are: discs before it would throw shadows.
    """
    t = 2 * np.pi * np.arange(CORNERS) / CORNERS
    way = np.stack([np.cos(t), np.sin(t)], -1)
    rim = discs.radius * way / np.sqrt(np.sinc(2 / CORNERS))  # as large as discs
    square = PITCH / 2 * way / np.abs(way).max(axis=1, keepdims=True)
    first = PITCH * np.rint(discs.centres.mean(axis=0)[:2] / PITCH)
    places = first + PITCH * np.stack(np.meshgrid(*[np.arange(-8, 9)] * 2), -1).reshape(-1, 2)
    k, after = np.arange(CORNERS), np.roll(np.arange(CORNERS), -1)
    fan = np.column_stack([0 * k, 1 + k, 1 + after])
    ring = np.concatenate([
        np.column_stack([k, CORNERS + k, CORNERS + after]), np.column_stack([k, CORNERS + after, after])
    ])  # fmt: skip
    bodies = []
    for name, cell, faces, share in (
        ("paper", np.vstack([rim, square]), ring, np.ones(3)),
        ("discs", np.vstack([[0, 0], rim]), fan, np.array(ink)),
    ):
        corners = (places[:, None] + cell).reshape(-1, 2)
        whole = (len(cell) * np.arange(len(places))[:, None, None] + faces).reshape(-1, 3)
        mesh = from_corners(np.column_stack([corners, np.zeros(len(corners))]), whole)
        bodies.append(Body(f"/World/{name}", mesh, Material(name, Lambert(tuple(WHITE * share)))))
    return bodies[0], bodies[1]


def falling_off(camera: Camera) -> Camera:
    """The camera with the fall-off of a lens without distortion, cos⁴ θ, by the effect's two terms over the picture."""
    w, h = camera.sensor.resolution
    column, row = np.meshgrid(np.arange(w), np.arange(h))
    K = camera.K
    x, y = column.ravel() - K[0, 2], row.ravel() - K[1, 2]
    r2 = (x**2 + y**2) / ((w / 2) ** 2 + (h / 2) ** 2)
    fall = (1 + (x / K[0, 0]) ** 2 + (y / K[1, 1]) ** 2) ** -2
    a2, a4 = np.linalg.lstsq(np.column_stack([r2, r2**2]), fall - 1, rcond=None)[0]
    return Vignetting(float(a2), float(a4)).on(camera)


def lamp(discs: Discs, real: np.ndarray, colour: str) -> tuple[np.ndarray, float]:
    """Place (3,) m and power of a small lamp that gives bare paper the DN of one colour's sites behind such a lens."""
    at = discs.between
    dn = patches(real, discs.camera.project(at), 6, colour)
    from_axis = (discs.camera.project(at) - discs.camera.K[:2, 2]) / discs.camera.K[0, 0]
    fall = (1 + (from_axis**2).sum(axis=1)) ** -2

    def told(p: np.ndarray) -> np.ndarray:
        d = p[:3] - at
        return WHITE / np.pi * p[3] * p[2] / np.linalg.norm(d, axis=1) ** 3 * fall

    middle = at.mean(axis=0)
    start = [middle[0], middle[1], 0.5, dn.mean() / fall.mean() * np.pi / WHITE * 0.5**2]
    low, high = [-5, -5, NEAREST, 0], [5, 5, FARTHEST, np.inf]
    x = least_squares(
        lambda p: told(p) / dn - 1, start, bounds=(low, high), x_scale=[0.1, 0.1, 0.1, start[3]]
    ).x
    return x[:3], float(x[3])


def light(name: str, at: np.ndarray, intensity: Sequence[float]) -> Light:
    place = np.eye(4)
    place[:3, 3] = at
    return Light(name, LightKind.SPHERE, tuple(intensity), place, radius=0.001)


def ink(discs: Discs, real: np.ndarray, colour: str) -> float:
    """What discs reflect of what paper does, in one colour's sites."""
    dark, bright = (
        patches(real, discs.camera.project(at), half, colour).mean()
        for at, half in ((discs.centres, 4), (discs.between, 6))
    )
    return float(dark / bright)


def smaller(camera: Camera, size: int, resolution: tuple[int, int], sensor: Sensor) -> Camera:
    """The camera whose pixels are means over ``size`` x ``size``."""
    cx, cy = camera.K[:2, 2]
    sensor = replace(
        sensor, resolution=resolution, pixel_pitch=tuple(size * p for p in camera.sensor.pixel_pitch)
    )
    point = ((cx + 0.5) / size - 0.5, (cy + 0.5) / size - 0.5)
    return replace(camera, name="/World/Camera", principal_point=point, sensor=sensor)


# --- where discs lie, by their darkness alone


def centroids(real: np.ndarray, colour: str, near: np.ndarray, radius: float) -> np.ndarray:
    """(n, 2) px: the middle of each disc's darkness in the sites of one colour, the paper around it a plane.

    ``near`` (n, 2) px, ``radius`` px: where discs are, roughly, and how large. No camera and no twin is asked.
    """
    columns, rows, values = sites(real, colour)
    found = []
    for start in near:
        at = np.array(start, float)
        for _ in range(4):
            x, y = columns - at[0], rows - at[1]
            r = np.hypot(x, y)
            around, inside = (r > 1.5 * radius) & (r < 2 * radius), r < 1.5 * radius
            plane = np.linalg.lstsq(
                np.column_stack([np.ones(around.sum()), x[around], y[around]]), values[around], rcond=None
            )[0]
            dark = 1 - values[inside] / (plane[0] + plane[1] * x[inside] + plane[2] * y[inside])
            at = at + np.array([(dark * x[inside]).sum(), (dark * y[inside]).sum()]) / dark.sum()
        found.append(at)
    return np.array(found)


def sites(real: np.ndarray, colour: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Columns, rows and DN of the sites of one colour in a raw mosaic."""
    row, column = np.mgrid[: real.shape[0], : real.shape[1]]
    parts = [(column[i::2, j::2], row[i::2, j::2], real[i::2, j::2]) for i, j in SITES[colour]]
    columns, rows, values = (np.concatenate([p[k].ravel() for p in parts]).astype(float) for k in range(3))
    return columns, rows, values


def composite(frames: dict[str, np.ndarray]) -> np.ndarray:
    """A raw mosaic whose sites of each colour are those of another picture {colour: raw mosaic}."""
    whole = np.empty_like(next(iter(frames.values())))
    for colour, frame in frames.items():
        for i, j in SITES[colour]:
            whole[i::2, j::2] = frame[i::2, j::2]
    return whole
