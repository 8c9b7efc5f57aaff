"""Calibrate cameras: the bundle adjustment without its outliers, and the covariance of all that it found.

Outliers are points whose residual could not come from the noise of the others: |r| > σ sqrt(2 ln(N / 0.01)), a length
that of N points with Gaussian noise one passes in one calibration of a hundred. σ is the residuals' median over 1.177
(Rayleigh), so outliers do not raise it. They are taken out and told by image and number.

    Σ = σ² (JᵀJ)⁻¹      σ² = Σ|r|² / (2 N - parameters)
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np

from analysis.calibration.boards.base import Board
from analysis.calibration.bundle import Bundle
from analysis.calibration.models import FitModel, model_named
from analysis.calibration.observations import LEAST_POINTS, Observations, observe
from analysis.calibration.start import matrix, rig
from interchange.camera import Camera, Lens, Sensor
from interchange.problems import BrightfieldError

ROUNDS = 10  # of taking outliers out
FALSE_ALARMS = 0.01  # calibrations of pure noise in which a point is called an outlier
MOST_OUTLIERS = 0.25  # of all points


@dataclass(frozen=True, eq=False)
class Outlier:
    image: str
    point: int  # number on the board
    pixel: tuple[float, float]
    residual: float  # px


@dataclass(frozen=True, eq=False)
class Calibration:
    """``theta`` (P,) and ``covariance`` (P, P) of ``bundle``'s parameters; ``sigma`` px, noise of one coordinate of a
    point. ``loose`` (P,) bool: parameters that the images do not tell apart; the covariance leaves out the directions
    in which they can be moved without a change of what is seen."""

    bundle: Bundle
    theta: np.ndarray
    covariance: np.ndarray
    sigma: float
    loose: np.ndarray

    @property
    def observations(self) -> Observations:
        return self.bundle.observations

    @property
    def model(self) -> FitModel:
        return self.bundle.model

    @cached_property
    def residuals(self) -> list[np.ndarray]:
        """Seen minus projected, px, (n, 2) a view; outliers too."""
        return self.bundle.residuals(self.theta)

    @property
    def used_points(self) -> int:
        return sum(int(v.used.sum()) for v in self.observations.views)

    @property
    def rms(self) -> float:
        """Root mean square length of the residuals of the points in use, px."""
        squares = sum(
            float((r[v.used] ** 2).sum())
            for r, v in zip(self.residuals, self.observations.views, strict=True)
        )
        return float(np.sqrt(squares / self.used_points))

    @property
    def outliers(self) -> list[Outlier]:
        """The worst first."""
        found = [
            Outlier(v.image, int(v.ids[i]), (float(v.pixels[i, 0]), float(v.pixels[i, 1])), float(length[i]))
            for v, length in zip(
                self.observations.views, (np.linalg.norm(r, axis=-1) for r in self.residuals), strict=True
            )
            for i in np.nonzero(~v.used)[0]
        ]
        return sorted(found, key=lambda o: -o.residual)

    @property
    def undetermined(self) -> list[str]:
        names = self.bundle.names()
        return [names[i] for i in np.nonzero(self.loose)[0]]

    def parameters(self, c: int) -> list[tuple[str, float, float]]:
        """Name, value and σ (infinite where loose) of a camera's parameters; px and 1. Pose on the rig: rad and m."""
        places = [*self.bundle.of_camera(c), *self.bundle.of_pose(c)]
        names = [*self.model.names, *(("r_x", "r_y", "r_z", "t_x", "t_y", "t_z") if c else ())]
        sigma = np.where(self.loose, np.inf, np.sqrt(np.diag(self.covariance)))
        return [(n, float(self.theta[i]), float(sigma[i])) for n, i in zip(names, places, strict=True)]

    @property
    def distance(self) -> float:
        """m: the median distance at which the boards were seen."""
        depth = []
        for view in self.observations.views:
            r, t, _ = self.bundle.composed(self.theta, view.camera, view.moment)
            points = self.observations.board.points[view.ids] @ cv2.Rodrigues(r)[0].T + t
            depth += list(np.linalg.norm(points, axis=-1))
        return float(np.median(depth))

    def camera_from_board(self, c: int, m: int) -> np.ndarray:
        """(4, 4)."""
        r, t, _ = self.bundle.composed(self.theta, c, m)
        return matrix(np.concatenate([r, t]))

    def rig_from_board(self, m: int) -> np.ndarray:
        """(4, 4); the rig's frame is the first camera's."""
        return matrix(self.theta[self.bundle.of_moment(m)])

    def camera(
        self, c: int, world_from_rig: np.ndarray | None = None, pixel_pitch: float = 3.45e-6
    ) -> Camera:
        """The camera. ``world_from_rig``: without it the first camera is the world. ``pixel_pitch`` m: of a column;
        images tell focal lengths in pixels alone."""
        K, d = self.bundle.lens(self.theta, c)
        camera_from_rig = matrix(self.theta[self.bundle.of_pose(c)]) if c else np.eye(4)
        world = np.eye(4) if world_from_rig is None else world_from_rig
        focal = float(K[0, 0]) * pixel_pitch
        return Camera(
            name=self.observations.cameras[c],
            world_from_camera=world @ np.linalg.inv(camera_from_rig),
            lens=Lens(focal_length=focal, distortion=tuple(d), model=self.model.lens),
            sensor=Sensor(self.observations.resolutions[c], (pixel_pitch, focal / float(K[1, 1]))),
            principal_point=(float(K[0, 2]), float(K[1, 2])),
        )


def calibrate(observations: Observations, model: FitModel, start: np.ndarray | None = None) -> Calibration:
    """Fit ``model`` to what was seen. ``start``: θ to begin from, for a part of images that are calibrated already."""
    bundle = Bundle(observations, model)
    equations = 2 * sum(len(v.ids) for v in observations.views)
    if equations < 1.5 * bundle.size:
        raise BrightfieldError(
            f"The points must be more than what is to be found; {equations // 2} points in "
            f"{len(observations.views)} images are too few for {bundle.size} parameters."
        )
    theta = start
    if theta is None:
        bundle, theta = rig(observations, model)
    seen = [v.pixels for v in observations.views]
    for _ in range(3 if observations.board.radius else 1):
        if observations.board.radius:
            bundle = bundle.with_pixels(
                [p - shift for p, shift in zip(seen, _centroid_shifts(bundle, theta), strict=True)]
            )
        bundle, theta = _without_outliers(bundle, theta)
    H, _, cost = bundle.normal(theta)
    count = 2 * sum(int(v.used.sum()) for v in bundle.observations.views)
    sigma = float(np.sqrt(cost / max(count - bundle.size, 1)))
    inverse, loose = _inverse(H)
    return Calibration(bundle, theta, sigma**2 * inverse, sigma, loose)


def calibrate_images(cameras: dict[str, Sequence[Path]], board: Board, model: str = "5") -> Calibration:
    """Find ``board`` in the images of each camera and calibrate: lens model, poses, covariance, outliers."""
    return calibrate(observe(cameras, board), model_named(model))


def _without_outliers(bundle: Bundle, theta: np.ndarray) -> tuple[Bundle, np.ndarray]:
    views = bundle.observations.views
    total = sum(len(v.ids) for v in views)
    cut = float(np.sqrt(2 * np.log(total / FALSE_ALARMS)))
    lengths = [np.linalg.norm(r, axis=-1) for r in bundle.residuals(theta)]
    scale = max(float(np.median(np.concatenate(lengths))) / 1.1774, 1e-9)
    theta, _ = bundle.solve(theta, scale=scale)
    for _ in range(ROUNDS):
        lengths = [np.linalg.norm(r, axis=-1) for r in bundle.residuals(theta)]
        scale = max(float(np.median(np.concatenate(lengths))) / 1.1774, 1e-9)
        used = [x <= cut * scale for x in lengths]
        used = [u if u.sum() >= LEAST_POINTS else np.zeros_like(u) for u in used]
        lost = 1 - sum(int(u.sum()) for u in used) / total
        if lost > MOST_OUTLIERS:
            raise BrightfieldError(
                f"A calibration must explain most points; {100 * lost:.0f} % of them lie more than {cut:.1f} σ "
                f"({cut * scale:.2f} px) off. Are the board's numbers and the lens model right?"
            )
        same = all(np.array_equal(u, v.used) for u, v in zip(used, bundle.observations.views, strict=True))
        bundle = bundle.with_used(used)
        empty = _unseen(bundle)
        theta, _ = bundle.solve(theta, fixed=empty)
        if same:
            break
    return bundle, theta


def _unseen(bundle: Bundle) -> np.ndarray:
    """(P,) bool: poses of moments of which no point is left."""
    fixed = np.zeros(bundle.size, bool)
    left = {v.moment for v in bundle.observations.views if v.used.any()}
    for m in bundle.observations.moments:
        if m not in left:
            fixed[bundle.of_moment(m)] = True
    return fixed


def _inverse(H: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """H⁻¹ without the directions that H does not fix, and (P,) bool which parameters have a part in those."""
    size = np.sqrt(np.diag(H))
    seen = size > 0
    scaled = H[np.ix_(seen, seen)] / np.outer(size[seen], size[seen])
    values, vectors = np.linalg.eigh(scaled)
    flat = values < 1e-14 * values[-1]
    inverse = (vectors[:, ~flat] / values[~flat]) @ vectors[:, ~flat].T
    found = np.zeros_like(H)
    found[np.ix_(seen, seen)] = inverse / np.outer(size[seen], size[seen])
    loose = ~seen
    loose[seen] = (vectors[:, flat] ** 2).sum(axis=1) > 1e-3
    return found, loose


def _centroid_shifts(bundle: Bundle, theta: np.ndarray) -> list[np.ndarray]:
    """(n, 2) a view: centroid of each disc's image minus the image of its centre, px."""
    board = bundle.observations.board
    around = np.arange(48) * (2 * np.pi / 48)
    rim = board.radius * np.stack([np.cos(around), np.sin(around), np.zeros(48)], axis=-1)
    found = []
    for view in bundle.observations.views:
        r, t, _ = bundle.composed(theta, view.camera, view.moment)
        centre = board.points[view.ids]
        middle = bundle.project(theta, view.camera, centre, r, t)[0]
        edge = bundle.project(theta, view.camera, (centre[:, None] + rim).reshape(-1, 3), r, t)[0]
        p = edge.reshape(len(centre), 48, 2) - middle[:, None]
        q = np.roll(p, -1, axis=1)
        cross = p[..., 0] * q[..., 1] - q[..., 0] * p[..., 1]
        found.append(((p + q) * cross[..., None]).sum(1) / (3 * cross.sum(1))[:, None])
    return found
