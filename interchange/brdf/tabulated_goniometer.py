"""A measured BRDF over the angles of a goniometer: polar angles and azimuths of light and camera.

    f = s T(theta_i, phi_i, theta_o, phi_o)

T has a row for every (theta_i, phi_i, theta_o, phi_o), phi_o fastest. Polar angles stand evenly from 0 to
``theta_i_max`` and ``theta_o_max``, both included; azimuths stand evenly around 360°, from 0. With one phi_i the
surface is isotropic, and the other azimuth is phi_o - phi_i; with ``mirrored`` = 1 that difference stands evenly from
0 to 180°, both included, and the other side is its mirror image. The value runs straight along each of the axes.
Beyond the largest polar angles it is that of the largest: nothing was measured there. UTIA's files are 6 x 48 x 6 x
48 with 75° for both.

Light and camera are not exchanged: the table is as reciprocal and as frugal with energy as what was measured. A
highlight narrower than the steps of the polar angles is blurred along the plane of incidence between two incidences;
``tabulated_isotropic`` follows it.
"""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from interchange.brdf.base import Brdf
from interchange.brdf.lambert import Color
from interchange.brdf.sampling import Lobe, Shape
from interchange.brdf.tabulated_isotropic import around, held
from interchange.parameter import Kind, ParameterError, parameter, setting, table
from interchange.table import Table


@dataclass(frozen=True)
class TabulatedGoniometer(Brdf):
    source = (
        "Filip, Vávra: Template-based sampling of anisotropic BRDFs. Computer Graphics Forum 33(7), 2014."
    )
    isotropic = False  # the table decides
    reciprocal = False  # as measured
    conserves_energy = False  # as measured
    matte = "scale"

    scale: Color = parameter((1.0, 1.0, 1.0), "s", "1", 0, 10, "factor on the table", Kind.COLOR)
    theta_i_max: float = parameter(1.3, "θ_i", "rad", 0.1, np.pi / 2, "largest polar angle of the light")
    theta_o_max: float = parameter(1.3, "θ_o", "rad", 0.1, np.pi / 2, "largest polar angle of the camera")
    n_theta_i: int = setting(2, "N_θi", 1, 1024, "polar angles of the light")
    n_phi_i: int = setting(1, "N_φi", 1, 1024, "azimuths of the light; 1: isotropic")
    n_theta_o: int = setting(2, "N_θo", 1, 1024, "polar angles of the camera")
    n_phi_o: int = setting(4, "N_φo", 1, 2048, "azimuths of the camera")
    mirrored: int = setting(0, "M", 0, 1, "1: the azimuth difference is tabulated from 0 to 180° only")
    values: Table = table(
        Table(np.full(16, 0.5 / np.pi)), "T", "1/sr", "one row a pair of directions, phi_o fastest"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        rows = self.n_theta_i * self.n_phi_i * self.n_theta_o * self.n_phi_o
        if len(self.values) != rows:
            raise ParameterError(
                f"TabulatedGoniometer.values must have a row for each of {self.n_theta_i} x {self.n_phi_i} x "
                f"{self.n_theta_o} x {self.n_phi_o} = {rows} pairs of directions; got {len(self.values)}."
            )
        if self.mirrored and self.n_phi_i > 1:
            raise ParameterError("TabulatedGoniometer.mirrored needs one azimuth of the light (n_phi_i = 1).")

    def f(self, wi: Any, wo: Any) -> Any:
        value = 0.0 * wi[2]
        for row, weight in self.corners(wi, wo):
            value = value + weight * self.values.take(row)  # type: ignore[attr-defined]  # a column
        return self.scale * value

    def corners(self, wi: Any, wo: Any) -> list[tuple[Any, Any]]:
        """The rows of the table that stand around a pair of directions (eight, sixteen if anisotropic), and their
        weights."""
        light = [(0.0, 1.0)]
        if self.n_phi_i > 1:
            light = turn(azimuth(wi[0], wi[1]), self.n_phi_i)
            camera = turn(azimuth(wo[0], wo[1]), self.n_phi_o)
        else:  # the difference from the products alone: no angle is taken from another
            along, across = wi[0] * wo[0] + wi[1] * wo[1], wi[0] * wo[1] - wi[1] * wo[0]
            if self.mirrored:
                half = np.arctan2(np.absolute(across), along + 1e-20) / np.pi
                camera = held(half * (self.n_phi_o - 1.0), self.n_phi_o)
            else:
                camera = turn(azimuth(along, across), self.n_phi_o)
        return [
            (((i * self.n_phi_i + j) * self.n_theta_o + k) * self.n_phi_o + m, a * b * c * d)
            for i, a in held(polar(wi) / self.theta_i_max * (self.n_theta_i - 1.0), self.n_theta_i)
            for j, b in light
            for k, c in held(polar(wo) / self.theta_o_max * (self.n_theta_o - 1.0), self.n_theta_o)
            for m, d in camera
        ]

    def sampling(self, wo: Any) -> list[Lobe]:
        """A matte lobe and two about the mirror direction, as strong as the table says there: no narrower than its
        steps, which is all that it can hold."""
        theta = polar(wo)
        k = np.floor(np.minimum(theta / self.theta_o_max, 1.0) * (self.n_theta_o - 1.0) + 0.5)
        far = self.n_phi_o - 1 if self.mirrored else self.n_phi_o // 2  # light opposite the camera
        step = self.theta_i_max / max(self.n_theta_i - 1, 1)

        def at(beside: float) -> Any:
            place = np.minimum(np.maximum((theta - beside) / self.theta_i_max, 0.0), 1.0) * (
                self.n_theta_i - 1.0
            )
            i, j = np.floor(place + 0.5), 0.0
            m: Any = float(far)
            if self.n_phi_i > 1:
                j = wrapped(np.floor(azimuth(-wo[0], -wo[1]) * self.n_phi_i + 0.5), self.n_phi_i)
                m = wrapped(np.floor(azimuth(wo[0], wo[1]) * self.n_phi_o + 0.5), self.n_phi_o)
            row = ((i * self.n_phi_i + j) * self.n_theta_o + k) * self.n_phi_o + m
            return np.maximum(self.values.take(row), 0.0)  # type: ignore[attr-defined]

        peak, matte = at(0.0), np.minimum(at(0.7), at(-0.7))
        lobes = [Lobe(np.pi * matte + 1e-3)]
        for a in (0.5 * step, 1.5 * step):
            weight = 4.0 * np.pi * a * a * np.maximum(peak - matte, 0.0) + 1e-4
            lobes.append(Lobe(weight, Shape.GGX, width=np.minimum(a, 0.5)))
        return lobes

    @classmethod
    def drawn(cls, rng: np.random.Generator, lobes: int = 1) -> Self:
        i, j, k, m = [(3, 4, 2, 5), (3, 1, 4, 6), (4, 1, 3, 5)][lobes % 3]
        theta_i, theta_o = rng.uniform(0.8, 1.5, 2)
        rows = Table(rng.uniform(0, 1, (i * j * k * m, 3)))
        scale = tuple(rng.uniform(0, 2, 3))
        return cls(scale, theta_i, theta_o, i, j, k, m, mirrored=int(lobes % 3 == 2), values=rows)


def polar(w: Any) -> Any:
    """The angle from the normal, rad."""
    return np.arctan2(np.sqrt(np.square(w[0]) + np.square(w[1])), w[2])


def azimuth(x: Any, y: Any) -> Any:
    """The angle from x towards y in turns, [0, 1); some number where x = y = 0."""
    turns = np.arctan2(y, x + 1e-20) / (2.0 * np.pi)
    return np.where(turns < 0.0, turns + 1.0, turns)


def turn(turns: Any, count: int) -> list[tuple[Any, Any]]:
    """The two neighbours of an azimuth in turns among ``count`` of them, and their weights."""
    return around(turns * count, count)


def wrapped(number: Any, count: int) -> Any:
    return np.where(number >= count, number - count, number)
