"""A sum of products of two tables, one over the half vector, one over the difference of light and camera.

    f = max(sum_k u_k(h) v_k(d), 0),    h = (wi + wo) / |wi + wo|,    d = (wi - wo) / 2 seen from h

Both tables run straight (bilinearly) between their nodes. ``u``: azimuth of h in ``azimuths`` even steps (1: none, the
surface is isotropic), its polar angle theta_h at nodes even in sqrt(theta_h / 90°), dense where highlights are.
``v``: angle theta_d between h and wi, even from 0 to 90°; twice the azimuth phi_d of d about h, even over 360°: to
exchange light and camera turns phi_d by 180°, so that f is reciprocal whatever the tables hold. Row of u:
(k azimuths + j) nodes_h + i; of v: (k turns + j) nodes_d + i; rows of v of theta_d = 0 ought to be equal, as phi_d has
no meaning there.

Kautz and McCool turn d into a frame of h by Gram and Schmidt from the tangent; here phi_d counts from the plane of
normal and h (Rusinkiewicz 1998), for which an isotropic surface needs no azimuth of h. There phi_d has no meaning
where h is the normal. Cut sums may fall below zero: held at 0.
"""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from interchange.brdf.base import Brdf
from interchange.brdf.sampling import Lobe, Shape
from interchange.parameter import ParameterError, setting, table
from interchange.table import Table

Weighted = list[tuple[Any, Any]]  # (number of a node, its weight)


@dataclass(frozen=True)
class SeparableSvd(Brdf):
    source = (
        "Kautz, McCool: Interactive rendering with arbitrary BRDFs using separable approximations. EGWR 1999."
    )
    isotropic = False  # ``azimuths`` decides
    conserves_energy = False  # tables are free

    rank: int = setting(1, "K", 1, 8, "products in the sum")
    nodes_h: int = setting(4, "n_h", 2, 128, "polar angles of the half vector")
    azimuths: int = setting(1, "m_h", 1, 64, "azimuths of the half vector; 1 where isotropic")
    nodes_d: int = setting(3, "n_d", 2, 64, "polar angles of the difference")
    turns: int = setting(2, "m_d", 1, 64, "azimuths of the difference, over half a turn")
    u: Table = table(Table([1.5, 1.2, 1.0, 1.0]), "u", "1", "factors over the half vector")
    v: Table = table(Table([0.1, 0.1, 0.15] * 2), "v", "1/sr", "factors over the difference")

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, per_rank in (("u", self.azimuths * self.nodes_h), ("v", self.turns * self.nodes_d)):
            if len(getattr(self, name)) != self.rank * per_rank:
                raise ParameterError(
                    f"SeparableSvd.{name} must have {self.rank * per_rank} rows, {per_rank} a product; "
                    f"got {len(getattr(self, name))}."
                )

    def f(self, wi: Any, wo: Any) -> Any:
        half, difference = self.nodes(wi, wo)
        value: Any = 0.0 * wi[2]
        for k in range(self.rank):
            first_u, first_v = k * self.azimuths * self.nodes_h, k * self.turns * self.nodes_d
            value = value + _read(self.u, first_u, half) * _read(self.v, first_v, difference)
        return np.maximum(value, 0.0)

    def nodes(self, wi: Any, wo: Any) -> tuple[Weighted, Weighted]:
        """The nodes of one product's ``u`` and of its ``v`` around a pair of directions, and their weights."""
        theta_h, phi_h, theta_d, twice_phi_d = half_difference(wi, wo)
        at_h = np.sqrt(theta_h * (2.0 / np.pi)) * (self.nodes_h - 1)
        at_d = theta_d * (2.0 / np.pi) * (self.nodes_d - 1)
        return (
            _grid(at_h, self.nodes_h, phi_h, self.azimuths),
            _grid(at_d, self.nodes_d, twice_phi_d, self.turns),
        )

    def sampling(self, wo: Any) -> list[Lobe]:
        return [Lobe(0.4), *(Lobe(0.2, Shape.GGX, width=alpha) for alpha in (0.05, 0.15, 0.4))]

    @classmethod
    def drawn(cls, rng: np.random.Generator, lobes: int = 1) -> Self:
        """Positive tables of ``lobes`` products; isotropic or not."""
        azimuths, turns = int(rng.choice([1, 5])), 4
        u = np.exp(rng.normal(0, 0.5, (lobes * azimuths * 6, 3)))
        v = rng.uniform(0.02, 0.3, (lobes * turns, 5, 3))
        v[:, 0] = v[:1, 0]
        return cls(lobes, 6, azimuths, 5, turns, Table(u), Table(v.reshape(-1, 3)))


def half_difference(wi: Any, wo: Any) -> tuple[Any, Any, Any, Any]:
    """theta_h, phi_h, theta_d and 2 phi_d in rad, phi_d from the plane of normal and half vector."""
    hx, hy, hz = (a + b for a, b in zip(wi, wo, strict=True))
    dx, dy, dz = (a - b for a, b in zip(wi, wo, strict=True))
    across = np.square(hx) + np.square(hy)
    length = np.sqrt(across + np.square(hz))
    theta_h = np.arctan2(np.sqrt(across), hz)
    phi_h = np.arctan2(hy, hx + 1e-20)
    theta_d = np.arctan2(np.sqrt(np.square(dx) + np.square(dy) + np.square(dz)), length)
    # d is perpendicular to h: its part in the plane of n and h is -d.z / sin theta_h, the one across it as below
    along, aside = -dz * length, hx * dy - hy * dx
    twice = np.arctan2(2.0 * along * aside, np.square(along) - np.square(aside) + 1e-30)
    return theta_h, phi_h, theta_d, twice


def _grid(at: Any, rows: int, angle: Any, turns: int) -> Weighted:
    """Bilinear weights of a position ``at`` (held within 0 ... rows - 1) and an angle over a whole turn."""
    low = np.minimum(np.floor(at), rows - 2.0)
    high = np.minimum(at - low, 1.0)
    along = [(low, 1.0 - high), (low + 1.0, high)]
    if turns == 1:
        return along
    round_ = angle * (turns / (2 * np.pi)) + turns
    before = np.floor(round_)
    past = round_ - before
    found: Weighted = []
    for step, weight in ((before, 1.0 - past), (before + 1.0, past)):
        wrapped = step - turns * np.floor((step + 0.5) / turns)
        found += [(wrapped * rows + row, weight * share) for row, share in along]
    return found


def _read(values: Any, first: int, nodes: Weighted) -> Any:
    total: Any = 0.0
    for number, weight in nodes:
        total = total + weight * values.take(number + float(first))
    return total
