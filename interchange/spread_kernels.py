"""Light shared between the nodes of a grid and spread by each one's kernel: a point-spread function by field position.

Planes are as interchange.plane_kernels has them.
"""

import numpy as np

from interchange.kernels import compiled
from interchange.plane_kernels import CHUNK, STEP, aligned, extended, summing


@summing
def spread(
    plane: np.ndarray,
    low: int,
    height: int,
    out: np.ndarray,
    start: int,
    columns: np.ndarray,
    rows: np.ndarray,
    kernels: np.ndarray,
    halves: np.ndarray,
    pad: int,
) -> None:
    """Light of every pixel shared between the four nodes around it and spread by their kernels; varying_psf has the
    formula. ``columns`` (J,), ``rows`` (I,): places of the nodes; ``kernels`` (I, J, k, k); ``halves`` (I, J): what
    of a kernel is not zero.
    """
    width = plane.shape[1] - 2 * pad
    count, middle = len(columns), kernels.shape[2] // 2
    out[:, :] = 0
    most = 2 * middle + 1
    total, tent = aligned(CHUNK), aligned(CHUNK + most)
    shifted = aligned(((out.shape[0] + most) * most + 8) * CHUNK)
    shifted[:] = 0
    weights = np.empty((out.shape[0], (most * most + 7) // 8 * 8), np.float32)
    flat = plane.reshape(-1)
    node = np.empty(
        out.shape[0] + 2 * middle, np.int64
    )  # of the rows start - middle …: the node above, the share
    share = np.empty(out.shape[0] + 2 * middle, np.float32)
    for i in range(len(node)):
        node[i], share[i] = _between(rows, min(max(start - middle + i, 0), height - 1))
    for j in range(count):
        half = 0
        for i in range(len(node)):
            half = max(half, halves[node[i], j], halves[min(node[i] + 1, len(rows) - 1), j])
        k = 2 * half + 1
        padded = (k * k + 7) // 8 * 8
        # rows are added eight at a time: those behind the last one have no weight, and must hold numbers all the same
        behind = (out.shape[0] + 2 * half) * k * CHUNK
        shifted[behind : behind + 8 * CHUNK] = 0
        for i in range(out.shape[0]):
            for s in range(k):  # the source row start + i - half + s sends its light by v = half - s
                above, t = node[middle + i - half + s], share[middle + i - half + s]
                below = min(above + 1, len(rows) - 1)
                v = middle + half - s
                for u in range(k):
                    a, b = kernels[above, j, v, middle + u - half], kernels[below, j, v, middle + u - half]
                    weights[i, s * k + u] = a + t * (b - a)
            weights[i, k * k : padded] = 0
        left = columns[j - 1] if j > 0 else -1e9
        right = columns[j + 1] if j + 1 < count else 1e9
        begin, end = max(0, int(left) - half), min(width, int(right) + half + 1)
        for x0 in range(begin, end, CHUNK):
            n = min(CHUNK, end - x0)
            for x in range(n + 2 * half):
                at = x0 - half + x
                if at < columns[j]:
                    tent[x] = 1.0 if j == 0 else max(0.0, (at - left) / (columns[j] - left))
                else:
                    tent[x] = 1.0 if j + 1 == count else max(0.0, (right - at) / (right - columns[j]))
            for i in range(out.shape[0] + 2 * half):
                at = (min(max(start - half + i, 0), height - 1) - low) * plane.shape[1] + pad + x0 + half
                for u in range(k):  # light that left u - half columns to the left of where it arrives
                    _shared(flat, at - u, tent, 2 * half - u, shifted, (i * k + u) * CHUNK)
            for i in range(out.shape[0]):
                total[:] = 0
                _added(shifted, i * k, weights, i, padded, total)
                into = out[i, pad + x0 : pad + x0 + n]
                for x in range(n):
                    into[x] += total[x]
    extended(out, pad)


@summing
def _shared(flat: np.ndarray, at: int, tent: np.ndarray, by: int, out: np.ndarray, to: int) -> None:
    """out = a stretch of a plane times a stretch of ``tent``."""
    a, b, o = np.uint64(at), np.uint64(by), np.uint64(to)
    for x in range(STEP):
        out[o + x] = flat[a + x] * tent[b + x]


@summing
def _added(rows: np.ndarray, at: int, weights: np.ndarray, i: int, count: int, out: np.ndarray) -> None:
    """out += Σ_m weights[i, m] of the m-th row from ``at`` on; ``count`` a multiple of 8."""
    for m in range(0, count, 8):
        a = np.uint64((at + m) * CHUNK)
        b, c, d, e = a + STEP, a + np.uint64(2) * STEP, a + np.uint64(3) * STEP, a + np.uint64(4) * STEP
        f, g, h = e + STEP, e + np.uint64(2) * STEP, e + np.uint64(3) * STEP
        w0, w1, w2, w3 = weights[i, m], weights[i, m + 1], weights[i, m + 2], weights[i, m + 3]
        w4, w5, w6, w7 = weights[i, m + 4], weights[i, m + 5], weights[i, m + 6], weights[i, m + 7]
        for x in range(STEP):
            out[x] += (w0 * rows[a + x] + w1 * rows[b + x] + w2 * rows[c + x] + w3 * rows[d + x]) + (
                w4 * rows[e + x] + w5 * rows[f + x] + w6 * rows[g + x] + w7 * rows[h + x]
            )


@compiled
def _between(nodes: np.ndarray, at: float) -> tuple[int, np.float32]:
    """The node at or before a place, and how far the place is on the way to the next."""
    last = len(nodes) - 1
    if last == 0 or at <= nodes[0]:
        return 0, np.float32(0)
    if at >= nodes[last]:
        return last, np.float32(0)
    k = int(np.searchsorted(nodes, at, side="right")) - 1
    return k, np.float32((at - nodes[k]) / (nodes[k + 1] - nodes[k]))
