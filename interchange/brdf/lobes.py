"""What any model's lobes are made of, by what its file declares: ``matte``, ``strength``, ``width``."""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from interchange.brdf.base import Brdf
from interchange.parameter import ParameterError, parameters


def has_lobes(brdf: Brdf) -> bool:
    """Whether there is a lobe whose width is declared, beside the body colour."""
    if not brdf.width or (parameters(brdf)[next(iter(brdf.width))].per_lobe and not brdf.lobes):
        return False
    return not brdf.strength or bool(np.any(np.asarray(getattr(brdf, brdf.strength))))


@lru_cache(maxsize=1024)
def is_isotropic(brdf: Brdf) -> bool:
    """Whether turning both directions about the normal changes nothing: declared by the model, or found for these
    parameters (Lafortune with Cx = Cy) by trying it, which no formula of a model passes by accident."""
    if type(brdf).isotropic:
        return True
    rng = np.random.default_rng(0)
    z, phi, turn = rng.uniform(0.05, 1, (2, 64)), rng.uniform(0, 2 * np.pi, (2, 64)), rng.uniform(0, 6, 64)

    def value(angle: np.ndarray) -> np.ndarray:
        s = np.sqrt(1 - z**2)
        wi, wo = np.stack([s * np.cos(angle), s * np.sin(angle), z], -1)
        return brdf.evaluate(wi, wo)

    still, turned = value(phi), value(phi + turn)
    return bool(np.allclose(still, turned, rtol=1e-9, atol=1e-12 * float(np.abs(still).max())))


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
