"""The lifted spherical wavelet transform, and reflectance onto its largest coefficients.

    split     gamma_m = lambda_m - (lambda_p + lambda_q) / 2           m the middle of the edge p q
    lift      lambda_p += s_mp gamma_m,  s_mp = I_m / (2 I_p)          so that every wavelet's integral is 0

I are integrals of the hats over the sphere; with lifting a coefficient that is left out does not change the mean of
the level. Backwards in the other order, exactly. Schröder, Sweldens: Spherical wavelets. SIGGRAPH 1995, "linear".

A coefficient is kept if its part in the rms of f, |gamma_m| sqrt(I_m), is among the largest. What is kept is turned
back into values, and these into the hats that ``interchange.brdf.wavelets`` adds up (the transform without lifting),
which are few where few coefficients were kept.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy import sparse

from analysis.projection.gridding import along, bends, smooth_fit
from analysis.projection.residual import Projection, prepared, residual, weights
from interchange.brdf.base import Brdf
from interchange.brdf.octahedron import Point, corners, faces, split, splits, tree
from interchange.brdf.wavelets import Wavelets, turned, within
from interchange.reflectance import ReflectanceSamples
from interchange.table import Table


@dataclass(frozen=True, eq=False)
class Grid:
    """The vertices of a quarter sphere split ``levels`` times, coarse ones first: ``points`` and ``number`` of them,
    ``edges`` a level (M, 3) of vertices (middle, end, end), ``area`` (levels + 1) arrays of hats' integrals, sr."""

    points: list[Point]
    number: dict[Point, int]
    edges: list[np.ndarray]
    area: list[np.ndarray]

    @property
    def directions(self) -> np.ndarray:
        """(V, 3) unit vectors."""
        p = np.array(self.points, np.float64)
        return np.asarray(p / np.linalg.norm(p, axis=1, keepdims=True))


@lru_cache(maxsize=4)
def grid(levels: int) -> Grid:
    points = list(corners(levels))
    found = [list(level) for level in splits(levels)]
    points += [middle for level in found for middle, _, _ in level]
    number = {p: k for k, p in enumerate(points)}
    edges = [np.array([[number[p] for p in edge] for edge in level], np.int64) for level in found]
    w = np.array(points, np.float64)
    w /= np.linalg.norm(w, axis=1, keepdims=True)
    area = [np.zeros(len(points))]
    for face in finest(levels):
        a, b, c = (number[p] for p in face)
        share = 2 * np.arctan2(w[a] @ np.cross(w[b], w[c]), 1 + w[a] @ w[b] + w[b] @ w[c] + w[c] @ w[a])
        area[0][[a, b, c]] += abs(share) / 3  # van Oosterom, Strackee 1983
    for level in reversed(edges):
        coarse = area[0].copy()
        np.add.at(coarse, level[:, 1:], area[0][level[:, :1]] / 2)
        coarse[level[:, 0]] = 0.0
        area.insert(0, coarse)
    return Grid(points, number, edges, area)


def finest(levels: int) -> Iterator[tuple[Point, Point, Point]]:
    current = list(faces(levels))
    for _ in range(levels):
        current = [part for face in current for part in split(face)]
    yield from current


def forward(values: np.ndarray, levels: int, lifted: bool = True) -> np.ndarray:
    """Coefficients (V, ...) of values (V, ...) on ``grid(levels)``: coarse values, then details by level."""
    own, result = grid(levels), np.array(values, np.float64)
    for level in reversed(range(levels)):
        middle, ends = own.edges[level][:, 0], own.edges[level][:, 1:]
        result[middle] -= result[ends].mean(axis=1)
        if lifted:
            _lift(result, own, level, 1.0)
    return result


def backward(coefficients: np.ndarray, levels: int, lifted: bool = True) -> np.ndarray:
    """Values of coefficients: the inverse of ``forward``."""
    own, result = grid(levels), np.array(coefficients, np.float64)
    for level in range(levels):
        middle, ends = own.edges[level][:, 0], own.edges[level][:, 1:]
        if lifted:
            _lift(result, own, level, -1.0)
        result[middle] += result[ends].mean(axis=1)
    return result


def _lift(values: np.ndarray, own: Grid, level: int, sign: float) -> None:
    middle, fine, coarse = own.edges[level][:, 0], own.area[level + 1], own.area[level]
    for end in own.edges[level][:, 1:].T:
        share = sign * fine[middle] / (2 * coarse[end])
        np.add.at(values, end, share.reshape(-1, *[1] * (values.ndim - 1)) * values[middle])


def wavelets(
    data: ReflectanceSamples | Brdf,
    keep: int,
    levels: int = 4,
    incidences: int = 10,
    smoothness: float = 1e-3,
) -> Projection[Wavelets]:
    """``data`` on the ``keep`` coefficients that matter most, over all incidences; ``numbers`` counts these.

    Isotropic surfaces. The finest triangles are about 90° / 2^levels wide; incidences are 90° / (incidences - 1) apart.
    """
    samples = prepared(data)
    values = (
        sampled(data, levels, incidences)
        if isinstance(data, Brdf)
        else gridded(samples, levels, incidences, smoothness)
    )
    own = grid(levels)
    coefficients = np.stack([forward(v, levels) for v in values])  # (K, V, 3)
    level_area = own.area[0].copy()
    for level, edges in enumerate(own.edges):
        level_area[edges[:, 0]] = own.area[level + 1][edges[:, 0]]
    size = np.abs(coefficients).max(axis=-1) * np.sqrt(level_area)
    small = np.argsort(size, axis=None, kind="stable")[: max(size.size - keep, 0)]
    coefficients.reshape(-1, 3)[small] = 0.0
    kept = int((np.abs(coefficients).max(axis=-1) > 0).sum())
    model = assemble(np.stack([backward(c, levels) for c in coefficients]), levels)
    return Projection(model, residual(model, samples), kept)


def assemble(values: np.ndarray, levels: int) -> Wavelets:
    """The model that runs through ``values`` (K, V, 3) on ``grid(levels)`` at K incidences."""
    own = grid(levels)
    coarse, details = [], []
    for k in range(len(values)):
        hats = forward(values[k], levels, lifted=False)
        coarse.append(hats[:4])
        floor = 1e-9 * np.abs(values).max()
        kept = 4 + np.flatnonzero(np.abs(hats[4:]).max(axis=-1) > floor)
        details.append({own.points[m]: hats[m] for m in kept})
    gamma, child = tree(details, levels)
    return Wavelets(
        levels, len(values), Table(np.concatenate(coarse)), Table(gamma.reshape(-1, 3)), Table(child)
    )


def sampled(brdf: Brdf, levels: int, incidences: int) -> np.ndarray:
    """(K, V, 3) reflectance of a model at the vertices; where either direction is level, just above the surface."""
    theta = np.linspace(0, np.pi / 2, incidences)
    wi = _raised(np.stack([np.sin(theta), 0 * theta, np.cos(theta)], axis=-1))
    return brdf.evaluate(wi[:, None], _raised(grid(levels).directions))


def _raised(w: np.ndarray) -> np.ndarray:
    w = np.concatenate([w[..., :2], np.maximum(w[..., 2:], 1e-3)], axis=-1)
    return np.asarray(w / np.linalg.norm(w, axis=-1, keepdims=True))


def gridded(samples: ReflectanceSamples, levels: int, incidences: int, smoothness: float) -> np.ndarray:
    """(K, V, 3) values that interpolate as the model does and fit samples, smooth where there are none."""
    own, count = grid(levels), len(samples)
    vertices = len(own.points)
    x, y, z = turned(tuple(samples.wi.T), tuple(samples.wo.T))
    at = samples.theta[0] / (np.pi / 2) * (incidences - 1)
    low = np.minimum(np.floor(at), incidences - 2.0).astype(np.int64)
    corner, share = locate(np.stack([x, y, z], axis=1), levels)
    columns = np.concatenate([((low + k)[:, None] * vertices + corner).ravel() for k in (0, 1)])
    past = (at - low)[:, None]
    data = np.concatenate([((1 - past) * share).ravel(), (past * share).ravel()])
    rows = np.tile(np.repeat(np.arange(count), 3), 2)
    spread = sparse.csr_matrix((data, (rows, columns)), (count, incidences * vertices))
    sizes = (incidences, vertices)
    smooth = sparse.vstack([along(0, sizes, bends(incidences)), along(1, sizes, laplacian(levels))]).tocsr()
    found = smooth_fit(spread, samples.f, smooth, smoothness, weights(samples))
    return found.reshape(incidences, vertices, 3)


def locate(w: np.ndarray, levels: int) -> tuple[np.ndarray, np.ndarray]:
    """The finest triangle around directions (N, 3), y and z >= 0: its vertices (N, 3) and their weights (N, 3)."""
    plane = np.abs(w) / np.abs(w).sum(axis=1, keepdims=True)
    a, b, c = plane.T
    place = np.array(faces(levels))[(w[:, 0] < 0).astype(int)]  # (N, 3 corners, 3 coordinates)
    for _ in range(levels):
        which, (a, b, c) = within(a, b, c)
        middle = (np.roll(place, -1, axis=1) + np.roll(place, 1, axis=1)) // 2  # opposite each corner
        chosen = middle.copy()
        for k in range(3):
            at = which == k
            # the triangle at corner k keeps it; its other two corners are the middles of k's two edges
            chosen[at, k] = place[at, k]
            chosen[at, (k + 1) % 3] = middle[at, (k + 2) % 3]
            chosen[at, (k + 2) % 3] = middle[at, (k + 1) % 3]
        place = chosen
    number = grid(levels).number
    corner = np.array([[number[(int(p[0]), int(p[1]), int(p[2]))] for p in face] for face in place])
    return corner, np.stack([a, b, c], axis=1)


def laplacian(levels: int) -> sparse.csr_matrix:
    """(V, V): each vertex less the mean of its neighbours on the finest grid, times 2 as ``bends``."""
    own = grid(levels)
    pairs = {
        tuple(sorted((own.number[p], own.number[q])))
        for face in finest(levels)
        for p, q in zip(face, (*face[1:], face[0]), strict=True)
    }
    i, j = np.array(sorted(pairs)).T
    size = len(own.points)
    joined = sparse.csr_matrix((np.ones(2 * len(i)), (np.append(i, j), np.append(j, i))), (size, size))
    return (2 * (sparse.eye(size) - sparse.diags(1 / joined.sum(axis=1).A1) @ joined)).tocsr()
