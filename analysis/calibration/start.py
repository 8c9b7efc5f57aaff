"""First guesses for the bundle adjustment: one camera at a time, in stages from few parameters to all; then the rig."""

from dataclasses import replace

import cv2
import numpy as np

from analysis.calibration.bundle import Bundle
from analysis.calibration.models import FitModel
from analysis.calibration.observations import Observations, pose, undistorted
from interchange.distortion import LensModel
from interchange.problems import BrightfieldError


def one_camera(observations: Observations, model: FitModel) -> tuple[Bundle, np.ndarray]:
    """The parameters of one camera alone. ``observations``: of one camera."""
    bundle = Bundle(observations, model)
    best, least = None, np.inf
    for focal in _focal_lengths(observations, model):
        theta = _guess(bundle, focal)
        if theta is None:
            continue
        theta, cost = bundle.solve(theta, _fixed(bundle, 0), scale=2.0, rounds=20)
        if cost < least:
            best, least = theta, cost
    if best is None:
        raise BrightfieldError(
            f"No focal length explains how the images of {observations.cameras[0]} show the board; are columns and "
            "rows, and the lens model, right?"
        )
    theta = best
    for stage in (1, 2, 3):
        theta, _ = bundle.solve(theta, _fixed(bundle, stage), scale=1.0, rounds=30)
    return bundle, theta


def _fixed(bundle: Bundle, stage: int) -> np.ndarray:
    """Stage 0 fits the focal lengths and poses; 1 two radial terms; 2 the centre and the five; 3 all."""
    fixed = np.zeros(bundle.size, bool)
    free = {0: {0, 1}, 1: {0, 1, 4, 5}, 2: {0, 1, 2, 3, 4, 5, 6, 7, 8}, 3: set(range(bundle.intrinsics))}[
        stage
    ]
    fixed[[i for i in range(bundle.intrinsics) if i not in free]] = True
    return fixed


def _focal_lengths(observations: Observations, model: FitModel) -> list[float]:
    """Zhang's from the homographies (cv2.initCameraMatrix2D), and some more, px."""
    width, height = observations.resolutions[0]
    side = max(width, height)
    shares = (0.2, 0.3, 0.45, 0.7) if model.lens is LensModel.FISHEYE else (0.5, 1.0, 2.0, 5.0, 15.0)
    points = [observations.board.points[v.ids].astype(np.float32) for v in observations.views]
    pixels = [v.pixels.astype(np.float32) for v in observations.views]
    found = [share * side for share in shares]
    try:
        K = cv2.initCameraMatrix2D(points, pixels, (width, height), 1.0)
    except cv2.error:  # a view that gives no homography; the other guesses stand
        return found
    if np.isfinite(K).all() and 0.05 * side < K[0, 0] < 100 * side:
        found.insert(0, float(K[0, 0]))
    return found


def _guess(bundle: Bundle, focal: float) -> np.ndarray | None:
    o = bundle.observations
    width, height = o.resolutions[0]
    theta = np.zeros(bundle.size)
    theta[:4] = focal, focal, (width - 1) / 2, (height - 1) / 2
    K, d = bundle.lens(theta, 0)
    for view in o.views:
        found = pose(
            o.board.points[view.ids], undistorted(view.pixels, K, d, bundle.model.lens is LensModel.FISHEYE)
        )
        if found is None:
            return None
        theta[bundle.of_moment(view.moment)] = np.concatenate(found)
    return theta


def rig(observations: Observations, model: FitModel) -> tuple[Bundle, np.ndarray]:
    """The parameters of all cameras: each alone, then linked by the moments at which two see the board."""
    if len(observations.cameras) == 1:
        return one_camera(observations, model)
    bundle = Bundle(observations, model)
    theta = np.zeros(bundle.size)
    poses: dict[tuple[int, int], np.ndarray] = {}  # camera_from_board by camera and moment
    for c, name in enumerate(observations.cameras):
        views = [v for v in observations.views if v.camera == c]
        moments = sorted({v.moment for v in views})
        own = Observations(observations.board, (name,), (observations.resolutions[c],), ()).only(
            [replace(v, camera=0) for v in views]
        )
        single, found = one_camera(own, model)
        theta[bundle.of_camera(c)] = found[single.of_camera(0)]
        for k, m in enumerate(moments):
            poses[c, m] = matrix(found[single.of_moment(k)])
    camera_from_rig = _linked(poses, observations)
    for c in range(1, len(observations.cameras)):
        theta[bundle.of_pose(c)] = vector(camera_from_rig[c])
    for m in observations.moments:
        seen = [np.linalg.inv(camera_from_rig[c]) @ T for (c, k), T in poses.items() if k == m]
        theta[bundle.of_moment(m)] = vector(seen[0])
    theta, _ = bundle.solve(theta, scale=2.0, rounds=50)
    return bundle, theta


def _linked(poses: dict[tuple[int, int], np.ndarray], o: Observations) -> dict[int, np.ndarray]:
    """camera_from_rig of every camera, from the moments that it shares with one that is linked already."""
    found = {0: np.eye(4)}
    waiting = set(range(1, len(o.cameras)))
    while waiting:
        shared = {
            (c, k): [m for m in o.moments if (c, m) in poses and (k, m) in poses]
            for c in waiting
            for k in found
        }
        (c, k), moments = max(shared.items(), key=lambda item: len(item[1]))
        if not moments:
            names = ", ".join(o.cameras[i] for i in sorted(waiting))
            raise BrightfieldError(
                f"Cameras of a rig must see the board at the same moments; {names} share none with the others."
            )
        each = [poses[c, m] @ np.linalg.inv(poses[k, m]) for m in moments]
        found[c] = _middle(each) @ found[k]
        waiting.remove(c)
    return found


def _middle(transforms: list[np.ndarray]) -> np.ndarray:
    """The one that is nearest to all others: a median that a wrong one does not move."""
    distance = [
        sum(
            float(
                np.linalg.norm((T @ np.linalg.inv(S))[:3, :3] - np.eye(3))
                + np.linalg.norm(T[:3, 3] - S[:3, 3])
            )
            for S in transforms
        )
        for T in transforms
    ]
    return transforms[int(np.argmin(distance))]


def matrix(rt: np.ndarray) -> np.ndarray:
    """(4, 4) of a rotation vector and a translation (6,)."""
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = cv2.Rodrigues(np.asarray(rt[:3], np.float64))[0], rt[3:]
    return found


def vector(T: np.ndarray) -> np.ndarray:
    """(6,) rotation vector and translation of a pose (4, 4)."""
    return np.concatenate([cv2.Rodrigues(T[:3, :3])[0].ravel(), T[:3, 3]])
