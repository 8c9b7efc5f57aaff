"""How well a calibrated camera knows where a point is imaged: the covariance of a projection over the field.

A point fixed to the boards, seen at pixel q at distance z, is projected anew by cameras drawn from Σ: cameras whose
lens and whose poses against the boards both differ. So what is taken for the world is the mean of all board poses, and
an error of the lens that a turn of the camera undoes does not count. Linearised:

    dq = ∂q/∂lens dlens + ∂q/∂p · mean_m( d(T_m) T_m⁻¹ p ),      Cov(q) = G Σ Gᵀ

Kogan: mrcal, projection uncertainty (the mean-frames method).
"""

from dataclasses import dataclass

import cv2
import numpy as np

from analysis.calibration.calibration import Calibration


@dataclass(frozen=True, eq=False)
class Field:
    """Values over a camera's field. ``pixels`` (h, w, 2); ``covariance`` (h, w, 2, 2) px², NaN where no ray is."""

    pixels: np.ndarray
    covariance: np.ndarray
    distance: float

    @property
    def sigma(self) -> np.ndarray:
        """(h, w) px: standard deviation along the worse direction."""
        c = self.covariance
        mean, half = (c[..., 0, 0] + c[..., 1, 1]) / 2, (c[..., 0, 0] - c[..., 1, 1]) / 2
        return np.asarray(np.sqrt(mean + np.hypot(half, c[..., 0, 1])))

    @property
    def rms(self) -> np.ndarray:
        """(h, w) px: root mean square length of the error."""
        return np.asarray(np.sqrt(self.covariance[..., 0, 0] + self.covariance[..., 1, 1]))


def grid(resolution: tuple[int, int], columns: int = 32) -> np.ndarray:
    """(h, w, 2) pixels spread evenly over an image, its edges included."""
    width, height = resolution
    rows = max(2, round(columns * height / width))
    x, y = np.linspace(0, width - 1, columns), np.linspace(0, height - 1, rows)
    return np.stack(np.meshgrid(x, y), axis=-1)


def projection_uncertainty(
    calibration: Calibration, c: int = 0, pixels: np.ndarray | None = None, distance: float | None = None
) -> Field:
    """``distance`` m from the camera, inf for far away; without it, where the boards were. ``pixels``: (h, w, 2)."""
    pixels = grid(calibration.observations.resolutions[c]) if pixels is None else pixels
    distance = calibration.distance if distance is None else distance
    flat = pixels.reshape(-1, 2)
    _, ray = calibration.camera(c).rays(flat)
    ray = (
        ray @ np.linalg.inv(calibration.camera(c).world_from_camera)[:3, :3].T
    )  # back to the camera's own axes
    seen = np.isfinite(ray).all(axis=-1)
    G = gradient(calibration, c, np.where(seen[:, None], ray, [0, 0, 1.0]), distance)
    half = (G.reshape(-1, G.shape[-1]) @ calibration.covariance).reshape(G.shape)
    covariance = np.einsum("nip,njp->nij", half, G)
    covariance[~seen] = np.nan
    return Field(pixels, covariance.reshape(*pixels.shape[:-1], 2, 2), float(distance))


def gradient(calibration: Calibration, c: int, ray: np.ndarray, distance: float) -> np.ndarray:
    """(n, 2, P): what the projections of points along unit rays (n, 3) of camera ``c`` change by with θ."""
    bundle, theta = calibration.bundle, calibration.theta
    far = not np.isfinite(distance)
    p = ray if far else ray * distance
    _, lens, place = bundle.project(theta, c, p, np.zeros(3), np.zeros(3))
    by_point = place[..., 3:]  # ∂q/∂p
    G = np.zeros((len(ray), 2, bundle.size))
    G[..., bundle.of_camera(c)] = lens
    moments = sorted({v.moment for v in calibration.observations.views if v.camera == c and v.used.any()})
    for m in moments:
        r, t, chain = bundle.composed(theta, c, m)
        R, dR = cv2.Rodrigues(np.asarray(r, np.float64))
        body = (p if far else p - t) @ R  # the point in the board's frame; a direction if far
        turn = np.stack([body @ dR[k].reshape(3, 3).T for k in range(3)], axis=-1)  # (n, 3, 3): dp by r
        shift = np.zeros((len(ray), 3, 3)) if far else np.broadcast_to(np.eye(3), (len(ray), 3, 3))
        moved = np.concatenate([turn, shift], axis=-1) @ chain  # (n, 3, 12)
        dq = by_point @ moved / len(moments)
        G[..., bundle.of_moment(m)] += dq[..., :6]
        if c:
            G[..., bundle.of_pose(c)] += dq[..., 6:]
    return G
