"""What any model's lobes are made of, by what its file declares: ``matte``, ``strength``, ``width``."""

from dataclasses import replace

import numpy as np

from interchange.brdf.base import Brdf
from interchange.parameter import ParameterError, parameters


def has_lobes(brdf: Brdf) -> bool:
    """Whether there is a lobe whose width is declared, beside the body colour."""
    if not brdf.width or (parameters(brdf)[next(iter(brdf.width))].per_lobe and not brdf.lobes):
        return False
    return not brdf.strength or bool(np.any(np.asarray(getattr(brdf, brdf.strength))))


def width_factors(brdf: Brdf, along: float, across: float) -> dict[str, float]:
    """What each parameter of ``width`` is multiplied by where lobes become ``along`` and ``across`` times as wide."""
    return {name: float(along**a * across**b) for name, (a, b) in brdf.width.items()}


def body_off(brdf: Brdf) -> Brdf:
    """Its lobes alone."""
    return with_body(brdf, np.zeros(3)) if brdf.matte else brdf


def with_body(brdf: Brdf, factor: np.ndarray) -> Brdf:
    """The body colour times ``factor`` (3,). Raises ParameterError."""
    if not brdf.matte:
        raise ParameterError(f"{type(brdf).__name__} has no body colour.")
    value = np.asarray(getattr(brdf, brdf.matte)) * factor
    return replace(brdf, **{brdf.matte: tuple(map(float, value))})  # type: ignore[type-var]
