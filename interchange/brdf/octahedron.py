"""A quarter of the sphere (y, z >= 0) as two faces of an octahedron that are split in four again and again.

Points are whole numbers (X, Y, Z) with |X| + Y + Z = 2^levels; a direction is such a point brought to length 1.
"""

from collections.abc import Iterator

import numpy as np

Point = tuple[int, int, int]
Face = tuple[Point, Point, Point]


def corners(levels: int) -> tuple[Point, Point, Point, Point]:
    """The directions +x, -x, y, z."""
    size = 1 << levels
    return (size, 0, 0), (-size, 0, 0), (0, size, 0), (0, 0, size)


def faces(levels: int) -> tuple[Face, Face]:
    right, left, y, z = corners(levels)
    return (right, y, z), (left, y, z)


def middles(face: Face) -> Face:
    """The middles of the edges opposite the three corners."""
    a, b, c = face
    return _middle(b, c), _middle(c, a), _middle(a, b)


def split(face: Face) -> tuple[Face, Face, Face, Face]:
    """The triangles at the three corners and in the middle, corners in the order that ``wavelets.within`` expects."""
    a, b, c = face
    bc, ca, ab = middles(face)
    return (a, ab, ca), (ab, b, bc), (ca, bc, c), (bc, ca, ab)


def splits(levels: int) -> Iterator[list[tuple[Point, Point, Point]]]:
    """For every level the edges that it splits, each once: (middle, end, end)."""
    current = list(faces(levels))
    for _ in range(levels):
        found: dict[Point, tuple[Point, Point, Point]] = {}
        for face in current:
            a, b, c = face
            for middle, ends in zip(middles(face), ((b, c), (c, a), (a, b)), strict=True):
                found.setdefault(middle, (middle, *ends))
        yield list(found.values())
        current = [part for face in current for part in split(face)]


def tree(details: list[dict[Point, np.ndarray]], levels: int) -> tuple[np.ndarray, np.ndarray]:
    """The tables ``gamma`` (3 T, 3) and ``child`` (4 T,) of ``Wavelets`` from details (3,) by their middle, one
    dictionary an incidence; what is absent is 0, and triangles with nothing in them are left out."""
    gamma: list[np.ndarray] = [np.zeros((3, 3)) for _ in range(1 + 2 * len(details))]
    child: list[list[int]] = [[0] * 4 for _ in gamma]

    def grow(face: Face, level: int, own: dict[Point, np.ndarray], number: int) -> bool:
        """Fill triangle ``number``, or one behind the last for 0; False where there is nothing."""
        values = np.array([own.get(m, np.zeros(3)) for m in middles(face)])
        place = number or len(gamma)
        if not number:
            gamma.append(values)
            child.append([0] * 4)
        gamma[place] = values
        if level + 1 < levels:
            for k, part in enumerate(split(face)):
                start = len(gamma)
                child[place][k] = start if grow(part, level + 1, own, 0) else 0
        if number or values.any() or any(child[place]):
            return True
        del gamma[place:], child[place:]
        return False

    for k, own in enumerate(details):
        for side, face in enumerate(faces(levels)):
            if levels:
                grow(face, 0, own, 1 + 2 * k + side)
    return np.concatenate(gamma), np.ravel(child).astype(np.float64)


def _middle(p: Point, q: Point) -> Point:
    return (p[0] + q[0]) // 2, (p[1] + q[1]) // 2, (p[2] + q[2]) // 2
