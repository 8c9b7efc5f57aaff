"""Spherical wavelets over the camera's direction, for a fixed number of incident angles.

    f(theta_i, wo) = max(sum_a lambda_a phi_a(wo) + sum_j sum_m gamma_jm phi_jm(wo), 0)

An octahedron's faces are split in four, ``levels`` times; phi_jm is the hat over the edge m that is split at level j, 1
in its middle and 0 at every other corner; gamma_jm is what f has there beyond the mean of the edge's ends. Where gamma
is small it is left out, and triangles without any below them are not stored: few numbers where f is smooth, many in
a highlight. Schröder and Sweldens show a BRDF so, for one incident direction, with this basis ("linear", of vertices)
among others; to choose what to keep, ``analysis.projection.wavelets`` lifts it as they do.

Not theirs: f runs straight between ``incidences`` angles even in theta_i from 0 to 90°; wo is turned so that wi has
azimuth 0, and mirrored to y >= 0 (isotropic surfaces), which leaves two faces of the octahedron; edges are split in
the flat face and laid on the sphere by their length, so that a point finds its triangle by comparing sums. f is not
reciprocal: light and camera are not treated alike.

``lambda_``: rows 4 k ... 4 k + 3 of incidence k are f at wo = +x, -x, y, z. ``gamma``: three rows a triangle, for the
edges opposite its corners a, b, c. ``child``: four rows a triangle, the numbers of the triangles at a, b, c and in the
middle. Triangle 0 holds zeros and is its own child; triangles 1 + 2 k and 2 + 2 k are the faces of incidence k.
"""

from dataclasses import dataclass
from typing import Any, Self, cast

import numpy as np

from interchange.brdf.base import Brdf
from interchange.brdf.octahedron import splits, tree
from interchange.brdf.sampling import Lobe, Shape, mirror
from interchange.parameter import ParameterError, setting, table
from interchange.table import Table


@dataclass(frozen=True)
class Wavelets(Brdf):
    source = "Schröder, Sweldens: Spherical wavelets: efficiently representing functions on the sphere. SIGGRAPH 1995."
    reciprocal = False
    conserves_energy = False  # coefficients are free

    levels: int = setting(1, "J", 0, 8, "how often a face is split")
    incidences: int = setting(2, "K", 2, 64, "angles of incidence, 0 to 90°")
    lambda_: Table = table(
        Table([0.15] * 4 + [0.15, 0.25, 0.15, 0.15]), "λ", "1/sr", "values at the octahedron's corners"
    )
    gamma: Table = table(
        Table([0.0] * 9 + [0.05, 0.0, 0.0] + [0.05, 0.0, 0.0]), "γ", "1/sr", "details at the middles of edges"
    )
    child: Table = table(Table([0.0] * 20), "c", "1", "numbers of the triangles within a triangle")

    def __post_init__(self) -> None:
        super().__post_init__()
        triangles = len(self.child) // 4
        want = {"lambda_": 4 * self.incidences, "gamma": 3 * triangles, "child": 4 * triangles}
        wrong = [
            f"{k} has {len(getattr(self, k))} rows instead of {n}"
            for k, n in want.items()
            if len(getattr(self, k)) != n
        ]
        if triangles < 1 + 2 * self.incidences:
            wrong.append(f"child has {triangles} triangles, fewer than 1 + 2 incidences")
        numbers = self.child.values
        if not ((numbers >= 0) & (numbers < triangles) & (numbers == np.floor(numbers))).all():
            wrong.append("child holds what is no triangle's number")
        if wrong:
            raise ParameterError(f"Wavelets must hold tables that fit together; {', '.join(wrong)}.")

    def f(self, wi: Any, wo: Any) -> Any:
        x, y, z = turned(wi, wo)
        total = np.absolute(x) + y + z
        corner = (np.absolute(x) / total, y / total, z / total)
        left = np.where(x < 0.0, 1.0, 0.0)
        at = (
            np.arctan2(np.sqrt(np.square(wi[0]) + np.square(wi[1])), wi[2])
            * (2.0 / np.pi)
            * (self.incidences - 1)
        )
        low = np.minimum(np.floor(at), self.incidences - 2.0)
        past = np.minimum(at - low, 1.0)
        value = (1.0 - past) * self._at(low, left, corner) + past * self._at(low + 1.0, left, corner)
        return np.maximum(value, 0.0)

    def _at(self, incidence: Any, left: Any, corner: tuple[Any, Any, Any]) -> Any:
        a, b, c = corner
        coarse, details, children = cast(Any, (self.lambda_, self.gamma, self.child))  # columns, once bound
        row = 4.0 * incidence
        value = a * coarse.take(row + left) + b * coarse.take(row + 2.0) + c * coarse.take(row + 3.0)
        triangle = 1.0 + 2.0 * incidence + left
        for level in range(self.levels):
            for edge, hat in enumerate(hats(a, b, c)):
                value = value + hat * details.take(3.0 * triangle + edge)
            if level + 1 < self.levels:
                which, (a, b, c) = within(a, b, c)
                triangle = np.floor(children.take(4.0 * triangle + which) + 0.5)
        return value

    def sampling(self, wo: Any) -> list[Lobe]:
        axis = mirror(wo)
        return [
            Lobe(0.5),
            *(Lobe(w, Shape.POWER, axis, n) for w, n in ((0.25, 8.0), (0.15, 64.0), (0.1, 400.0))),
        ]

    @classmethod
    def drawn(cls, rng: np.random.Generator, lobes: int = 1) -> Self:
        """Random details, of which half are absent."""
        levels, incidences = 3, lobes + 1
        details = [
            {
                edge[0]: rng.uniform(-0.02, 0.02, 3)
                for level in splits(levels)
                for edge in level
                if rng.uniform() < 0.5
            }
            for _ in range(incidences)
        ]
        gamma, child = tree(details, levels)
        return cls(
            levels, incidences, Table(rng.uniform(0.1, 0.4, (4 * incidences, 3))), Table(gamma), Table(child)
        )


def turned(wi: Any, wo: Any) -> tuple[Any, Any, Any]:
    """``wo`` with the azimuth of ``wi`` taken away, mirrored to y >= 0."""
    x, y = wi[0] + 1e-12, wi[1]  # any azimuth where wi is the normal
    s = np.sqrt(np.square(x) + np.square(y))
    return (wo[0] * x + wo[1] * y) / s, np.absolute(wo[1] * x - wo[0] * y) / s, wo[2]


def hats(a: Any, b: Any, c: Any) -> list[Any]:
    """The hats over the edges opposite a, b, c, at barycentric coordinates."""
    return [
        np.maximum(np.minimum(2.0 * np.minimum(q, r), 1.0 - 2.0 * p), 0.0)
        for p, q, r in ((a, b, c), (b, c, a), (c, a, b))
    ]


def within(a: Any, b: Any, c: Any) -> tuple[Any, tuple[Any, Any, Any]]:
    """Which of the four triangles a point lies in (at corner a, b, c: 0, 1, 2; middle: 3), and where in it.

    The one at a corner keeps its place among the corners and takes the edges' middles for the others; the one in the
    middle has the middles of the edges opposite a, b, c.
    """
    which = np.where(a > 0.5, 0.0, np.where(b > 0.5, 1.0, np.where(c > 0.5, 2.0, 3.0)))
    middle = which > 2.5

    def inside(p: Any) -> Any:
        return np.where(middle, 1.0 - 2.0 * p, np.where(p > 0.5, 2.0 * p - 1.0, 2.0 * p))

    return which, (inside(a), inside(b), inside(c))
