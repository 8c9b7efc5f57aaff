"""Scattered values onto the nodes of a grid.

    min_x  |w (W x - f)|² + smoothness |w W|² / nodes |S x|²

``W`` spreads nodes to samples (the model's own interpolation), ``S`` are differences that a smooth x keeps small:
they fill nodes that no sample touches, and hardly move the others.
"""

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import cg

from interchange.problems import BrightfieldError


def smooth_fit(
    spread: sparse.csr_matrix,
    values: np.ndarray,
    smooth: sparse.csr_matrix,
    smoothness: float,
    weight: np.ndarray,
) -> np.ndarray:
    """Node values (M, 3) for ``values`` (N, 3), ``weight`` (N, 3). Raises BrightfieldError where the solver stalls."""
    found = np.empty((spread.shape[1], values.shape[1]))
    for c in range(values.shape[1]):
        weighed = sparse.diags(weight[:, c]) @ spread
        normal = weighed.T @ weighed
        scale = normal.diagonal().sum() / max(np.count_nonzero(normal.diagonal()), 1)
        system = (
            normal + smoothness * scale * (smooth.T @ smooth) + 1e-10 * scale * sparse.eye(normal.shape[0])
        ).tocsr()
        right = weighed.T @ (weight[:, c] * values[:, c])
        inverse = sparse.diags(1.0 / system.diagonal())
        start = np.full(normal.shape[0], values[:, c].mean())
        found[:, c], stalled = cg(system, right, x0=start, rtol=1e-8, maxiter=20_000, M=inverse)
        if stalled:
            raise BrightfieldError(
                f"The grid's values must settle within 20000 steps; they did not, at smoothness {smoothness:g}."
            )
    return found


def steps(count: int, periodic: bool = False) -> sparse.csr_matrix:
    """First differences between neighbours of a row of nodes; all around where periodic."""
    rows = count if periodic and count > 2 else count - 1
    if rows <= 0:
        return sparse.csr_matrix((0, count))
    first, second = np.arange(rows), (np.arange(rows) + 1) % count
    data = np.concatenate([-np.ones(rows), np.ones(rows)])
    return sparse.csr_matrix((data, (np.tile(first, 2), np.concatenate([first, second]))), (rows, count))


def bends(count: int, periodic: bool = False) -> sparse.csr_matrix:
    """Second differences along a row of nodes."""
    if count < 3:
        return steps(count, periodic)
    centre = np.arange(count) if periodic else np.arange(1, count - 1)
    rows = np.arange(len(centre))
    columns = np.concatenate([(centre - 1) % count, centre, (centre + 1) % count])
    data = np.repeat([1.0, -2.0, 1.0], len(centre))
    return sparse.csr_matrix((data, (np.tile(rows, 3), columns)), (len(centre), count))


def along(axis: int, sizes: tuple[int, ...], operator: sparse.csr_matrix) -> sparse.csr_matrix:
    """``operator`` along one axis of a grid of ``sizes`` in C order."""
    before, after = int(np.prod(sizes[:axis])), int(np.prod(sizes[axis + 1 :]))
    return sparse.kron(sparse.kron(sparse.eye(before), operator), sparse.eye(after)).tocsr()
