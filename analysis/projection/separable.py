"""Singular value decomposition of reflectance over half vector and difference; and the normalised decomposition.

    A_ij = f(h_i, d_j) = sum_k s_k U_ik V_jk,    u_k = sqrt(s_k) U_k,  v_k = sqrt(s_k) V_k

The first K terms are the best rank K in rms (Eckart, Young). A is brought onto the nodes from samples, or from a model
where both directions are above the surface. Nodes that no value touches (a third lie below the horizon) are filled
smoothly; so that the filling costs no rank, u and v are then renewed in turn, such nodes weighing 1e-4. What scattered
samples lose on the way over nodes comes back by ``refined``: u and v in turn, by least squares over the samples
themselves (Cornell's garnet red to 65°, rank 2: docs/representations.md).

Normalised: u_i is the sum over j of A_ij over that of v_j, v_j the sum over i of A_ij over that of u_i, in turn from
v = 1 over the touched nodes: one product, never negative. Kautz, McCool 1999 (a table without gaps needs one turn).
"""

from dataclasses import replace

import numpy as np
from scipy import sparse

from analysis.projection.gridding import along, bends, smooth_fit, steps
from analysis.projection.residual import Projection, prepared, residual, weights
from interchange.brdf.base import Brdf
from interchange.brdf.separable_svd import SeparableSvd, Weighted
from interchange.problems import BrightfieldError
from interchange.reflectance import ReflectanceSamples
from interchange.table import Table

TURNS = 100
POLE = 10.0
FILLED = 1e-4  # weight of a node that no value touches


def separable(
    data: ReflectanceSamples | Brdf,
    rank: int,
    nodes_h: int = 16,
    azimuths: int = 1,
    nodes_d: int = 12,
    turns: int = 1,
    smoothness: float = 1e-3,
    refine: int = 20,
    normalised: bool = False,
) -> Projection[SeparableSvd]:
    """``data`` as a sum of ``rank`` products over tables of the given sizes; ``numbers`` counts both.

    ``azimuths`` 1 takes the surface for isotropic, and then for mirrored at the plane of normal and half vector as
    well. ``turns`` 1 leaves the azimuth of the difference out, so that two angles remain, theta_h and theta_d: what an
    isotropic highlight and few samples near the mirror direction call for. ``refine``: turns of ``refined``, 0 for
    none. ``normalised`` (rank 1 only): the cheaper decomposition, which is not refined.
    """
    if normalised and rank != 1:
        raise BrightfieldError(f"The normalised decomposition has one product; got rank {rank}.")
    frame = SeparableSvd(
        1, nodes_h, azimuths, nodes_d, turns,
        Table(np.zeros(nodes_h * azimuths)), Table(np.zeros(nodes_d * turns)),
    )  # fmt: skip
    samples = prepared(data, 8192)
    if isinstance(data, Brdf):
        gathered = _and_nodes(data, samples, frame)
    else:
        gathered = _and_mirrored(samples) if azimuths == 1 else samples
    grid, touched = on_nodes(gathered, frame, smoothness)
    if normalised:
        u, v = _normalised(grid, touched)
    else:
        u, v = _completed(grid, touched, rank)
        u, v = refined(gathered, frame, u, v, smoothness, refine)
    model = replace(frame, rank=rank, u=Table(u.reshape(-1, 3)), v=Table(v.reshape(-1, 3)))
    return Projection(model, residual(model, samples), len(model.u) + len(model.v))


def refined(
    samples: ReflectanceSamples,
    frame: SeparableSvd,
    u: np.ndarray,
    v: np.ndarray,
    smoothness: float,
    turns: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Tables (K, I, 3) and (K, J, 3) by least squares over the samples, one while the other stands, ``turns`` times."""
    u, v = u.copy(), v.copy()
    half, difference = frame.nodes(tuple(samples.wi.T), tuple(samples.wo.T))
    size_h, size_d = (frame.azimuths, frame.nodes_h), (frame.turns, frame.nodes_d)
    at_h, at_d = _spread(half, len(samples), u.shape[1]), _spread(difference, len(samples), v.shape[1])
    calm_h = sparse.vstack(
        [along(0, size_h, bends(size_h[0], True)), along(1, size_h, level_at_pole(size_h[1]))]
    )
    calm_d = sparse.vstack([along(0, size_d, steps(size_d[0], True)), along(1, size_d, bends(size_d[1]))])
    weight = weights(samples)
    for _ in range(turns):
        for c in range(3):
            for here, there, x, y, calm in ((at_h, at_d, u, v, calm_h), (at_d, at_h, v, u, calm_d)):
                share = weight[:, c : c + 1] * (there @ y[:, :, c].T)
                design = sparse.hstack([sparse.diags(s) @ here for s in share.T]).tocsr()
                normal = (design.T @ design).toarray()
                scale = np.trace(normal) / len(normal)
                hold = smoothness * sparse.kron(sparse.eye(len(x)), calm.T @ calm).toarray()
                normal += scale * (hold + 1e-9 * np.eye(len(normal)))
                right = design.T @ (weight[:, c] * samples.f[:, c])
                x[:, :, c] = np.linalg.solve(normal, right).reshape(len(x), -1)
    v = v.reshape(len(v), *size_d, 3)
    v[:, :, 0] = v[:, :, 0].mean(axis=1, keepdims=True)  # theta_d = 0 has no azimuth
    return u, v.reshape(len(v), -1, 3)


def level_at_pole(count: int) -> sparse.csr_matrix:
    """``bends`` along theta_h, and a strong hold on the first step: a highlight is even about theta_h = 0, where
    hardly a goniometer has samples."""
    first = sparse.csr_matrix(([-POLE, POLE], ([0, 0], [0, 1])), (1, count))
    return sparse.vstack([first, bends(count)]).tocsr()


def _spread(nodes: Weighted, count: int, size: int) -> sparse.csr_matrix:
    """(count, size): how much of each node a sample sees."""
    number = np.concatenate([np.broadcast_to(n, count) for n, _ in nodes]).astype(np.int64)
    share = np.concatenate([np.broadcast_to(w, count) for _, w in nodes])
    return sparse.csr_matrix((share, (np.tile(np.arange(count), len(nodes)), number)), (count, size))


def on_nodes(
    samples: ReflectanceSamples, frame: SeparableSvd, smoothness: float
) -> tuple[np.ndarray, np.ndarray]:
    """(I, J, 3), I = azimuths nodes_h and J = turns nodes_d: reflectance on the nodes of ``frame``'s tables; and
    (I, J) bool: whether any value touches a node."""
    sizes = (frame.azimuths, frame.nodes_h, frame.turns, frame.nodes_d)
    width_d = sizes[2] * sizes[3]
    half, difference = frame.nodes(tuple(samples.wi.T), tuple(samples.wo.T))
    both = [(i * width_d + j, a * b) for i, a in half for j, b in difference]
    spread = _spread(both, len(samples), int(np.prod(sizes)))
    smooth = sparse.vstack(
        [
            along(0, sizes, bends(sizes[0], periodic=True)),
            along(1, sizes, level_at_pole(sizes[1])),
            along(2, sizes, steps(sizes[2], periodic=True)),
            along(3, sizes, bends(sizes[3])),
        ]
    ).tocsr()
    values = samples.f
    grid = smooth_fit(spread, values, smooth, smoothness, weights(samples))
    grid = grid.reshape(sizes[0] * sizes[1], *sizes[2:], 3)
    touched = (abs(spread).sum(axis=0) > 0).A1.reshape(grid.shape[:3])
    inside = np.clip(grid, values.min(axis=0), values.max(axis=0))  # where nothing holds it, a fill may swing
    grid = np.where(touched[..., None], grid, inside)
    grid[:, :, 0] = grid[:, :, 0].mean(axis=1, keepdims=True)  # theta_d = 0 has no azimuth
    touched[:, :, 0] = touched[:, :, 0].any(axis=1, keepdims=True)
    return grid.reshape(-1, width_d, 3), touched.reshape(-1, width_d)


def _and_nodes(brdf: Brdf, samples: ReflectanceSamples, frame: SeparableSvd) -> ReflectanceSamples:
    """``samples`` and ``brdf`` on the nodes themselves, where they lie above the surface."""
    wi, wo = node_directions(frame)
    above = (wi[..., 2] > 0.02) & (wo[..., 2] > 0.02)
    wi, wo = (np.concatenate([a, b[above]]) for a, b in ((samples.wi, wi), (samples.wo, wo)))
    return ReflectanceSamples(wi, wo, brdf.evaluate(wi, wo), channels=samples.channels)


def _and_mirrored(samples: ReflectanceSamples) -> ReflectanceSamples:
    """``samples`` and their images in the plane y = 0."""
    flip = np.array([1.0, -1.0, 1.0])
    wi, wo = (np.concatenate([w, w * flip]) for w in (samples.wi, samples.wo))
    return replace(samples.mirrored(), wi=wi, wo=wo)


def node_directions(frame: SeparableSvd) -> tuple[np.ndarray, np.ndarray]:
    """``wi``, ``wo`` (azimuths, nodes_h, turns, nodes_d, 3) of each pair of nodes; some below the surface."""
    phi_h = 2 * np.pi * np.arange(frame.azimuths)[:, None, None, None] / frame.azimuths
    theta_h = np.pi / 2 * np.linspace(0, 1, frame.nodes_h)[:, None, None] ** 2
    phi_d = np.pi * np.arange(frame.turns)[:, None] / frame.turns
    theta_d = np.pi / 2 * np.linspace(0, 1, frame.nodes_d)
    grid = np.broadcast_arrays(phi_h, theta_h, phi_d, theta_d)
    phi_h, theta_h, phi_d, theta_d = grid
    h = _spherical(theta_h, phi_h)
    plane = _spherical(theta_h + np.pi / 2, phi_h)  # perpendicular to h in the plane of n and h
    across = np.cross(h, plane)
    d = np.sin(theta_d)[..., None] * (np.cos(phi_d)[..., None] * plane + np.sin(phi_d)[..., None] * across)
    along_h = np.cos(theta_d)[..., None] * h
    return along_h + d, along_h - d


def _spherical(theta: np.ndarray, phi: np.ndarray) -> np.ndarray:
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)


def _svd(grid: np.ndarray, rank: int) -> tuple[np.ndarray, np.ndarray]:
    """(rank, I, 3) and (rank, J, 3)."""
    u, s, vt = np.linalg.svd(np.moveaxis(grid, -1, 0), full_matrices=False)
    root = np.sqrt(s[:, :rank])
    sign = np.where(u[:, :, :rank].sum(axis=1) < 0, -1.0, 1.0)
    left = np.einsum("cik,ck->kic", u[:, :, :rank], root * sign)
    return left, np.einsum("ckj,ck->kjc", vt[:, :rank], root * sign)


def _completed(grid: np.ndarray, touched: np.ndarray, rank: int) -> tuple[np.ndarray, np.ndarray]:
    """``_svd`` over the touched nodes: alternating least squares from the smoothly filled table."""
    highest = min(grid.shape[:2])
    if rank > highest:
        raise BrightfieldError(f"The rank must be at most {highest}, the smaller table's nodes; got {rank}.")
    u, v = _svd(grid, rank)
    weight = np.where(touched, 1.0, FILLED)
    for _ in range(TURNS if not touched.all() else 0):
        u = _renewed(grid, v, weight)
        v = _renewed(np.swapaxes(grid, 0, 1), u, weight.T)
    return _svd(np.einsum("kic,kjc->ijc", u, v), rank)


def _renewed(grid: np.ndarray, v: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """The u that with ``v`` (K, J, 3) makes the most of ``grid`` (I, J, 3), weighed (I, J)."""
    gram = np.einsum("ij,kjc,ljc->cikl", weight, v, v, optimize=True)
    gram += 1e-12 * np.trace(gram, axis1=2, axis2=3)[..., None, None] * np.eye(len(v))
    right = np.einsum("ij,ijc,kjc->cik", weight, grid, v, optimize=True)
    return np.moveaxis(np.linalg.solve(gram, right[..., None])[..., 0], (0, 1, 2), (2, 1, 0))


def _normalised(grid: np.ndarray, touched: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(1, I, 3) and (1, J, 3)."""
    use = touched[..., None] & np.ones(3, bool)
    positive = np.where(use, np.maximum(grid, 0.0), 0.0)
    v = np.ones(grid.shape[1:])
    u = np.zeros((len(grid), 3))
    for _ in range(TURNS):
        u = _ratio(positive.sum(axis=1), (use * v).sum(axis=1))
        v = _ratio(positive.sum(axis=0), (use * u[:, None]).sum(axis=0))
    return u[None], v[None]


def _ratio(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.divide(a, b, out=np.zeros_like(a), where=b > 0)
