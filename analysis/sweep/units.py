"""Units that a plan may write a number in, and the declared ones that they become: x_declared = factor x."""

import numpy as np

from interchange.problems import BrightfieldError, did_you_mean

# one row a dimension: how many of the dimension's base unit each unit is
DIMENSIONS: tuple[dict[str, float], ...] = (
    {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "µm": 1e-6, "um": 1e-6, "nm": 1e-9},
    {"rad": 1.0, "mrad": 1e-3, "deg": np.pi / 180, "°": np.pi / 180},
    {"s": 1.0, "ms": 1e-3, "µs": 1e-6, "us": 1e-6},
    {"1": 1.0, "%": 1e-2},
    {"W/sr": 1.0, "mW/sr": 1e-3},
)


def factor(given: str, declared: str) -> float:
    """What a number in unit ``given`` is multiplied by to be in ``declared``. Raises BrightfieldError where the two do
    not measure the same."""
    if given == declared:
        return 1.0
    for units in DIMENSIONS:
        if declared in units and given in units:
            return units[given] / units[declared]
    fitting = next((list(units) for units in DIMENSIONS if declared in units), [declared])
    raise BrightfieldError(
        f'The unit must be one of {", ".join(fitting)}; got "{given}".{did_you_mean(given, fitting)}'
    )
