"""What an algorithm is: one frozen dataclass of declared parameters in one file, and ``run``.

Images come in grey levels of 8 bits, (H, W) float32, DN · 255 / (2^bits - 1) and the mean of the channels: a threshold
means the same for every camera. A gauge and a template match are given the nominal feature as ``near``.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from analysis.tune.found import Found
from interchange.parameter import freeze

GREY = "grey level"  # of 255


@dataclass(frozen=True)
class Algorithm:
    """``finds``: Edges, Blobs, Circle, Line or Place; ``source``: paper or library."""

    finds: ClassVar[type] = type(None)
    source: ClassVar[str] = ""

    def __post_init__(self) -> None:
        freeze(self)

    def run(self, image: np.ndarray, near: Any = None) -> Found | None:
        """None where the feature that ``near`` stands for is not found."""
        raise NotImplementedError
