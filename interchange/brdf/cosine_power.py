"""Large powers of a cosine near 1, which single precision keeps if they are made of the tangent."""

from typing import Any

import numpy as np


def cosine_power(sin2: Any, cos2: Any, n: Any) -> Any:
    """cos^n = exp(-n / 2 ln(1 + tan²)) of an angle up to a right one, n >= 0; only the ratio of ``sin2``, ``cos2``
    counts. Rounding a cosine to 32 bits alone would cost n times 6e-8."""
    t = sin2 / np.maximum(cos2, 1e-30)
    near = t * (1.0 - t * (0.5 - t * (1.0 / 3.0 - t * (0.25 - 0.2 * t))))
    return np.exp(-0.5 * n * np.where(t < 0.03, near, np.log(1.0 + t)))
