"""What a fit minimises: the sum over samples and channels of (w (g(f) - g(f_measured)))².

| name   | g            | w           | is                                                                        |
|--------|--------------|-------------|---------------------------------------------------------------------------|
| mse    | f            | 1           | plain squares of the BRDF, ruled by its highlights and grazing angles     |
| cosine | f            | cos θ_i     | of the radiance under a lamp of one irradiance: Ngan et al. 2005         |
| log    | asinh(f / 2ε)| 1           | relative differences; straight through zero below ε                      |
| sigma  | f            | 1 / σ       | of the measurement's own standard deviations: chi squared                 |

asinh(f / 2ε) is ln(f / ε) for f far above ε and f / 2ε below, so negative readings count as they are and need no
clipping. ε: the median of σ where it is known, else 5 % of the median reading (mean of its channels): what is darker
than that is mostly the instrument's own floor. Noise of a share s of f draws the mean of its logarithm down by s² / 2:
readings that are noisier than some 10 % and come without σ are better fitted by ``cosine``.
Ngan, Durand, Matusik: Experimental analysis of BRDF models. EGSR 2005.
"""

from dataclasses import dataclass

import numpy as np

from interchange.problems import BrightfieldError, did_you_mean
from interchange.reflectance import ReflectanceSamples

NAMES = ("mse", "cosine", "log", "sigma")


@dataclass(frozen=True, eq=False)
class Weighting:
    """``factor`` (N, 1) or (N, K); ``epsilon`` 1/sr for logarithms, 0 for plain differences."""

    name: str
    factor: np.ndarray
    epsilon: float = 0.0

    def of(self, f: np.ndarray) -> np.ndarray:
        """w g(f), (N, K) as ``f``."""
        return self.factor * (np.arcsinh(f / (2 * self.epsilon)) if self.epsilon else f)

    def slope(self, f: np.ndarray) -> np.ndarray:
        """∂/∂f of ``of``."""
        if not self.epsilon:
            return np.broadcast_to(self.factor, f.shape)
        return self.factor / np.sqrt(np.square(f) + 4 * self.epsilon**2)

    def take(self, rows: np.ndarray) -> "Weighting":
        return Weighting(self.name, self.factor[rows], self.epsilon)


def weighting_of(name: str, samples: ReflectanceSamples) -> Weighting:
    """Weights for usable samples. Raises BrightfieldError for an unknown name, and for ``sigma`` without σ."""
    ones = np.ones((len(samples), 1))
    match name:
        case "mse":
            return Weighting(name, ones)
        case "cosine":
            return Weighting(name, samples.wi[:, 2:3].copy())
        case "log":
            return Weighting(name, ones, smallest(samples))
        case "sigma":
            if samples.sigma is None or not (samples.sigma > 0).all():
                raise BrightfieldError(
                    f"Weights by sigma need a positive standard deviation at every sample. ({samples.file})"
                )
            return Weighting(name, 1 / samples.sigma)
    known = ", ".join(NAMES)
    raise BrightfieldError(f'No weighting is called "{name}".{did_you_mean(name, NAMES)} There are {known}.')


def smallest(samples: ReflectanceSamples) -> float:
    """The reflectance (1/sr) below which differences count plainly instead of relatively."""
    if samples.sigma is not None and np.median(samples.sigma) > 0:
        return float(np.median(samples.sigma))
    return float(max(0.05 * np.median(np.abs(samples.f.mean(axis=1))), 1e-9))
