"""What a fit minimises: the sum over samples and channels of r(f, y)², f the model's value and y the measured one.

| name     | r(f, y)                       | is                                                                |
|----------|-------------------------------|-------------------------------------------------------------------|
| log      | asinh(f / 2ε) - asinh(y / 2ε) | differences of logarithms: the default without σ                  |
| relative | sign(f - y) sqrt(D(f, y))     | relative differences, without bias                                |
| mse      | f - y                         | plain squares of the BRDF, ruled by highlights and grazing angles |
| cosine   | cos θ_i (f - y)               | of the radiance under a lamp of one irradiance: Ngan et al. 2005  |
| sigma    | (f - y) / σ                   | chi squared of the file's own σ: the default where there is one   |

    D(f, y) = 2 ∫_y^f (u - y) / V(u) du,   V(u) = u² + (2ε)²,   ∂D/∂f = 2 (f - y) / V(f)

is the quasi-deviance (Wedderburn 1974) of noise that is a share of f, and constant below ε; for ε = 0 it is gamma's,
2 (y / f - 1 - ln(y / f)). At its minimum Σ (f - y) f' / V(f) = 0, whose mean is zero for the true f whatever the noise:
the weights are the fit's, never the reading's. ``log`` has the same weights for small differences, but noise of a share
s of f draws the mean of its logarithm down by s² / 2. Where it is the model that is wrong, though, D grows with y / f
and ``log`` with its logarithm's square only: a highlight that the model cannot follow pulls ``relative`` harder, and
the spheres of such fits are worse (docs/reflectance_fits.md). ``relative`` is for noisy readings of the right model.

asinh(f / 2ε) is ln(f / ε) for f far above ε and f / 2ε below, so negative readings count as they are and need no
clipping, and so they do in D. ε: the median of σ where it is known, else 5 % of the median reading (mean of its
channels): what is darker than that is mostly the instrument's own floor.
Ngan, Durand, Matusik: Experimental analysis of BRDF models. EGSR 2005.
Wedderburn: Quasi-likelihood functions, generalized linear models, and the Gauss-Newton method. Biometrika 1974.
"""

from dataclasses import dataclass, replace

import numpy as np

from interchange.problems import BrightfieldError, did_you_mean
from interchange.reflectance import ReflectanceSamples

NAMES = ("log", "relative", "mse", "cosine", "sigma")
AUTO = "auto"  # sigma where the samples have it, else log
SMALL = 3e-3  # of sqrt(V): the deviance of a smaller difference by its series, as its terms cancel


@dataclass(frozen=True, eq=False)
class Weighting:
    """``factor`` (N, 1) or (N, K); ``epsilon`` 1/sr for relative differences, 0 for plain ones; ``deviance``: by D."""

    name: str
    factor: np.ndarray
    epsilon: float = 0.0
    deviance: bool = False

    def residual(self, f: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """r(f, y) and ∂r/∂f, (N, K)."""
        if self.deviance:
            r, slope = _deviance(f, y, 2 * self.epsilon)
            return self.factor * r, self.factor * slope
        return self.of(f) - self.of(y), self.slope(f)

    def of(self, f: np.ndarray) -> np.ndarray:
        """The scale in which small differences count alike, (N, K) as ``f``."""
        return self.factor * (np.arcsinh(f / (2 * self.epsilon)) if self.epsilon else f)

    def slope(self, f: np.ndarray) -> np.ndarray:
        """∂/∂f of ``of``, and ∂r/∂f at y = f."""
        if not self.epsilon:
            return np.broadcast_to(self.factor, f.shape)
        return np.asarray(self.factor / np.sqrt(np.square(f) + 4 * self.epsilon**2))

    def frozen(self, f: np.ndarray) -> "Weighting":
        """For ``relative`` the plain differences with the same gradient Σ r ∂r/∂f at ``f``; else itself."""
        return Weighting(self.name, self.slope(f)) if self.deviance else self

    def take(self, rows: np.ndarray) -> "Weighting":
        return replace(self, factor=self.factor[rows])


def _deviance(f: np.ndarray, y: np.ndarray, a: float) -> tuple[np.ndarray, np.ndarray]:
    """sign(f - y) sqrt(D) and its derivative by f, V(u) = u² + a².

    D = (d² / V(y)) B with d = f - y:   B = 1 - 4/3 y d / V + 1/2 (3 y² - a²) d² / V² + 8/5 y (a² - y²) d³ / V³ + ...
    """
    d, v, here = f - y, np.square(y) + a * a, np.square(f) + a * a
    turn = np.arctan2(a * -d, a * a + y * f)  # atan(y / a) - atan(f / a)
    far = 2 * y / a * turn + np.log(here / v)
    t = d / np.sqrt(v)
    q, b = y / np.sqrt(v), a / np.sqrt(v)
    series = 1 - 4 / 3 * q * t + 0.5 * (3 * q * q - b * b) * t**2 + 8 / 5 * q * (b * b - q * q) * t**3
    small = np.abs(t) < SMALL
    root = np.sqrt(np.where(small, series, np.maximum(far, 0.0) / np.square(np.where(small, 1.0, t))))
    return t * root, np.sqrt(v) / (here * root)


def resolved(name: str, samples: ReflectanceSamples) -> str:
    """``name``, or what "auto" is for these samples."""
    return name if name != AUTO else "sigma" if knows_sigma(samples) else "log"


def knows_sigma(samples: ReflectanceSamples) -> bool:
    return samples.sigma is not None and bool((samples.sigma > 0).all())


def weighting_of(name: str, samples: ReflectanceSamples) -> Weighting:
    """Weights for usable samples. Raises BrightfieldError for an unknown name, and for ``sigma`` without σ."""
    ones = np.ones((len(samples), 1))
    match name:
        case "relative":
            return Weighting(name, ones, smallest(samples), deviance=True)
        case "mse":
            return Weighting(name, ones)
        case "cosine":
            return Weighting(name, samples.wi[:, 2:3].copy())
        case "log":
            return Weighting(name, ones, smallest(samples))
        case "sigma":
            if not knows_sigma(samples):
                raise BrightfieldError(
                    f"Weights by sigma need a positive standard deviation at every sample. ({samples.file})"
                )
            return Weighting(name, 1 / np.asarray(samples.sigma))
    known = ", ".join(NAMES)
    raise BrightfieldError(f'No weighting is called "{name}".{did_you_mean(name, NAMES)} There are {known}.')


def smallest(samples: ReflectanceSamples) -> float:
    """The reflectance (1/sr) below which differences count plainly instead of relatively."""
    if samples.sigma is not None and np.median(samples.sigma) > 0:
        return float(np.median(samples.sigma))
    return float(max(0.05 * np.median(np.abs(samples.f.mean(axis=1))), 1e-9))
