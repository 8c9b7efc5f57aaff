"""A measured BRDF in the adaptive parameterisation of Dupuy and Jakob, as the RGL material database holds it.

    f = s S(u) D(m) / (4 sigma(wo) wi.z),    m = (wi + wo) / |wi + wo|,    u = W⁻¹(m; wo)

D: a distribution of facets, estimated from retro-reflection; sigma: the area of facets that ``wo`` sees; W: the map of
the unit square onto half vectors, by the density of facets visible from ``wo`` (rows first, then columns, each by its
cumulative sums), so that the table S spends its cells where light goes. Polar angles are tabulated over
sqrt(2 theta / pi), azimuths over (phi + pi) / 2 pi; every grid holds its ends and runs straight in between, and
along the angles of incidence (``n_phi_i`` x ``n_theta_i`` nodes, held beyond). With one or two azimuths of incidence
the surface is isotropic and the half vector's azimuth counts from that of ``wo``; ``reduction`` 2 or 4 says how many
mirror images of the measured azimuths fill the circle. ``jacobian`` 0 leaves D / 4 sigma away.

``warp`` holds, one behind the other: nodes of theta_i and phi_i, D, sigma, and, for each incidence, the density, its
sums along each row, and the sums of the rows.

The camera stands for the incidence of the measurement, as when Mitsuba traces a path: S holds the cosine of the other
direction, and that cosine then is the light's, which multiplies f anyway. A measured surface is reciprocal; the table,
and its energy, are what was measured.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Self

import numpy as np

from interchange.brdf.base import Brdf
from interchange.brdf.lambert import Color
from interchange.brdf.sampling import Lobe, Shape
from interchange.brdf.tabulated_isotropic import held
from interchange.parameter import Kind, ParameterError, parameter, setting, table
from interchange.table import Table

WIDTHS = (0.02, 0.08, 0.25, 0.6)  # GGX widths of the lobes that paths are drawn from
Corners = list[tuple[Any, Any]]


def _matte() -> np.ndarray:
    """S of the default: 0.5 / pi times the cosine of ``wi``, under a uniform map."""
    theta_i, y, x = np.meshgrid(np.array([0.0, 0.5, 1.0, 1.5]), *2 * [np.arange(9) / 8], indexing="ij")
    theta, phi = np.square(x) * np.pi / 2, (2 * y - 1) * np.pi
    cos = np.cos(theta) * np.cos(theta_i) + np.sin(theta) * np.cos(phi) * np.sin(theta_i)
    return np.maximum(2 * cos * np.cos(theta) - np.cos(theta_i), 0.0).ravel() * 0.5 / np.pi


@dataclass(frozen=True)
class Rgl(Brdf):
    source = (
        "Dupuy, Jakob: An adaptive parameterization for efficient material acquisition. SIGGRAPH Asia 2018."
    )
    isotropic = False  # the table decides
    reciprocal = False  # as measured
    conserves_energy = False  # as measured
    matte = "scale"

    scale: Color = parameter((1.0, 1.0, 1.0), "s", "1", 0, 10, "factor on the table", Kind.COLOR)
    n_phi_i: int = setting(1, "N_φi", 1, 256, "azimuths of incidence")
    n_theta_i: int = setting(4, "N_θi", 1, 256, "polar angles of incidence")
    d_x: int = setting(2, "N_D", 2, 4096, "columns of D, along theta")
    d_y: int = setting(2, "M_D", 2, 4096, "rows of D, along phi")
    sigma_x: int = setting(2, "N_σ", 2, 4096, "columns of sigma")
    sigma_y: int = setting(2, "M_σ", 2, 4096, "rows of sigma")
    w_x: int = setting(2, "N_W", 2, 4096, "columns of the density of visible facets")
    w_y: int = setting(2, "M_W", 2, 4096, "rows of the density of visible facets")
    n: int = setting(9, "N", 2, 4096, "columns and rows of S")
    reduction: int = setting(1, "r", 1, 4, "mirror images that fill the circle of azimuths: 1, 2 or 4")
    jacobian: int = setting(0, "J", 0, 1, "1: S is without D / 4 sigma")
    warp: Table = table(
        Table([0.0, 0.5, 1.0, 1.5, 0.0, *8 * [1.0], *4 * [1.0, 1, 1, 1, 0, 1, 0, 1, 0, 1]]),
        "W",
        "1",
        "nodes, D, sigma, the density and its sums",
    )
    values: Table = table(Table(_matte()), "S", "1/sr", "(phi_i, theta_i, row, column), column fastest")

    def __post_init__(self) -> None:
        super().__post_init__()
        incidences = self.n_phi_i * self.n_theta_i
        need = {"warp": self._start("end"), "values": incidences * self.n * self.n}
        for name, rows in need.items():
            if len(getattr(self, name)) != rows:
                raise ParameterError(f"Rgl.{name} must have {rows} rows; got {len(getattr(self, name))}.")

    @classmethod
    def of(
        cls,
        theta_i: np.ndarray,
        phi_i: np.ndarray,
        ndf: np.ndarray,
        sigma: np.ndarray,
        vndf: np.ndarray,
        spectra: np.ndarray,
        jacobian: bool,
    ) -> Self:
        """The model of a file's arrays: ``vndf`` (P, T, y, x), ``spectra`` (P, T, n, n, 3), P azimuths of incidence."""
        density, columns, rows = sums(np.asarray(vndf, np.float64))
        reduction = 1 if len(phi_i) <= 2 else int(np.rint(2 * np.pi / (phi_i[-1] - phi_i[0])))
        parts = (theta_i, phi_i, ndf, sigma, *_by_incidence(density, columns, rows))
        return cls(
            n_phi_i=len(phi_i),
            n_theta_i=len(theta_i),
            d_x=ndf.shape[1],
            d_y=ndf.shape[0],
            sigma_x=sigma.shape[1],
            sigma_y=sigma.shape[0],
            w_x=vndf.shape[3],
            w_y=vndf.shape[2],
            n=spectra.shape[2],
            reduction=reduction,
            jacobian=int(jacobian),
            warp=Table(np.concatenate([np.ravel(p) for p in parts])),
            values=Table(spectra.reshape(-1, 3)),
        )

    def _start(self, part: str) -> int:
        """Where a part of ``warp`` begins."""
        size = self.w_x * self.w_y
        lengths = {
            "theta_i": self.n_theta_i,
            "phi_i": self.n_phi_i,
            "d": self.d_x * self.d_y,
            "sigma": self.sigma_x * self.sigma_y,
            "w": (2 * size + self.w_y) * self.n_phi_i * self.n_theta_i,
        }
        total = 0
        for name, length in lengths.items():
            if name == part:
                return total
            total += length
        return total

    def f(self, wi: Any, wo: Any) -> Any:
        return self.scale * self._light(wo, wi) / wi[2]

    def _light(self, wi: Any, wo: Any) -> Any:
        """f wo.z, with ``wi`` the incidence of the measurement."""
        if self.reduction >= 2:  # the measured azimuths are those below the tangent
            side = [wi[1] >= 0.0 if k == 1 or self.reduction == 2 else wi[0] >= 0.0 for k in (0, 1)]
            wi, wo = ((*(np.where(s, -a, a) for s, a in zip(side, w, strict=False)), w[2]) for w in (wi, wo))
        mx, my, mz = (a + b for a, b in zip(wi, wo, strict=True))
        theta_i, phi_i = _polar(*wi), np.arctan2(wi[1], wi[0] + 1e-20)
        if self.n_phi_i <= 2:
            phi_m = np.arctan2(wi[0] * my - wi[1] * mx, wi[0] * mx + wi[1] * my + 1e-20)
        else:
            phi_m = np.arctan2(my, mx + 1e-20)
        u_m = np.sqrt(_polar(mx, my, mz) * (2.0 / np.pi)), (phi_m + np.pi) / (2.0 * np.pi)
        u_m = u_m[0], u_m[1] - np.floor(u_m[1])
        incidence = [
            (a * self.n_theta_i + b, u * v)
            for a, u in self._nodes(phi_i, "phi_i", self.n_phi_i)
            for b, v in self._nodes(theta_i, "theta_i", self.n_theta_i)
        ]
        x, y = self._inverted(u_m, incidence)
        value = 0.0 * wi[2]
        for slot, weight in incidence:
            for k, u in held(y * (self.n - 1.0), self.n):
                for j, v in held(x * (self.n - 1.0), self.n):
                    row = (slot * self.n + k) * self.n + j
                    value = value + weight * u * v * self.values.take(row)  # type: ignore[attr-defined]  # a column
        if self.jacobian:
            u_i = np.sqrt(theta_i * (2.0 / np.pi)), (phi_i + np.pi) / (2.0 * np.pi)
            d = self._bilinear(u_m, "d", self.d_x, self.d_y)
            value = (
                value
                * d
                / (4.0 * np.maximum(self._bilinear(u_i, "sigma", self.sigma_x, self.sigma_y), 1e-12))
            )
        return value

    def _nodes(self, angle: Any, part: str, count: int) -> Corners:
        """The neighbours of an angle among its nodes, and their weights."""
        if count == 1:
            return [(0.0, 1.0)]
        start = self._start(part)
        nodes = [self.warp.take(start + k) for k in range(count)]  # type: ignore[attr-defined]
        place: Any = 0.0
        for low, high in pairwise(nodes):
            place = place + np.minimum(np.maximum((angle - low) / (high - low), 0.0), 1.0)
        return held(place, count)

    def _bilinear(self, u: tuple[Any, Any], part: str, nx: int, ny: int) -> Any:
        start, value = self._start(part), 0.0
        for k, a in held(u[1] * (ny - 1.0), ny):
            for j, b in held(u[0] * (nx - 1.0), nx):
                value = value + a * b * self.warp.take(start + k * nx + j)  # type: ignore[attr-defined]
        return value

    def _inverted(self, u_m: tuple[Any, Any], incidence: Corners) -> tuple[Any, Any]:
        """The place in the unit square that the map takes to ``u_m``: sums up to there over sums of all."""
        nx, ny = self.w_x, self.w_y
        (j, _), (_, x) = held(u_m[0] * (nx - 1.0), nx)
        (k, _), (_, y) = held(u_m[1] * (ny - 1.0), ny)
        start, size = self._start("w"), nx * ny
        stride = 2 * size + ny

        def at(offset: Any) -> Any:
            total: Any = 0.0
            for slot, weight in incidence:
                total = total + weight * self.warp.take(start + slot * stride + offset)  # type: ignore[attr-defined]
            return total

        here = k * nx + j
        c0, c1 = ((1.0 - y) * at(here + step) + y * at(here + nx + step) for step in (0.0, 1.0))
        left = (1.0 - y) * at(size + here) + y * at(size + here + nx)
        r0, r1 = at(size + k * nx + (nx - 1.0)), at(size + k * nx + (2.0 * nx - 1.0))
        across = left + x * (c0 + 0.5 * x * (c1 - c0))
        along = at(2 * size + k) + y * (r0 + 0.5 * y * (r1 - r0))
        return across / np.maximum((1.0 - y) * r0 + y * r1, 1e-12), along

    def sampling(self, wo: Any) -> list[Lobe]:
        """Half-vector lobes, each as strong as D says, over a matte one."""
        start = self._start("d")
        u = [np.sqrt(a / np.pi) for a in WIDTHS]  # theta = a / 2
        d = [self.warp.take(start + int(x * (self.d_x - 1) + 0.5)) for x in u]  # type: ignore[attr-defined]
        weights = [a * a * np.maximum(v, 0.0) + 1e-4 for a, v in zip(WIDTHS, d, strict=True)]
        total: Any = 0.0
        for weight in weights:
            total = total + weight
        lobes = [Lobe(weight, Shape.GGX, width=a) for a, weight in zip(WIDTHS, weights, strict=True)]
        return [*lobes, Lobe(0.5 * total)]

    @classmethod
    def drawn(cls, rng: np.random.Generator, lobes: int = 1) -> Self:
        phi = [np.array([0.0]), np.array([-np.pi, np.pi]), np.linspace(-np.pi, 0.0, 3)][lobes % 3]
        theta = np.array([0.0, 0.4, 1.0, 1.5])
        p, t = len(phi), len(theta)
        made = cls.of(
            theta,
            phi,
            rng.uniform(0.2, 1, (3, 5)),
            rng.uniform(0.5, 1, (2, 3)),
            rng.uniform(0.2, 1, (p, t, 4, 5)),
            rng.uniform(0, 1, (p, t, 6, 6, 3)),
            bool(lobes % 2),
        )
        return made


def sums(vndf: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A density (..., y, x) with integral 1 over its cells, its sums along each row (..., y, x) and the sums of the
    rows (..., y), by trapezoids, cells of size 1."""
    columns = np.zeros(vndf.shape)
    columns[..., 1:] = np.cumsum((vndf[..., 1:] + vndf[..., :-1]) / 2, axis=-1)
    rows = np.zeros(vndf.shape[:-1])
    rows[..., 1:] = np.cumsum((columns[..., 1:, -1] + columns[..., :-1, -1]) / 2, axis=-1)
    total = rows[..., -1]
    return vndf / total[..., None, None], columns / total[..., None, None], rows / total[..., None]


def _by_incidence(*parts: np.ndarray) -> list[np.ndarray]:
    flat = [p.reshape(p.shape[0] * p.shape[1], -1) for p in parts]
    return [np.concatenate(flat, axis=1)]


def _polar(x: Any, y: Any, z: Any) -> Any:
    return np.arctan2(np.sqrt(np.square(x) + np.square(y)), z)
