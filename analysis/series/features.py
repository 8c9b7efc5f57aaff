"""The features of a pixel by name, as the command line asks for them."""

import numpy as np

from analysis.series.azimuth_features import NAMES, azimuth_features
from analysis.series.hemispherical_harmonics import harmonic_features
from analysis.series.invariants import rotation_invariants
from analysis.series.lafortune_features import lafortune_features
from interchange.problems import BrightfieldError
from interchange.series import Series


def features(series: Series, kind: str) -> tuple[np.ndarray, list[str]]:
    """(H, W, F) and their names. BrightfieldError for a kind that there is not."""
    match kind:
        case "lafortune":
            return lafortune_features(series).additive, ["k_d", "albedo", "lobe height 1/sr"]
        case "lafortune-raw":
            return lafortune_features(series).features, ["C_z", "k_d", "n"]
        case "azimuth":
            return azimuth_features(series), list(NAMES)
        case "harmonics":
            x = harmonic_features(series)
            return x, [f"coefficient {k}" for k in range(x.shape[-1])]
        case "rotation":
            x = rotation_invariants(series)
            return x, [f"magnitude {k}" for k in range(x.shape[-1])]
        case "raw":
            return np.moveaxis(series.grey, 0, -1), list(series.names)
    raise BrightfieldError(f'There are no features "{kind}".')
