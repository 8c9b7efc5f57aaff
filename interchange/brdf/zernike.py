"""Zernike polynomials over the directions of light and camera, laid on the unit disk so that areas keep their ratio.

    f = max(sum_jk a_jk K_j(wi) K_k(wo), 0)
    K_n^m = sqrt((n + 1) / 2 pi) R_n^m(rho) {1, sqrt2 cos m phi, sqrt2 sin m phi}
    rho = sqrt2 sin(theta / 2),    R_n^m(rho) = rho^m P_k^(0,m)(2 rho² - 1), k = (n - m) / 2, P Jacobi's

K are orthonormal over the hemisphere; n <= order, m <= n of equal parity. ``a`` holds the upper triangle (a is
symmetric: reciprocity holds exactly), in the order of ``pairs``. Isotropic surfaces have products of equal m alone:
5 of them for order 2, 14 for order 4, 55 for order 8. A cut expansion may fall below zero: it is held at 0.
"""

from dataclasses import dataclass
from math import pi, sqrt
from typing import Any, Self

import numpy as np

from interchange.brdf.base import Brdf
from interchange.brdf.modes import Modes, Pair, pairs, products, summed
from interchange.brdf.sampling import Lobe, Shape, mirror
from interchange.parameter import ParameterError, setting, table
from interchange.table import Table


@dataclass(frozen=True)
class Zernike(Brdf):
    source = (
        "Koenderink, van Doorn, Stavridi: Bidirectional reflection distribution function expressed in terms of "
        "surface scattering modes. ECCV 1996."
    )
    isotropic = False  # a setting decides
    conserves_energy = False  # coefficients are free

    order: int = setting(2, "N", 0, 16, "highest order; 8 where anisotropic")
    anisotropic: int = setting(0, "a", 0, 1, "1: the surface tells directions of its plane apart")
    a: Table = table(Table([1.0, -0.1, 0.1, -0.1, 0.1]), "a", "1/sr", "coefficients by pair of modes")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.anisotropic and self.order > 8:
            raise ParameterError(f"Zernike.order (N) must lie in [0, 8] where anisotropic; got {self.order}.")
        if len(self.a) != (count := len(self.pairs)):
            raise ParameterError(
                f"Zernike.a (coefficients) must have {count} rows for order {self.order}; got {len(self.a)}."
            )

    @property
    def pairs(self) -> list[Pair]:
        """((n, m), (n', m')) of each row of ``a``."""
        return _pairs(self.order, self.anisotropic)

    def terms(self, wi: Any, wo: Any) -> list[Any]:
        """What each row of ``a`` multiplies, for triples of arrays that broadcast."""
        return products(disk_modes(wi, self.order), disk_modes(wo, self.order), bool(self.anisotropic))

    def f(self, wi: Any, wo: Any) -> Any:
        return summed(self.a, self.terms(wi, wo)) + 0.0 * wi[2]

    def sampling(self, wo: Any) -> list[Lobe]:
        axis = mirror(wo)
        return [Lobe(0.6), Lobe(0.25, Shape.POWER, axis, 6.0), Lobe(0.15, Shape.POWER, axis, 40.0)]

    @staticmethod
    def count(order: int, anisotropic: bool = False) -> int:
        """Rows of the table."""
        return len(_pairs(order, int(anisotropic)))

    @classmethod
    def drawn(cls, rng: np.random.Generator, lobes: int = 1) -> Self:
        """A matte surface with random coefficients of a tenth of its own, falling with their orders."""
        order, anisotropic = 2 * lobes, int(lobes == 1 and rng.uniform() < 0.5)
        index = _pairs(order, anisotropic)
        fall = np.array([1.0 / (1 + a[0] + b[0]) for a, b in index])
        values = 0.1 * fall[:, None] * rng.normal(size=(len(index), 3))
        values[0] = rng.uniform(0.5, 1.5, 3)
        return cls(order, anisotropic, Table(values))


def _pairs(order: int, anisotropic: int) -> list[Pair]:
    return pairs([(n, m) for n in range(order + 1) for m in range(n % 2, n + 1, 2)], bool(anisotropic))


def disk_modes(w: Any, order: int) -> Modes:
    """sqrt((n + 1) / 2 pi) R_n^m / rho^m, by Jacobi's recurrence in 2 rho² - 1 = 1 - 2 z, for m >= 0."""
    x = 1.0 - 2.0 * w[2]
    shrink = 1.0 / np.sqrt(1.0 + w[2])
    found: dict[tuple[int, int], Any] = {}
    for m in range(order + 1):
        jacobi: list[Any] = []
        for k in range((order - m) // 2 + 1):
            if k == 0:
                jacobi.append(1.0 + 0.0 * x)
            elif k == 1:
                jacobi.append(0.5 * ((m + 2.0) * x - m))
            else:
                scale = 2.0 * k * (k + m) * (2 * k + m - 2)
                up = (2 * k + m - 1) * ((2 * k + m) * (2 * k + m - 2) * x - m * m) * jacobi[-1]
                jacobi.append((up - 2.0 * (k - 1) * (k + m - 1) * (2 * k + m) * jacobi[-2]) * (1.0 / scale))
            found[2 * k + m, m] = sqrt((2 * k + m + 1) / (2 * pi)) * jacobi[-1]
    return Modes(dict(sorted(found.items())), (w[0] * shrink, w[1] * shrink))
