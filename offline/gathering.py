"""The sensor's pixels from a wide image of finer ones: each is carried through the lens model and shared out.

A fine pixel of spacing h (px of the sensor, along each axis) counts to the pixels that a tent of half width h around
its place lies on, times the area that it has on the sensor. Tents at spacing h add up to one and keep first moments
(Strang and Fix): a pixel's mean is centred on the pixel whatever way the two grids meet, where boxes of width h would
be off by up to h² / 8. The price is its spread, that of the square and 1 + 3 h² times as much in variance.
"""

import numpy as np

from interchange.camera import Camera
from interchange.compiled import jit
from interchange.problems import BrightfieldError

COARSE = 16  # fine pixels between those at which a fold is looked for


class Gathering:
    """Sums over the pixels of ``camera`` of planes that ``wide`` sees, band by band."""

    def __init__(self, wide: Camera, camera: Camera) -> None:
        self.wide, self.camera = wide, camera
        self.sums: dict[str, np.ndarray] = {}
        self.weights: dict[str, np.ndarray] = {}

    def add(self, planes: dict[str, np.ndarray], first: int = 0) -> None:
        """``planes``: (rows, w, C) each, seen by ``wide`` from row ``first`` on."""
        (width, height), w = self.camera.sensor.resolution, self.wide.sensor.resolution[0]
        rows = len(next(iter(planes.values())))
        u, v = _places(self.wide, self.camera, np.arange(-1, w + 1), np.arange(first - 1, first + rows + 1))
        for name, plane in planes.items():
            if name not in self.sums:
                self.sums[name] = np.zeros((height, width, plane.shape[2]))
                self.weights[name] = np.zeros((height, width))
            _share_out(u, v, np.ascontiguousarray(plane, np.float32), self.sums[name], self.weights[name])

    def means(self) -> dict[str, np.ndarray]:
        """(H, W, C) float32 each. Raises BrightfieldError where no fine pixel falls on a pixel."""
        for weights in self.weights.values():
            if (weights <= 0).any():
                raise BrightfieldError(
                    f"{(weights <= 0).sum()} pixels of a distorted image were not covered; take more samples. "
                    f"({self.camera.where or self.camera.name})"
                )
        return {
            name: (total / self.weights[name][..., None]).astype(np.float32)
            for name, total in self.sums.items()
        }


def pick(plane: np.ndarray, wide: Camera, camera: Camera, first: int, out: np.ndarray) -> None:
    """Into ``out`` (H, W, C), where the sensor's pixel centres fall on rows of ``plane`` (rows, w, C): the nearest."""
    (width, height), K, fine = camera.sensor.resolution, camera.K, wide.K
    column, row = np.meshgrid(np.arange(width), np.arange(height))
    x, y = camera.lens.undistort((column - K[0, 2]) / K[0, 0], (row - K[1, 2]) / K[1, 1])
    i, j = np.rint(fine[0, 0] * x + fine[0, 2]).astype(int), np.rint(fine[1, 1] * y + fine[1, 2]).astype(int)
    here = (j >= first) & (j < first + len(plane))
    out[here] = plane[j[here] - first, i[here]]


def _places(
    wide: Camera, camera: Camera, columns: np.ndarray, rows: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Where the centres of fine pixels fall on the sensor, px; NaN beyond a fold, where another point is imaged."""
    K, fine, lens = camera.K, wide.K, camera.lens
    x, y = np.meshgrid((columns - fine[0, 2]) / fine[0, 0], (rows - fine[1, 2]) / fine[1, 1])
    with np.errstate(all="ignore"):
        u, v = lens.distort(x, y)

        def folded(few: tuple[slice, slice]) -> np.ndarray:
            back_x, back_y = lens.undistort(u[few], v[few])
            return ~(np.hypot(back_x - x[few], back_y - y[few]) < 1e-6)

        nodes = [(slice(r, None, COARSE), slice(c, None, COARSE)) for r in (0, -1) for c in (0, -1)]
        if any(
            folded(few).any() for few in nodes
        ):  # to invert the model is dear, and few lenses fold near the field
            beyond = folded((slice(None), slice(None)))
            u, v = np.where(beyond, np.nan, u), np.where(beyond, np.nan, v)
    return K[0, 0] * u + K[0, 2], K[1, 1] * v + K[1, 2]


@jit()
def _below(edge: float, place: float, half: float) -> float:
    """The share of a tent around ``place`` that lies below ``edge``."""
    t = min(max((edge - place) / half, -1.0), 1.0)
    return 0.5 + t - 0.5 * t * abs(t)


@jit()
def _share_out(
    u: np.ndarray, v: np.ndarray, plane: np.ndarray, sums: np.ndarray, weights: np.ndarray
) -> None:
    """``u``, ``v`` (rows + 2, w + 2): places, with a border of one."""
    height, width = weights.shape
    for r in range(plane.shape[0]):
        for c in range(plane.shape[1]):
            x, y = u[r + 1, c + 1], v[r + 1, c + 1]
            ux, uy = (u[r + 1, c + 2] - u[r + 1, c]) / 2, (u[r + 2, c + 1] - u[r, c + 1]) / 2
            vx, vy = (v[r + 1, c + 2] - v[r + 1, c]) / 2, (v[r + 2, c + 1] - v[r, c + 1]) / 2
            area, a, b = abs(ux * vy - uy * vx), abs(ux), abs(vy)
            if not (np.isfinite(x + y + area) and x + a > -0.5 and x - a < width - 0.5):
                continue
            for j in range(max(int(np.floor(y - b + 0.5)), 0), min(int(np.floor(y + b + 0.5)) + 1, height)):
                down = area * (_below(j + 0.5, y, b) - _below(j - 0.5, y, b))
                for i in range(
                    max(int(np.floor(x - a + 0.5)), 0), min(int(np.floor(x + a + 0.5)) + 1, width)
                ):
                    share = down * (_below(i + 0.5, x, a) - _below(i - 0.5, x, a))
                    if share > 0:
                        weights[j, i] += share
                        for k in range(plane.shape[2]):
                            sums[j, i, k] += share * plane[r, c, k]
