"""A matrix of spherical harmonics over the directions of light and camera.

    f = max(sum_jk M_jk Y_j(wi) Y_k(wo), 0),    Y_lm real and orthonormal over the sphere, l <= degree

``M`` holds the upper triangle (M is symmetric: reciprocity), in the order of ``pairs``: isotropic surfaces have entries
between equal m alone, (L + 1)(L + 2)(L + 3) / 6 of them; ``anisotropic`` = 1 keeps all n (n + 1) / 2, n = (L + 1)².

Westin projects f cos onto the harmonics of the whole sphere. Here f itself is expanded, and fitted over the upper
hemispheres alone: dividing by the cosine again would make grazing values infinite and f unequal to its exchange. A
sharp lobe needs a degree of about 2 / (its width in rad); short of it the expansion rings, and is cut off at 0.
"""

from dataclasses import dataclass
from math import factorial, pi, sqrt
from typing import Any, Self

import numpy as np

from interchange.brdf.base import Brdf
from interchange.brdf.modes import Modes, Pair, pairs, products, summed
from interchange.brdf.sampling import Lobe, Shape, mirror
from interchange.parameter import ParameterError, setting, table
from interchange.table import Table


@dataclass(frozen=True)
class SphericalHarmonics(Brdf):
    source = "Westin, Arvo, Torrance: Predicting reflectance functions from complex surfaces. SIGGRAPH 1992."
    isotropic = False  # a setting decides
    conserves_energy = False  # coefficients are free

    degree: int = setting(2, "L", 0, 12, "highest degree; 6 where anisotropic")
    anisotropic: int = setting(0, "a", 0, 1, "1: the surface tells directions of its plane apart")
    M: Table = table(
        Table([2.0, 0.0, 0.0, 0.1, 0.0, 0.1, -0.1, 0.0, -0.1, 0.1]),
        "M",
        "1/sr",
        "coefficients by pair of modes",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.anisotropic and self.degree > 6:
            raise ParameterError(
                f"SphericalHarmonics.degree (L) must lie in [0, 6] where anisotropic; got {self.degree}."
            )
        if len(self.M) != (count := len(self.pairs)):
            raise ParameterError(
                f"SphericalHarmonics.M (coefficients) must have {count} rows for degree {self.degree}; "
                f"got {len(self.M)}."
            )

    @property
    def pairs(self) -> list[Pair]:
        """((l, m), (l', m')) of each row of ``M``."""
        return _pairs(self.degree, self.anisotropic)

    def terms(self, wi: Any, wo: Any) -> list[Any]:
        """What each row of ``M`` multiplies, for triples of arrays that broadcast."""
        return products(harmonics(wi, self.degree), harmonics(wo, self.degree), bool(self.anisotropic))

    def f(self, wi: Any, wo: Any) -> Any:
        return summed(self.M, self.terms(wi, wo)) + 0.0 * wi[2]

    def sampling(self, wo: Any) -> list[Lobe]:
        axis = mirror(wo)
        return [Lobe(0.6), Lobe(0.25, Shape.POWER, axis, 6.0), Lobe(0.15, Shape.POWER, axis, 40.0)]

    @staticmethod
    def count(degree: int, anisotropic: bool = False) -> int:
        """Rows of the table."""
        return len(_pairs(degree, int(anisotropic)))

    @classmethod
    def drawn(cls, rng: np.random.Generator, lobes: int = 1) -> Self:
        """A matte surface with random coefficients of a tenth of its own, falling with their degrees."""
        degree, anisotropic = lobes + 1, int(lobes == 1 and rng.uniform() < 0.5)
        index = _pairs(degree, anisotropic)
        fall = np.array([1.0 / (1 + a[0] + b[0]) for a, b in index])
        values = 0.2 * fall[:, None] * rng.normal(size=(len(index), 3))
        values[0] = rng.uniform(1.0, 3.0, 3)
        return cls(degree, anisotropic, Table(values))


def _pairs(degree: int, anisotropic: int) -> list[Pair]:
    return pairs([(n, m) for n in range(degree + 1) for m in range(n + 1)], bool(anisotropic))


def harmonics(w: Any, degree: int) -> Modes:
    """N_lm P_l^m(z) / sin^m with N² = (2l + 1) (l - m)! / (4 pi (l + m)!), by the recurrence in l, for m >= 0."""
    z = w[2]
    found: dict[tuple[int, int], Any] = {}
    for m in range(degree + 1):
        # P_m^m / sin^m = (2m - 1)!!, without Condon and Shortley's sign
        legendre = [0.0, factorial(2 * m) / (2**m * factorial(m)) + 0.0 * z]
        for degree_l in range(m + 1, degree + 1):
            up = (2 * degree_l - 1) / (degree_l - m) * z * legendre[-1]
            down = (degree_l + m - 1) / (degree_l - m) * legendre[-2]
            legendre.append(up - down if degree_l > m + 1 else up)
        for degree_l, value in enumerate(legendre[1:], m):
            norm = sqrt((2 * degree_l + 1) * factorial(degree_l - m) / (4 * pi * factorial(degree_l + m)))
            found[degree_l, m] = norm * value
    return Modes(dict(sorted(found.items())), (w[0], w[1]))
