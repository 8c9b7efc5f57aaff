"""The bundle adjustment: cameras, their poses on the rig and the board's poses from where its points were seen.

    q = project_c( T_c T_m X ) + noise        min over θ of Σ |q_seen - q|²

θ holds, a camera: fx, fy, cx, cy and the free coefficients; a camera after the first: its pose T_c = camera_from_rig
as rotation vector and metres (the first camera is the rig); a moment: the board's pose T_m = rig_from_board. Jacobians
are analytic (OpenCV's). Solved by Levenberg and Marquardt's method on normal equations with scaled columns.

Triggs and others: Bundle adjustment, a modern synthesis. 1999.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from scipy.linalg import cho_factor, cho_solve

from analysis.calibration.models import FitModel
from analysis.calibration.observations import Observations, View
from interchange.distortion import LensModel

HUBER = 1.5  # scales of the residuals beyond which they count linearly, in the robust rounds


@dataclass(frozen=True, eq=False)
class Bundle:
    """What is to be found, and where it stands in θ."""

    observations: Observations
    model: FitModel

    @cached_property
    def points(self) -> np.ndarray:
        """(N, 3) m, of the board."""
        return self.observations.board.points

    @cached_property
    def intrinsics(self) -> int:
        return len(self.model.names)

    @property
    def size(self) -> int:
        o = self.observations
        return self.intrinsics * len(o.cameras) + 6 * (len(o.cameras) - 1) + 6 * len(o.moments)

    def of_camera(self, c: int) -> np.ndarray:
        return np.arange(self.intrinsics) + c * self.intrinsics

    def of_pose(self, c: int) -> np.ndarray:
        """Of camera_from_rig; the first camera has none."""
        start = self.intrinsics * len(self.observations.cameras)
        return np.arange(6) + start + 6 * (c - 1) if c else np.zeros(0, int)

    def of_moment(self, m: int) -> np.ndarray:
        cameras = len(self.observations.cameras)
        return np.arange(6) + self.intrinsics * cameras + 6 * (cameras - 1) + 6 * m

    def names(self) -> list[str]:
        """One a parameter: ``left.fx``, ``right.pose.t_x``, ``moment 3.r_y``."""
        o = self.observations
        found = [f"{c}.{n}" for c in o.cameras for n in self.model.names]
        axes = ("r_x", "r_y", "r_z", "t_x", "t_y", "t_z")
        found += [f"{c}.pose.{a}" for c in o.cameras[1:] for a in axes]
        return found + [f"moment {m}.{a}" for m in range(len(o.moments)) for a in axes]

    def lens(self, theta: np.ndarray, c: int) -> tuple[np.ndarray, np.ndarray]:
        """K (3, 3) and all of OpenCV's coefficients."""
        own = theta[self.of_camera(c)]
        d = np.zeros(self.model.coefficients)
        d[list(self.model.free)] = own[4:]
        return np.array([[own[0], 0, own[2]], [0, own[1], own[3]], [0, 0, 1]]), d

    def composed(self, theta: np.ndarray, c: int, m: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """camera_from_board as rvec, tvec and its Jacobian (6, 12) by the moment's pose, then the camera's."""
        board = theta[self.of_moment(m)]
        if c == 0:
            return board[:3], board[3:], np.hstack([np.eye(6), np.zeros((6, 6))])
        own = theta[self.of_pose(c)]
        r, t, *parts = cv2.composeRT(board[:3], board[3:], own[:3], own[3:])
        rr1, rt1, rr2, rt2, tr1, tt1, tr2, tt2 = parts
        return (
            r.ravel(),
            t.ravel(),
            np.vstack([np.hstack([rr1, rt1, rr2, rt2]), np.hstack([tr1, tt1, tr2, tt2])]),
        )

    def project(
        self, theta: np.ndarray, c: int, points: np.ndarray, r: np.ndarray, t: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Pixels (n, 2) of points (n, 3), and Jacobians by the camera's parameters (n, 2, k) and by r, t (n, 2, 6)."""
        K, d = self.lens(theta, c)
        free = list(self.model.free)
        if self.model.lens is LensModel.FISHEYE:
            q, J = cv2.fisheye.projectPoints(points[:, None], r, t, K, d)
            J = J.reshape(len(points), 2, -1)
            lens, place = J[..., [0, 1, 2, 3, *(4 + i for i in free)]], J[..., 8:14]
        else:
            q, J = cv2.projectPoints(points, r, t, K, d)
            J = J.reshape(len(points), 2, -1)
            lens, place = J[..., [6, 7, 8, 9, *(10 + i for i in free)]], J[..., :6]
        return q.reshape(-1, 2), lens, place

    def of_view(self, theta: np.ndarray, view: View) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Residuals (n, 2) seen minus projected, Jacobian (2n, k) of the projection, and its columns' places in θ."""
        points = self.points[view.ids]
        r, t, chain = self.composed(theta, view.camera, view.moment)
        q, lens, place = self.project(theta, view.camera, points, r, t)
        by_pose = place.reshape(-1, 6) @ chain
        columns = [self.of_camera(view.camera), self.of_moment(view.moment), self.of_pose(view.camera)]
        J = np.hstack([lens.reshape(2 * len(points), -1), by_pose[:, : 12 if view.camera else 6]])
        return view.pixels - q, J, np.concatenate(columns)

    def residuals(self, theta: np.ndarray) -> list[np.ndarray]:
        """Seen minus projected, px, (n, 2) a view; outliers too."""
        return [self.of_view(theta, v)[0] for v in self.observations.views]

    def normal(self, theta: np.ndarray, scale: float | None = None) -> tuple[np.ndarray, np.ndarray, float]:
        """JᵀWJ, JᵀWr and the cost over the points in use. ``scale`` px: Huber's weights, None for ones."""
        H, g, cost = np.zeros((self.size, self.size)), np.zeros(self.size), 0.0
        for view in self.observations.views:
            error, J, columns = self.of_view(theta, view)
            error, J = error[view.used], J.reshape(len(view.ids), 2, -1)[view.used]
            length = np.linalg.norm(error, axis=-1)
            if not np.isfinite(length).all():
                return H, g, np.inf
            weight = np.ones(len(error))
            if scale is None:
                cost += float((length**2).sum())
            else:
                bound = HUBER * scale
                weight = np.minimum(1, bound / np.maximum(length, 1e-30))
                cost += float(np.where(length < bound, length**2, 2 * bound * length - bound**2).sum())
            A = (J * np.sqrt(weight)[:, None, None]).reshape(-1, J.shape[-1])
            b = (error * np.sqrt(weight)[:, None]).ravel()
            H[np.ix_(columns, columns)] += A.T @ A
            g[columns] += A.T @ b
        return H, g, cost

    def solve(
        self,
        theta: np.ndarray,
        fixed: np.ndarray | None = None,
        scale: float | None = None,
        rounds: int = 100,
    ) -> tuple[np.ndarray, float]:
        """θ at the least cost near ``theta``, and that cost. ``fixed``: (size,) bool, parameters that stay."""
        free = np.ones(self.size, bool) if fixed is None else ~fixed
        damping = 1e-3
        H, g, cost = self.normal(theta, scale)
        for _ in range(rounds):
            part = H[np.ix_(free, free)]
            size = np.sqrt(np.maximum(np.diag(part), 1e-30))
            A = part / np.outer(size, size)
            try:
                factor = cho_factor(A + damping * np.eye(len(A)))
            except np.linalg.LinAlgError:
                damping *= 10
                continue
            step = np.zeros(self.size)
            step[free] = cho_solve(factor, g[free] / size) / size
            new = theta + step
            H_new, g_new, cost_new = self.normal(new, scale)
            if cost_new <= cost:
                gain = cost - cost_new
                theta, H, g, cost = new, H_new, g_new, cost_new
                damping = max(damping / 10, 1e-15)
                if gain <= 1e-13 * cost or cost < 1e-20:
                    break
            else:
                damping *= 10
                if damping > 1e12:
                    break
        return theta, cost

    def with_used(self, used: list[np.ndarray]) -> "Bundle":
        views = tuple(replace(v, used=u) for v, u in zip(self.observations.views, used, strict=True))
        return replace(self, observations=replace(self.observations, views=views))

    def with_pixels(self, pixels: list[np.ndarray]) -> "Bundle":
        views = tuple(replace(v, pixels=p) for v, p in zip(self.observations.views, pixels, strict=True))
        return replace(self, observations=replace(self.observations, views=views))
