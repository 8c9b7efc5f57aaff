"""A change of light, lamp by lamp, of a part of an image; kept on disk."""

import os
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from analysis.gap.light.radiance import weighted
from interchange.camera import Camera

NOTHING = 1e-4  # of the largest difference: less is rounding of what was stored


@dataclass(frozen=True, eq=False)
class Change:
    """``lamps`` {name: (h, w, 3) float16} times ``scale`` is the change of radiance by each lamp as bright as rendered,
    in ``rows`` and ``columns`` of the image of ``size`` (width, height) that is enlarged to the camera's."""

    lamps: dict[str, np.ndarray]
    scale: float
    rows: slice
    columns: slice
    size: tuple[int, int]

    def radiance(self, weights: dict[str, np.ndarray], resolution: tuple[int, int]) -> np.ndarray:
        """(H, W, 3) float32 at ``resolution`` (width, height), each lamp weighted by (3,) numbers."""
        out = np.zeros((self.size[1], self.size[0], 3), np.float32)
        out[self.rows, self.columns] = self._part(weights)
        if self.size == resolution:
            return out
        return np.asarray(cv2.resize(out, resolution, interpolation=cv2.INTER_LINEAR))

    def at(
        self,
        weights: dict[str, np.ndarray],
        resolution: tuple[int, int],
        column: np.ndarray,
        row: np.ndarray,
    ) -> np.ndarray:
        """(h, w, 3) float32: the same at places (h, w) px of the image at ``resolution``."""
        part = self._part(weights)
        if not part.size:
            return np.zeros((*column.shape, 3), np.float32)
        x, y = (
            np.clip((place + 0.5) * (n / whole) - 0.5, 0, n - 1) - part_of.start
            for place, n, whole, part_of in zip(
                (column, row), self.size, resolution, (self.columns, self.rows), strict=True
            )
        )
        return np.asarray(
            cv2.remap(part, x.astype(np.float32), y.astype(np.float32), cv2.INTER_LINEAR,
                      borderMode=cv2.BORDER_CONSTANT)
        )  # fmt: skip

    def _part(self, weights: dict[str, np.ndarray]) -> np.ndarray:
        """(rows, columns, 3): what changes."""
        out = np.zeros(
            (self.rows.stop - self.rows.start, self.columns.stop - self.columns.start, 3), np.float32
        )
        for name, plane in self.lamps.items():
            weight = weights.get(name)
            if weight is not None and weight.any():
                out += weighted(plane.astype(np.float32), self.scale * weight)
        return out

    def placed(self, row: int, column: int) -> "Change":
        """The same, counted from elsewhere."""
        return replace(
            self,
            rows=slice(self.rows.start + row, self.rows.stop + row),
            columns=slice(self.columns.start + column, self.columns.stop + column),
        )


def small(camera: Camera, most: int) -> Camera:
    width, height = camera.sensor.resolution
    share = min(1.0, float(np.sqrt(most / (width * height))))
    return replace(camera.resized(max(1, round(width * share))) if share < 1 else camera, t_exp=1.0)


def difference(after: dict[str, np.ndarray], before: dict[str, np.ndarray]) -> Change:
    lamps = {name: plane - before[name] for name, plane in after.items() if name in before}
    most = max((float(np.abs(d).max()) for d in lamps.values()), default=0.0)
    rows = columns = slice(0, 0)
    if most > 0:
        seen = np.max([np.abs(d).max(axis=2) for d in lamps.values()], axis=0) > NOTHING * most
        v, u = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
        rows, columns = slice(int(v[0]), int(v[-1]) + 1), slice(int(u[0]), int(u[-1]) + 1)
    scale = most or 1.0
    kept = {
        n: (d[rows, columns] / scale).astype(np.float16)
        for n, d in lamps.items()
        if np.abs(d).max() > NOTHING * scale
    }
    height, width = next(iter(before.values())).shape[:2] if before else (1, 1)
    return Change(kept, scale, rows, columns, (width, height))


def write(file: Path, change: Change) -> None:
    place = [change.rows.start, change.rows.stop, change.columns.start, change.columns.stop, *change.size]
    beside = file.with_name(f".{file.stem}.{os.getpid()}.npz")
    lamps = {f"lamp:{name}": plane for name, plane in change.lamps.items()}
    np.savez(beside, place=np.array(place), scale=np.array(change.scale), **lamps)
    os.replace(beside, file)


def read(file: Path) -> Change:
    with np.load(file) as stored:
        a, b, c, d, w, h = (int(x) for x in stored["place"])
        lamps = {n.removeprefix("lamp:"): stored[n] for n in stored.files if n.startswith("lamp:")}
        return Change(lamps, float(stored["scale"]), slice(a, b), slice(c, d), (w, h))
