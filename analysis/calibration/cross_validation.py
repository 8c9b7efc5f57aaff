"""Two halves of the images must agree: their difference is what they do not know, or what the model does not say.

Each half is calibrated alone. Where half A sees a pixel, half B looks at the same point; before, B is moved as a rigid
body to where it fits best, weighted by what is known, for the two halves' worlds are not one. Differences as large as
the uncertainty predicts confirm it; larger ones are a model that is too simple, a board that is not flat, or blur.

Kogan: mrcal, cross-validation. A χ² of the differences, by the covariance that the uncertainty predicts for them, says
how probable they are.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import chi2

from analysis.calibration.calibration import Calibration, calibrate
from analysis.calibration.start import matrix
from analysis.calibration.uncertainty import gradient, grid, projection_uncertainty
from interchange.problems import BrightfieldError

AGREES = 0.01  # probability of a larger χ², below which halves are said to disagree
POINTS = 10  # along a side of the image, of those that are tested
EXPLAINED = 0.99  # share of the covariance that is tested


@dataclass(frozen=True, eq=False)
class CrossValidation:
    """Of one camera. ``pixels`` (h, w, 2); ``difference`` (h, w, 2) px; ``expected`` (h, w) px, the rms length that the
    halves' uncertainties predict; ``covered`` (h, w) bool, within the field that boards were seen in."""

    pixels: np.ndarray
    difference: np.ndarray
    expected: np.ndarray
    covered: np.ndarray
    chi2: float
    degrees: int
    halves: tuple[Calibration, Calibration]

    @property
    def probability(self) -> float:
        """Of a χ² as large or larger by noise alone."""
        return float(chi2.sf(self.chi2, self.degrees))

    @property
    def ratio(self) -> float:
        """rms over the covered field of difference over expected: about 1 or less where the halves agree."""
        share = np.linalg.norm(self.difference, axis=-1) / self.expected
        return float(np.sqrt(np.nanmean(share[self.covered] ** 2)))

    @property
    def rms(self) -> float:
        """px: of the difference over the covered field."""
        return float(np.sqrt(np.nanmean((self.difference[self.covered] ** 2).sum(-1))))

    @property
    def agrees(self) -> bool:
        return self.probability >= AGREES


def cross_validate(calibration: Calibration, c: int = 0) -> CrossValidation:
    """Every other moment against the rest. Raises BrightfieldError where a half has fewer than three images."""
    halves = split(calibration)
    pixels = grid(calibration.observations.resolutions[c])
    distance = calibration.distance
    own = [projection_uncertainty(h, c, pixels, distance) for h in halves]
    expected = np.sqrt(own[0].rms ** 2 + own[1].rms ** 2)
    difference = projection_difference(*halves, c, pixels, distance, 1 / expected)
    seen = covered(calibration, c, pixels)
    some = np.zeros_like(seen)
    some[:: max(1, len(seen) // POINTS), :: max(1, seen.shape[1] // POINTS)] = True
    some &= seen & np.isfinite(difference).all(-1)
    statistic, degrees = significance(
        *halves, c, pixels[some], difference[some], 1 / expected[some], distance
    )
    return CrossValidation(pixels, difference, expected, seen, statistic, degrees, halves)


def significance(
    a: Calibration,
    b: Calibration,
    c: int,
    pixels: np.ndarray,
    difference: np.ndarray,
    weights: np.ndarray,
    distance: float,
) -> tuple[float, int]:
    """χ² of differences (n, 2) px at pixels (n, 2), and its degrees of freedom.

    The differences' covariance, less what a rigid motion takes away, has few directions of any size: as many as
    explain ``EXPLAINED`` of it are tested. So numbers of a lens that trade with each other count by what they do.
    """
    C = 0.0
    for half in (a, b):
        G = gradient(half, c, _own_rays(half, c, pixels), distance).reshape(2 * len(pixels), -1)
        C = C + G @ half.covariance @ G.T
    _, _, motion = a.bundle.project(a.theta, c, distance * _own_rays(a, c, pixels), np.zeros(3), np.zeros(3))
    J, w = motion.reshape(-1, 6), np.repeat(weights, 2)[:, None]
    rest = np.eye(len(J)) - J @ np.linalg.pinv(J * w) * w.T
    values, vectors = np.linalg.eigh(rest @ C @ rest.T)
    values, vectors = values[::-1], vectors[:, ::-1]
    count = int(np.searchsorted(np.cumsum(values) / values.sum(), EXPLAINED)) + 1
    along = vectors[:, :count].T @ (rest @ difference.ravel())
    return float((along**2 / values[:count]).sum()), count


def _own_rays(calibration: Calibration, c: int, pixels: np.ndarray) -> np.ndarray:
    """(n, 3) unit, in the camera's own frame."""
    camera = calibration.camera(c)
    return np.asarray(camera.rays(pixels)[1] @ camera.world_from_camera[:3, :3])


def split(calibration: Calibration) -> tuple[Calibration, Calibration]:
    """Calibrations of the even and of the odd moments."""
    o, bundle = calibration.observations, calibration.bundle
    found = []
    for half in (0, 1):
        views = [v for v in o.views if v.moment % 2 == half]
        for c, name in enumerate(o.cameras):
            count = sum(v.camera == c for v in views)
            if count < 3:
                raise BrightfieldError(
                    f"Cross-validation needs three images or more in each half; {name} has {count}."
                )
        moments = sorted({v.moment for v in views})
        lenses = np.arange(bundle.size - 6 * len(o.moments))
        start = np.concatenate(
            [calibration.theta[lenses], *(calibration.theta[bundle.of_moment(m)] for m in moments)]
        )
        found.append(calibrate(o.only(views), calibration.model, start))
    return found[0], found[1]


def projection_difference(
    a: Calibration, b: Calibration, c: int, pixels: np.ndarray, distance: float, weights: np.ndarray
) -> np.ndarray:
    """(h, w, 2) px: where ``b`` sees the points that ``a`` sees at ``pixels`` at ``distance`` m, minus ``pixels``,
    after the rigid motion between the two that makes it least, with ``weights`` (h, w)."""
    flat, w = pixels.reshape(-1, 2), weights.reshape(-1)
    ray = _own_rays(a, c, flat)
    good = np.isfinite(ray).all(axis=-1) & np.isfinite(w)
    points = ray[good] * (distance if np.isfinite(distance) else 1.0)

    def off(motion: np.ndarray) -> np.ndarray:
        T = matrix(np.append(motion[:3], motion[3:] if np.isfinite(distance) else np.zeros(3)))
        moved = points @ T[:3, :3].T + T[:3, 3]
        return b.bundle.project(b.theta, c, moved, np.zeros(3), np.zeros(3))[0] - flat[good]

    count = 6 if np.isfinite(distance) else 3
    scale = np.full(count, 1.0)
    scale[3:] = distance if np.isfinite(distance) else 1.0
    fit = least_squares(lambda m: (off(m) * w[good, None]).ravel(), np.zeros(count), x_scale=1e-3 * scale)
    found = np.full(flat.shape, np.nan)
    found[good] = off(fit.x)
    return found.reshape(pixels.shape)


def covered(calibration: Calibration, c: int, pixels: np.ndarray) -> np.ndarray:
    """(h, w) bool: inside the convex hull of the points seen."""
    from scipy.spatial import Delaunay

    seen = np.concatenate([v.pixels[v.used] for v in calibration.observations.views if v.camera == c])
    return np.asarray(Delaunay(seen).find_simplex(pixels.reshape(-1, 2)) >= 0).reshape(pixels.shape[:-1])
