"""A measured isotropic BRDF over half and difference angles, as the MERL files hold it.

    f = s T(theta_h, theta_d, phi_d),    h = (wi + wo) / |wi + wo|,    d = wi turned to where h is the normal

T has a bin for every (theta_h, theta_d, phi_d), phi_d fastest. Bin numbers count 90° of theta_h by its square root,
sqrt(theta_h / 90°) of ``n_theta_h`` (fine where highlights are), 90° of theta_d and 180° of phi_d evenly. A bin's
value stands at its middle, so that the nearest bin is the one of MERL's own lookup; between middles the value runs
straight along each of the three axes. Before the first and behind the last middle of theta_h and theta_d it is
constant; phi_d goes round with a period of 180°, which is what makes the table reciprocal.
Nothing holds the table to the energy that it receives.
"""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from interchange.brdf.base import Brdf
from interchange.brdf.lambert import Color
from interchange.brdf.sampling import Lobe, Shape
from interchange.parameter import Kind, ParameterError, parameter, setting, table
from interchange.table import Table

WIDTHS = (0.02, 0.08, 0.3)  # GGX widths of the lobes that paths are drawn from


@dataclass(frozen=True)
class TabulatedIsotropic(Brdf):
    source = (
        "Matusik et al.: A data-driven reflectance model. SIGGRAPH 2003; "
        "Rusinkiewicz: A new change of variables for efficient BRDF representation. EGRW 1998."
    )
    conserves_energy = False  # values are free
    matte = "scale"

    scale: Color = parameter((1.0, 1.0, 1.0), "s", "1", 0, 10, "factor on the table", Kind.COLOR)
    n_theta_h: int = setting(3, "N_θh", 1, 1024, "bins of the half vector's polar angle")
    n_theta_d: int = setting(3, "N_θd", 1, 1024, "bins of the difference angle")
    n_phi_d: int = setting(4, "N_φd", 1, 2048, "bins of the difference's azimuth, over 180°")
    values: Table = table(Table(np.full(36, 0.5 / np.pi)), "T", "1/sr", "one row a bin, phi_d fastest")

    def __post_init__(self) -> None:
        super().__post_init__()
        bins = self.n_theta_h * self.n_theta_d * self.n_phi_d
        if len(self.values) != bins:
            raise ParameterError(
                f"TabulatedIsotropic.values must have a row for each of {self.n_theta_h} x {self.n_theta_d} x "
                f"{self.n_phi_d} = {bins} bins; got {len(self.values)}."
            )

    def f(self, wi: Any, wo: Any) -> Any:
        value = 0.0 * wi[2]
        for row, weight in self.corners(wi, wo):
            value = value + weight * self.values.take(row)  # type: ignore[attr-defined]  # a column
        return self.scale * value

    def corners(self, wi: Any, wo: Any) -> list[tuple[Any, Any]]:
        """The eight rows of the table that stand around a pair of directions, and their weights."""
        theta_h, theta_d, phi_d = half_difference(wi, wo)
        phi = np.where(phi_d < 0.0, phi_d + np.pi, phi_d)
        return [
            ((i * self.n_theta_d + j) * self.n_phi_d + k, u * v * w)
            for i, u in held(np.sqrt(theta_h * (2.0 / np.pi)) * self.n_theta_h - 0.5, self.n_theta_h)
            for j, v in held(theta_d * (2.0 / np.pi) * self.n_theta_d - 0.5, self.n_theta_d)
            for k, w in around(phi / np.pi * self.n_phi_d - 0.5, self.n_phi_d)
        ]

    def sampling(self, wo: Any) -> list[Lobe]:
        """Half-vector lobes, each as strong as the table says where it is steepest, over a matte one."""
        d = np.minimum(
            np.floor(np.arccos(np.minimum(wo[2], 1.0)) * (2.0 / np.pi) * self.n_theta_d), self.n_theta_d - 1.0
        )

        def at(theta_h: float) -> Any:
            i = min(int(np.sqrt(theta_h * 2.0 / np.pi) * self.n_theta_h), self.n_theta_h - 1)
            row = (i * self.n_theta_d + d) * self.n_phi_d + self.n_phi_d // 2
            return np.maximum(self.values.take(row), 0.0)  # type: ignore[attr-defined]

        matte = at(0.6)
        lobes = [Lobe(np.pi * matte + 1e-3)]
        for a in WIDTHS:  # the solid angle of the reflected lobe is about 4 pi a²
            lobes.append(
                Lobe(4.0 * np.pi * a * a * np.maximum(at(0.5 * a) - matte, 0.0) + 1e-4, Shape.GGX, width=a)
            )
        return lobes

    @classmethod
    def drawn(cls, rng: np.random.Generator, lobes: int = 1) -> Self:
        n = (3 + lobes, 4, 6)
        return cls(tuple(rng.uniform(0, 2, 3)), *n, Table(rng.uniform(0, 1, (int(np.prod(n)), 3))))


def half_difference(wi: Any, wo: Any) -> tuple[Any, Any, Any]:
    """theta_h, theta_d in [0, pi/2] and phi_d in (-pi, pi] of triples of arrays, rad; without cancellation."""
    x, y, z = (a + b for a, b in zip(wi, wo, strict=True))
    dx, dy, dz = (a - b for a, b in zip(wi, wo, strict=True))
    across2 = np.square(x) + np.square(y)
    length = np.sqrt(across2 + np.square(z))
    theta_h = np.arctan2(np.sqrt(across2), z)
    theta_d = np.arctan2(np.sqrt(np.square(dx) + np.square(dy) + np.square(dz)), length)
    # d along the meridian of h and across it, both times |wi + wo|² sin(theta_h)
    along = z * (x * wi[0] + y * wi[1]) - across2 * wi[2]
    across = length * (wo[0] * wi[1] - wo[1] * wi[0])
    return theta_h, theta_d, np.arctan2(across, along + 1e-20)  # 1e-20: some azimuth where there is none


def held(position: Any, count: int) -> list[tuple[Any, Any]]:
    """The two neighbours of a place between 0 and ``count`` - 1 and their weights; the ends are held beyond."""
    place = np.minimum(np.maximum(position, 0.0), count - 1.0)
    low = np.minimum(np.floor(place), max(count - 2.0, 0.0))
    part = place - low
    return [(low, 1.0 - part), (np.minimum(low + 1.0, count - 1.0), part)]


def around(position: Any, count: int) -> list[tuple[Any, Any]]:
    """The two neighbours of a place in [-1, ``count``] on a ring of ``count``, and their weights."""
    low = np.floor(position)
    part = position - low
    high = low + 1.0
    return [
        (np.where(n < 0.0, n + count, np.where(n >= count, n - count, n)), w)
        for n, w in ((low, 1.0 - part), (high, part))
    ]
