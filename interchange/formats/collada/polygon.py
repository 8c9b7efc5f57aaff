"""Triangles of a polygon that is concave or has holes, by clipping ears.

Each hole is joined to the outline by a bridge to a vertex that it sees (Eberly: Triangulation by ear clipping,
geometrictools.com, 2002); then a corner whose triangle holds no other vertex is cut off, until one is left.
"""

import numpy as np

MOST_CORNERS = 10_000  # the time grows with the square


def newell_normal(points: np.ndarray) -> np.ndarray:
    """(3,) normal, twice the area long, of a polygon (N, 3) that need not be flat."""
    following = np.roll(points, -1, axis=0)
    return 0.5 * np.sum(np.cross(points - points[0], following - points[0]), axis=0) * 2.0


def is_convex(polygons: np.ndarray) -> np.ndarray:
    """(F,) whether each of the polygons (F, N, 3) with N corners turns one way all round, and once only."""
    edge = np.roll(polygons, -1, axis=1) - polygons
    turn = np.cross(edge, np.roll(edge, -1, axis=1))
    normal = np.sum(
        np.cross(polygons - polygons[:, :1], np.roll(polygons, -1, axis=1) - polygons[:, :1]), axis=1
    )
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    along = np.einsum("fni,fi->fn", turn, normal)
    once = np.ones(len(polygons), bool)
    if polygons.shape[1] > 4:  # a star turns one way too, but more than once
        cos = np.einsum("fni,fni->fn", edge, np.roll(edge, -1, axis=1))
        sine = along / np.where(size > 0, size, 1)
        once = np.abs(np.sum(np.arctan2(sine, cos), axis=1)) < 3 * np.pi
    return (along >= -1e-9 * size**2).all(axis=1) & once


def triangulate(rings: list[np.ndarray]) -> np.ndarray:
    """(T, 3) indices into the concatenated ``rings``: the outline (N, 3), then the holes, in any sense of turning.

    The triangles turn as the outline does. More than ``MOST_CORNERS`` corners raise ValueError.
    """
    if sum(map(len, rings)) > MOST_CORNERS:
        raise ValueError(f"A concave polygon may have {MOST_CORNERS} corners at most.")
    points = _flattened(rings)
    starts = np.concatenate([[0], np.cumsum([len(r) for r in rings])])
    loop = list(range(starts[1]))
    holes = []
    for i in range(1, len(rings)):
        ring = list(range(starts[i], starts[i + 1]))
        if len(ring) < 3:
            continue
        if _area(points[ring]) > 0:
            ring.reverse()
        holes.append(ring)
    for ring in sorted(holes, key=lambda r: -points[r, 0].max()):
        loop = _bridged(loop, ring, points)
    return _ears(np.array(loop), points)


def _flattened(rings: list[np.ndarray]) -> np.ndarray:
    """(N, 2): all corners in a plane in which the outline turns counter-clockwise."""
    normal = newell_normal(rings[0])
    length = np.linalg.norm(normal)
    n = normal / length if length > 0 else np.array([0.0, 0.0, 1.0])
    x = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
    x /= np.linalg.norm(x)
    return (np.concatenate(rings) - rings[0][0]) @ np.stack([x, np.cross(n, x)], axis=1)


def _area(p: np.ndarray) -> float:
    following = np.roll(p, -1, axis=0)
    return 0.5 * float(np.sum(p[:, 0] * following[:, 1] - p[:, 1] * following[:, 0]))


def _turn(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    return (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1]) - (b[..., 1] - a[..., 1]) * (
        c[..., 0] - a[..., 0]
    )


def _bridged(loop: list[int], hole: list[int], points: np.ndarray) -> list[int]:
    """The outline with a hole spliced in: from the hole's rightmost corner to an outline corner that it sees."""
    start = int(np.argmax(points[hole, 0]))
    m = points[hole[start]]
    outline = np.array(loop)
    a, b = points[outline], points[np.roll(outline, -1)]
    rising = (a[:, 1] <= m[1]) & (b[:, 1] > m[1])  # the outline turns left: its right side goes up
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = a[:, 0] + (m[1] - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0])
    crossing = np.where(rising & (crossing >= m[0] - 1e-12), crossing, np.inf)
    edge = int(np.argmin(crossing))
    if np.isfinite(crossing[edge]):
        seen = edge if a[edge, 0] > b[edge, 0] else (edge + 1) % len(loop)
        hit = np.array([crossing[edge], m[1]])
        corner = points[outline[seen]]
        triangle = np.array([m, hit, corner] if corner[1] > m[1] else [m, corner, hit])
        inside = _inside(triangle, points[outline]) & (points[outline] != corner).any(axis=1)
        if inside.any():  # a corner in between hides it: the one nearest to the ray is seen
            found = np.flatnonzero(inside)
            offset = points[outline[found]] - m
            angle = np.abs(np.arctan2(offset[:, 1], offset[:, 0]))
            seen = int(found[np.lexsort((np.linalg.norm(offset, axis=1), angle))[0]])
        # earlier bridges run twice through their ends: take the visit whose corner opens towards the hole
        twins = np.flatnonzero((points[outline] == points[outline[seen]]).all(axis=1))
        seen = int(next((t for t in twins if _opens(points[outline], t, m)), seen))
    else:  # the hole lies outside its outline: any bridge will do
        seen = int(np.argmin(np.linalg.norm(points[outline] - m, axis=1)))
    turned = hole[start:] + hole[:start]
    return [*loop[: seen + 1], *turned, turned[0], *loop[seen:]]


def _opens(loop: np.ndarray, i: int, p: np.ndarray) -> bool:
    """Whether the way from corner ``i`` of a loop to ``p`` starts on the loop's left side."""
    before, here, after = loop[i - 1], loop[i], loop[(i + 1) % len(loop)]
    sides = (bool(_turn(before, here, p) >= 0), bool(_turn(here, after, p) >= 0))
    return all(sides) if _turn(before, here, after) > 0 else any(sides)


def _inside(triangle: np.ndarray, p: np.ndarray) -> np.ndarray:
    a, b, c = triangle
    return (_turn(a, b, p) >= 0) & (_turn(b, c, p) >= 0) & (_turn(c, a, p) >= 0)


def _ears(loop: np.ndarray, points: np.ndarray) -> np.ndarray:
    p = points[loop]
    n = len(loop)
    before, after = np.roll(np.arange(n), 1), np.roll(np.arange(n), -1)
    alive = np.ones(n, bool)
    reflex = _turn(p[before], p, p[after]) <= 0
    triangles: list[tuple[int, int, int]] = []
    i, waited, left = 0, 0, n
    while left > 3:
        h, j = before[i], after[i]
        ear = not reflex[i]
        if ear:
            others = np.flatnonzero(alive & reflex)
            others = others[(others != h) & (others != j)]
            corners = p[[h, i, j]]
            blocking = _inside(corners, p[others])
            if blocking.any():  # the twin of a bridge's end touches, but does not block
                blocking &= ~(p[others][:, None] == corners).all(axis=2).any(axis=1)
            ear = not blocking.any()
        if ear or waited > left:  # nothing but degenerate corners: cut one anyway
            triangles.append((loop[h], loop[i], loop[j]))
            alive[i] = False
            after[h], before[j] = j, h
            for k in (h, j):
                reflex[k] = _turn(p[before[k]], p[k], p[after[k]]) <= 0
            left -= 1
            waited = 0
            i = after[j]
        else:
            waited += 1
            i = j
    rest = np.flatnonzero(alive)
    triangles.append((loop[rest[0]], loop[rest[1]], loop[rest[2]]))
    return np.array(triangles, np.int64)
