"""What every BRDF is: a formula f(wi, wo) in 1/sr, and its declared parameters.

Directions are unit vectors in the shading frame (x tangent, y bitangent, z normal), both pointing away
from the surface: ``wi`` to the light, ``wo`` to the camera. ``f`` carries no cosine factor and is asked
only for directions above the surface.

The formula is written for one channel (one wavelength): inside ``f`` a colour parameter is one number,
and a per-lobe parameter a list. ``evaluate`` calls it for the three channels; ``interchange.shader`` calls
it on values that write GLSL or OSL. So that all three agree, ``f`` holds no ``if`` on values: ``np.where``,
``np.maximum`` and products; ``np.power`` of values that are not negative.
"""

from collections.abc import Sequence
from typing import Any, ClassVar, Self

import numpy as np

from interchange.parameter import Kind, freeze, parameters


class Brdf:
    source: ClassVar[str]
    isotropic: ClassVar[bool] = True
    reciprocal: ClassVar[bool] = True
    conserves_energy: ClassVar[bool] = True  # for every parameter value within the bounds

    def __post_init__(self) -> None:
        freeze(self)

    def f(self, wi: Any, wo: Any) -> Any:
        """Reflectance in 1/sr of one channel. ``wi``, ``wo``: (x, y, z) triples of arrays that broadcast."""
        raise NotImplementedError

    def evaluate(self, wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
        """Reflectance in 1/sr of the three channels, (..., 3); 0 where either direction is not above the surface.

        ``wi``, ``wo``: (..., 3) unit vectors in the shading frame, shapes that broadcast.
        """
        wi, wo = np.broadcast_arrays(np.asarray(wi, np.float64), np.asarray(wo, np.float64))
        i, o = (tuple(np.moveaxis(w, -1, 0)) for w in (wi, wo))
        with np.errstate(all="ignore"):
            value = np.stack(
                [np.broadcast_to(self.bind(self.flat(), c).f(i, o), i[2].shape) for c in range(3)], -1
            )
        above = (wi[..., 2] > 0) & (wo[..., 2] > 0)
        return np.where(above[..., None], value, 0.0)

    @property
    def lobes(self) -> int:
        """Entries in each per-lobe parameter; 0 for a model that has none."""
        return next((len(getattr(self, n)) for n, p in parameters(self).items() if p.per_lobe), 0)

    def flat(self) -> list[float]:
        """All numbers of the parameters in the order of declaration: what a shader gets as ``p[]``."""
        return [float(x) for name in parameters(self) for x in np.ravel(getattr(self, name))]

    def slots(self) -> dict[str, range]:
        """Where each parameter lies in ``flat()``."""
        place: dict[str, range] = {}
        start = 0
        for name, about in parameters(self).items():
            width = about.kind.width * (self.lobes if about.per_lobe else 1)
            place[name] = range(start, start + width)
            start += width
        return place

    def bind(self, values: Sequence[Any], channel: int) -> Self:
        """The same model on other numbers (or a shader's names) in the order of ``flat()``, for one channel."""
        bound = object.__new__(type(self))
        slots = self.slots()
        for name, about in parameters(self).items():
            width = about.kind.width
            numbers = [values[i] for i in slots[name]]
            groups = [numbers[i : i + width] for i in range(0, len(numbers), width)]
            entries = [
                g[0] if about.kind is Kind.FLOAT else g[channel] if about.kind is Kind.COLOR else tuple(g)
                for g in groups
            ]
            object.__setattr__(bound, name, entries if about.per_lobe else entries[0])
        return bound
