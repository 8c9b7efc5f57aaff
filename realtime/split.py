"""A mesh's faces by the length of their edges: those that a distorting lens shows straight, and those to be split.

The tessellator makes at most 64 pieces of an edge, and finds their number by the edges alone, so larger faces are cut
into patches beforehand: each edge into 1, 2, 4, ... parts by its own length, so that faces that share it agree.
"""

from dataclasses import dataclass

import moderngl
import numpy as np

MOST_PATCHES = 50_000  # of one mesh


@dataclass(eq=False)
class Split:
    """``whole``: indices of the faces that stay whole, None for none; ``vertices`` and ``patches`` of the others, None
    if there are none."""

    whole: moderngl.Buffer | None
    vertices: moderngl.Buffer | None
    patches: moderngl.Buffer | None

    def release(self) -> None:
        for buffer in (self.whole, self.vertices, self.patches):
            if buffer is not None:
                buffer.release()


def edge_lengths(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(F, 3): edge k runs from corner k to the next."""
    corners = vertices[faces]
    return np.asarray(np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2))


def parts(lengths: np.ndarray, patch: float) -> np.ndarray:
    """Into how many parts edges are cut, such that none is longer than ``patch``."""
    return np.asarray(2 ** np.ceil(np.log2(np.maximum(lengths / patch, 1))).astype(int))


def split(
    context: moderngl.Context, rows: np.ndarray, faces: np.ndarray, counts: np.ndarray, long: np.ndarray
) -> Split:
    """``rows`` (V, N) float64 vertices with their attributes; ``counts`` (F, 3): into how many parts to cut each edge,
    where the face is ``long`` (F,) bool."""
    kept = faces[~long]
    whole = context.buffer(np.ascontiguousarray(kept, np.int32).tobytes()) if len(kept) else None
    if not long.any():
        return Split(whole, None, None)
    vertices, patches, first = [], [], 0
    faces, counts = faces[long], counts[long]
    for kind in np.unique(counts, axis=0):
        chosen = rows[faces[(counts == kind).all(axis=1)]]
        weights, pattern = cut(tuple(int(n) for n in kind))
        # along an edge one product is 0, so that the order of the sum makes no difference: both faces cut it alike
        a, b, c = (weights[None, :, i, None] * chosen[:, None, i] for i in range(3))
        vertices.append((a + b + c).reshape(-1, rows.shape[1]))
        steps = first + len(weights) * np.arange(len(chosen))
        patches.append((pattern[None] + steps[:, None, None]).reshape(-1, 3))
        first += len(vertices[-1])
    return Split(
        whole,
        context.buffer(np.concatenate(vertices).astype(np.float32).tobytes()),
        context.buffer(np.concatenate(patches).astype(np.int32).tobytes()),
    )


def cut(counts: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Barycentric coordinates (V, 3) and the parts (P, 3) of a triangle whose edge k is cut into ``counts[k]`` parts,
    powers of 2. It is cut evenly by the greatest; at an edge with fewer, corners fall together."""
    n = max(counts)
    places = [(i, j) for i in range(n + 1) for j in range(n + 1 - i)]  # weights of corners 1 and 2
    number = {place: k for k, place in enumerate(places)}

    def moved(i: int, j: int) -> int:
        pitch = [n // count for count in counts]
        if j == 0:
            i = _nearest(i, pitch[0])
        elif i + j == n:
            j = _nearest(j, pitch[1])
            i = n - j
        elif i == 0:
            j = _nearest(j, pitch[2])
        return number[i, j]

    found = []
    for i in range(n):
        for j in range(n - i):
            found.append((moved(i, j), moved(i + 1, j), moved(i, j + 1)))
            if i + j < n - 1:
                found.append((moved(i + 1, j), moved(i + 1, j + 1), moved(i, j + 1)))
    weights = np.array([(n - i - j, i, j) for i, j in places], np.float64) / n
    return weights, np.array([f for f in found if len(set(f)) == 3])


def _nearest(i: int, pitch: int) -> int:
    return (2 * i + pitch) // (2 * pitch) * pitch
