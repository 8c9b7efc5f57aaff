"""What was seen: in every image the board's points, and which camera took it at which moment."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from analysis.calibration.boards.base import Board
from interchange.formats import images
from interchange.problems import BrightfieldError

LEAST_POINTS = 6


@dataclass(frozen=True, eq=False)
class View:
    """One image. ``ids`` (n,) numbers of the board's points, ``pixels`` (n, 2); ``used`` (n,) False for outliers."""

    image: str
    camera: int
    moment: int
    ids: np.ndarray
    pixels: np.ndarray
    used: np.ndarray


@dataclass(frozen=True, eq=False)
class Observations:
    """``resolutions``: (width, height) px a camera; ``missed``: images in which the board was not found."""

    board: Board
    cameras: tuple[str, ...]
    resolutions: tuple[tuple[int, int], ...]
    views: tuple[View, ...]
    missed: tuple[str, ...] = ()

    @property
    def moments(self) -> tuple[int, ...]:
        return tuple(sorted({v.moment for v in self.views}))

    def only(self, views: Sequence[View]) -> "Observations":
        """The same cameras with other views, their moments counted anew."""
        new = {m: i for i, m in enumerate(sorted({v.moment for v in views}))}
        return replace(self, views=tuple(replace(v, moment=new[v.moment]) for v in views))


def grey(path: Path | str) -> np.ndarray:
    """(H, W) uint8 of an image file. 16 bits are brought to 8 by the image's own highest value."""
    array = images.load(path).array.astype(np.float64)
    flat = array[..., :3].mean(axis=-1) if array.shape[2] >= 3 else array[..., 0]
    if array.max() > 255 or array.dtype.kind == "f":
        flat = flat * (255 / max(float(flat.max()), 1e-12))
    return np.rint(np.clip(flat, 0, 255)).astype(np.uint8)


def observe(cameras: dict[str, Sequence[Path]], board: Board) -> Observations:
    """Find the board in every image. With several cameras, images of one moment have the same number in their names,
    or, where names have none, the same place in their lists. Raises BrightfieldError where too little is found."""
    moments = _moments(cameras)
    views: list[View] = []
    missed: list[str] = []
    resolutions = []
    for c, (name, paths) in enumerate(cameras.items()):
        sizes = {}
        for path in paths:
            image = grey(path)
            sizes[image.shape[1], image.shape[0]] = path
            found = board.detect(image)
            if found is None or len(found.ids) < LEAST_POINTS:
                missed.append(str(path))
                continue
            views.append(
                View(str(path), c, moments[path], found.ids, found.pixels, np.ones(len(found.ids), bool))
            )
        if len(sizes) != 1:
            told = ", ".join(f"{w} x {h} px ({p.name})" for (w, h), p in sizes.items())
            raise BrightfieldError(f"Images of one camera must have one size; {name} has {told}.")
        resolutions.append(next(iter(sizes)))
    observations = Observations(board, tuple(cameras), tuple(resolutions), tuple(views), tuple(missed))
    for c, name in enumerate(cameras):
        count = sum(v.camera == c for v in views)
        if count < 3:
            total = len(cameras[name])
            raise BrightfieldError(
                f"A calibration needs the board in three images or more of each camera; {name} shows the "
                f"{board.columns} x {board.rows} {board.name} ({board.counts}) in {count} of {total}."
            )
    return observations.only(views)


def _moments(cameras: dict[str, Sequence[Path]]) -> dict[Path, int]:
    if len(cameras) == 1:
        return {p: i for i, p in enumerate(next(iter(cameras.values())))}
    numbers = {p: re.findall(r"\d+", p.stem) for paths in cameras.values() for p in paths}
    if all(numbers.values()):
        keys = {p: int(n[-1]) for p, n in numbers.items()}
        for name, paths in cameras.items():
            if len({keys[p] for p in paths}) < len(paths):
                raise BrightfieldError(
                    f"Images of one moment are told by the last number in their names; {name} has one twice."
                )
        return keys
    counts = {name: len(paths) for name, paths in cameras.items()}
    if len(set(counts.values())) > 1:
        raise BrightfieldError(
            f"Images without numbers in their names are matched by their order, so every camera must have as many; "
            f"got {', '.join(f'{n} with {k}' for n, k in counts.items())}."
        )
    return {p: i for paths in cameras.values() for i, p in enumerate(paths)}


def undistorted(pixels: np.ndarray, K: np.ndarray, d: np.ndarray, fisheye: bool) -> np.ndarray:
    """Normalised coordinates (n, 2) of pixels; NaN where there is no ray."""
    from interchange.distortion import LensModel, undistort

    model = LensModel.FISHEYE if fisheye else LensModel.OPENCV
    x, y = (pixels[:, 0] - K[0, 2]) / K[0, 0], (pixels[:, 1] - K[1, 2]) / K[1, 1]
    return np.stack(undistort(x, y, tuple(d), model), axis=-1)


def pose(points: np.ndarray, normalised: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """rvec, tvec of a plane from normalised image points; None where they do not fix one.

    Collins, Bartoli: Infinitesimal plane-based pose estimation. IJCV 2014 (SOLVEPNP_IPPE).
    """
    good = np.isfinite(normalised).all(axis=-1)
    if good.sum() < 4:
        return None
    try:
        ok, r, t = cv2.solvePnP(
            points[good], normalised[good], np.eye(3), np.zeros(4), flags=cv2.SOLVEPNP_IPPE
        )
    except cv2.error:
        return None
    return (r.ravel(), t.ravel()) if ok and np.isfinite(r).all() and t.ravel()[2] > 0 else None
