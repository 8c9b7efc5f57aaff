"""A weighted sum of BRDFs; with textures as weights, a spatially varying mixture over a basis of materials.

    f = sum_k w_k f_k

Weights that add up to 1 keep energy where the parts do. A basis of measured materials (tables) under fitted weights
is Matusik's linear model; a basis of Lafortune materials under a texture of weights for each is Lensch's.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from interchange.brdf.base import Brdf
from interchange.brdf.blinn_phong import BlinnPhong
from interchange.brdf.lambert import Color, Lambert
from interchange.brdf.sampling import Lobe
from interchange.parameter import Kind, ParameterError, parameter
from interchange.table import Table


@dataclass(frozen=True)
class Sum(Brdf):
    """``weight``: one entry a part. In ``slots()`` the parts' names stand behind ``part0_``, ``part1_`` ..., and the
    weights are ``weight0``, ``weight1`` ..., so that each may have its texture."""

    source = "Matusik et al.: A data-driven reflectance model. SIGGRAPH 2003; Lensch et al.: EGRW 2001."
    isotropic = False  # the parts decide
    reciprocal = False  # the parts decide
    conserves_energy = False  # weights are free

    weight: tuple[Color, ...] = parameter(
        ((0.5, 0.5, 0.5), (0.5, 0.5, 0.5)), "w", "1", -1e3, 1e3, "weight", Kind.COLOR, per_lobe=True
    )
    parts: tuple[Brdf, ...] = (Lambert(), BlinnPhong())

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "parts", tuple(self.parts))
        if not all(isinstance(part, Brdf) for part in self.parts):
            raise ParameterError("Sum.parts must be BRDFs.")
        if len(self.parts) != len(self.weight):
            raise ParameterError(
                f"Sum must have as many weights as parts; got {len(self.weight)} and {len(self.parts)}."
            )

    def f(self, wi: Any, wo: Any) -> Any:
        value = 0.0 * wi[2]
        for weight, part in zip(self.weight, self.parts, strict=True):
            value = value + weight * part.f(wi, wo)
        return value

    def sampling(self, wo: Any) -> list[Lobe]:
        lobes: list[Lobe] = []
        for weight, part in zip(self.weight, self.parts, strict=True):
            own = part.sampling(wo) or [Lobe(1.0)]
            total: Any = 1e-6
            for lobe in own:
                total = total + lobe.weight
            lobes += [replace(lobe, weight=np.absolute(weight) * lobe.weight / total) for lobe in own]
        return lobes

    @classmethod
    def drawn(cls, rng: np.random.Generator, lobes: int = 1) -> Self:
        parts = (Lambert.drawn(rng), BlinnPhong.drawn(rng))
        return cls(weight=tuple(rng.uniform(0, 1, (2, 3))), parts=parts)

    @property
    def structure(self) -> str:
        return f"Sum({', '.join(part.structure for part in self.parts)})"

    @property
    def tables(self) -> list[Table]:
        return [table for part in self.parts for table in part.tables]

    def flat(self) -> list[float]:
        return [float(x) for x in np.ravel(self.weight)] + [x for part in self.parts for x in part.flat()]

    def slots(self) -> dict[str, range]:
        place = {f"weight{k}": range(3 * k, 3 * k + 3) for k in range(len(self.parts))}
        start = 3 * len(self.parts)
        for k, part in enumerate(self.parts):
            for name, slot in part.slots().items():
                place[f"part{k}_{name}"] = range(start + slot.start, start + slot.stop)
            start += len(part.flat())
        return place

    def bind(
        self, values: Sequence[Any], channel: int | None, looked_up: Sequence[Any] | None = None
    ) -> Self:
        bound = object.__new__(type(self))
        start, first = 3 * len(self.parts), 0
        weights, parts = [], []
        for k, part in enumerate(self.parts):
            own = values[3 * k : 3 * k + 3]
            weights.append((own[0] + own[1] + own[2]) / 3.0 if channel is None else own[channel])
            size, count = len(part.flat()), len(part.tables)
            columns = looked_up[first : first + count] if looked_up is not None else None
            parts.append(part.bind(values[start : start + size], channel, columns))
            start, first = start + size, first + count
        object.__setattr__(bound, "weight", weights)
        object.__setattr__(bound, "parts", tuple(parts))
        return bound

    def with_flat(self, values: Sequence[float]) -> Self:
        start, parts = 3 * len(self.parts), []
        for part in self.parts:
            size = len(part.flat())
            parts.append(part.with_flat(values[start : start + size]))
            start += size
        weight = np.reshape(values[: 3 * len(self.parts)], (-1, 3))
        return replace(self, weight=tuple(map(tuple, weight)), parts=tuple(parts))
