"""The loops over pixels that NumPy does slowly: channels that lie interleaved, and random numbers.

Compiled by Numba on first use and kept on disk. They work on bands of rows and let other threads run.
"""

import numpy as np
from scipy.special import ndtri

from interchange.compiled import jit

CELLS = 4096  # equally likely parts of the normal distribution
# the bounds of those parts; the first and the last reach to infinity and are drawn otherwise
EDGES = ndtri(np.arange(CELLS + 1) / CELLS).astype(np.float32)
TAIL = float(EDGES[-2])
# t (1 - t) of a place t cells from one, up to which interpolation is left alone: edges there were further from the
# captures of a null (docs/blind_history.md), as if it averaged noise of the cells' few samples; why is not proven
NEAR = 0.19
PURE = 0.01  # of an edge's contrast: a cell that is nearer to what is on one side has no part in it
OFF = 0.1  # of an edge's contrast: where its line misses the cells beside it by half as much, it is not sharp for sure

compiled = jit(nogil=True, error_model="numpy", fastmath={"contract", "nsz", "arcp"})


@compiled
def weighted_sum(pixels: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """(r, w, 3) times (3,) -> (r, w, 1) float32."""
    out = np.empty((pixels.shape[0], pixels.shape[1], 1), np.float32)
    a, b, c = weights[0], weights[1], weights[2]
    for i in range(pixels.shape[0]):
        for j in range(pixels.shape[1]):
            out[i, j, 0] = a * pixels[i, j, 0] + b * pixels[i, j, 1] + c * pixels[i, j, 2]
    return out


@compiled
def add_share(out: np.ndarray, pixels: np.ndarray, place: np.ndarray, k: int) -> None:
    """``out`` (r, w, C) += (1 - |place - k|) of ``pixels`` (r or more, w or more, C), where that is above nothing."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            share = np.float32(1) - abs(place[i, j] - np.float32(k))
            if share > 0:
                for c in range(out.shape[2]):
                    out[i, j, c] += share * pixels[i, j, c]


@compiled
def transformed(pixels: np.ndarray, matrix: np.ndarray, offset: np.ndarray) -> np.ndarray:
    """(r, w, 3) -> matrix (3, 3) @ pixel + offset (3,), float32."""
    out = np.empty_like(pixels)
    m00, m01, m02 = matrix[0, 0], matrix[0, 1], matrix[0, 2]
    m10, m11, m12 = matrix[1, 0], matrix[1, 1], matrix[1, 2]
    m20, m21, m22 = matrix[2, 0], matrix[2, 1], matrix[2, 2]
    o0, o1, o2 = offset[0], offset[1], offset[2]
    for i in range(pixels.shape[0]):
        for j in range(pixels.shape[1]):
            a, b, c = pixels[i, j, 0], pixels[i, j, 1], pixels[i, j, 2]
            out[i, j, 0] = m00 * a + m01 * b + m02 * c + o0
            out[i, j, 1] = m10 * a + m11 * b + m12 * c + o1
            out[i, j, 2] = m20 * a + m21 * b + m22 * c + o2
    return out


@compiled
def at_sites(pixels: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """(r, w, 3) -> (r, w, 1): of each pixel the sum of its channels by ``weights`` (2, 2, 3) of its place in 2 x 2."""
    out = np.empty((pixels.shape[0], pixels.shape[1], 1), np.float32)
    even = pixels.shape[1] // 2 * 2
    for i in range(pixels.shape[0]):
        w = weights[i % 2]
        a0, b0, c0 = w[0, 0], w[0, 1], w[0, 2]
        a1, b1, c1 = w[1, 0], w[1, 1], w[1, 2]
        for j in range(0, even, 2):
            out[i, j, 0] = a0 * pixels[i, j, 0] + b0 * pixels[i, j, 1] + c0 * pixels[i, j, 2]
            out[i, j + 1, 0] = a1 * pixels[i, j + 1, 0] + b1 * pixels[i, j + 1, 1] + c1 * pixels[i, j + 1, 2]
        for j in range(even, pixels.shape[1]):
            out[i, j, 0] = a0 * pixels[i, j, 0] + b0 * pixels[i, j, 1] + c0 * pixels[i, j, 2]
    return out


@compiled
def times_field(pixels: np.ndarray, field: np.ndarray) -> np.ndarray:
    """(r, w, 3) times (r, w), float32."""
    out = np.empty_like(pixels)
    for i in range(pixels.shape[0]):
        for j in range(pixels.shape[1]):
            f = field[i, j]
            out[i, j, 0] = f * pixels[i, j, 0]
            out[i, j, 1] = f * pixels[i, j, 1]
            out[i, j, 2] = f * pixels[i, j, 2]
    return out


@compiled
def looked_up(pixels: np.ndarray, table: np.ndarray) -> np.ndarray:
    """``table`` at (n,) whole DN, rounded and clipped to it."""
    out = np.empty(len(pixels), np.float32)
    top = np.float32(len(table) - 1)
    for k in range(len(pixels)):
        out[k] = table[np.uint32(np.rint(min(max(pixels[k], np.float32(0)), top)))]
    return out


@compiled
def _mixed(state: np.uint64) -> np.uint64:
    """64 random bits of a counter that steps by the golden ratio: SplitMix64 (Steele, Lea, Flood 2014)."""
    z = state
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@compiled
def _tail(state: np.uint64) -> tuple[np.uint64, float]:
    """A normal variable beyond ``TAIL`` (Marsaglia 1964)."""
    while True:
        state += np.uint64(0x9E3779B97F4A7C15)
        bits = _mixed(state)
        u = (float(bits >> np.uint64(32)) + 0.5) / 4294967296.0
        v = (float(bits & np.uint64(0xFFFFFFFF)) + 0.5) / 4294967296.0
        x = -np.log(u) / TAIL
        if -2 * np.log(v) > x * x:
            return state, TAIL + x


@compiled
def _poisson(state: np.uint64, mean: float) -> tuple[np.uint64, float]:
    """By inversion, for small means: the number of steps is about the mean."""
    state += np.uint64(0x9E3779B97F4A7C15)
    u = (float(_mixed(state) >> np.uint64(11)) + 0.5) / 9007199254740992.0
    p = np.exp(-mean)
    total, k = p, 0.0
    while u > total and k < 1000.0:
        k += 1.0
        p *= mean / k
        total += p
    return state, k


@compiled
def noisy(
    mean: np.ndarray, sigma: float, exact_below: float, seed: np.uint64, edges: np.ndarray
) -> np.ndarray:
    """Electrons (n,) float32 around ``mean`` (n,): Poisson noise and ``sigma`` e- rms; sensor_noise has the formula."""
    n = len(mean)
    out = np.empty(n, np.float32)
    state = np.uint64(seed)
    size = 1024
    z = np.empty(size, np.float32)
    share = np.float32(1.0 / 1048576.0)
    read = np.float32(sigma * sigma)
    least = np.float32(exact_below)
    for start in range(0, n, size):
        count = min(size, n - start)
        for k in range(0, size, 2):
            state += np.uint64(0x9E3779B97F4A7C15)
            bits = _mixed(state)
            for half in range(2):
                word = np.uint32(bits >> np.uint64(32 * half))
                i = word >> np.uint32(20)
                if i == 0 or i == CELLS - 1:
                    state, far = _tail(state)
                    z[k + half] = -far if i == 0 else far
                else:
                    low = edges[i]
                    z[k + half] = low + (edges[i + 1] - low) * (np.float32(word & np.uint32(0xFFFFF)) * share)
        few = False
        for k in range(count):
            m = mean[start + k]
            lam = max(m, least)
            few |= m < least
            variance = lam + read
            c = lam / variance * np.float32(1 / 6)
            x = z[k]
            out[start + k] = m + np.sqrt(variance - np.float32(2) * c * c) * x + c * (x * x - np.float32(1))
        if few:
            for k in range(count):
                m = mean[start + k]
                if m < least:
                    photons = np.float32(0)
                    if m > 0:
                        state, drawn = _poisson(state, m)
                        photons = np.float32(drawn) - m
                    out[start + k] = m + photons + np.float32(sigma) * z[k]
    return out


@compiled
def corrected(
    pixels: np.ndarray, column: np.ndarray, row: np.ndarray, step: np.ndarray, out: np.ndarray
) -> None:
    """Bilinear ``pixels`` (r + 2, w + 2, C), a border of one around, into ``out`` (r, w, C): corrected by their own
    differences as `interchange.filtering.resample` says. ``column``, ``row`` (r, w): places that were rounded to 1/32;
    ``step`` (2,) float32."""
    one, half, fine = np.float32(1), np.float32(0.5), np.float32(32)
    first_x, first_y = half / step[0], half / step[1]
    second_x, second_y = first_x / step[0], first_y / step[1]
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            x, y = column[i, j], row[i, j]
            near_x, near_y = np.rint(x * fine) / fine, np.rint(y * fine) / fine
            t, u = near_x - np.floor(near_x), near_y - np.floor(near_y)
            slope_x, curve_x = (x - near_x) * first_x, t * (one - t) * second_x
            slope_y, curve_y = (y - near_y) * first_y, u * (one - u) * second_y
            for c in range(out.shape[2]):
                left, right, middle = pixels[i + 1, j, c], pixels[i + 1, j + 2, c], pixels[i + 1, j + 1, c]
                above, below = pixels[i, j + 1, c], pixels[i + 2, j + 1, c]
                twice = middle + middle
                out[i, j, c] = (
                    middle
                    + slope_x * (right - left)
                    - curve_x * (right + left - twice)
                    + slope_y * (below - above)
                    - curve_y * (below + above - twice)
                )


@compiled
def _below(alpha: np.float32, a: np.float32, b: np.float32) -> np.float32:
    """The part of the unit square where ``a`` x + ``b`` y < ``alpha``; ``a``, ``b`` >= 0."""
    if alpha <= 0:
        return np.float32(0)
    if alpha >= a + b:
        return np.float32(1)
    if min(a, b) < np.float32(1e-4) * (a + b):
        return alpha / (a + b)
    over_a, over_b = max(alpha - a, np.float32(0)), max(alpha - b, np.float32(0))
    return (alpha * alpha - over_a * over_a - over_b * over_b) / (np.float32(2) * a * b)


@compiled
def _line(part: np.float32, a: np.float32) -> np.float32:
    """Where the line a x + (1 - a) y = α lies that has ``part`` of the unit square below it, α; ``a`` <= 1/2."""
    half = min(part, np.float32(1) - part)
    alpha = half * (np.float32(1) - a) + np.float32(0.5) * a
    if half * (np.float32(1) - a) < np.float32(0.5) * a:
        alpha = np.sqrt(np.float32(2) * a * (np.float32(1) - a) * half)
    return alpha if part <= np.float32(0.5) else np.float32(1) - alpha


@compiled
def _slope(before: np.float32, own: np.float32, after: np.float32) -> np.float32:
    """A cell's, between its neighbours': none beside an edge (van Leer 1977)."""
    first, second = own - before, after - own
    if first * second <= 0:
        return np.float32(0)
    least = min(np.float32(0.5) * abs(after - before), 2 * min(abs(first), abs(second)))
    return least if after > before else -least


@compiled
def _edge(cells: np.ndarray, k: int, m: int, c: int, faint: float, found: np.ndarray) -> None:
    """Where channel ``c`` of the cell in row ``k`` and column ``m`` has one sharp edge, into ``found`` (6,): how surely
    it has one, from 0 to 1, or -1 beside one; its slopes along both, its line's α, what is above and by how much that
    is more than what is below."""
    up, own, down = cells[k - 1], cells[k], cells[k + 1]
    mean = own[m, c]
    corners_x = up[m + 1, c] + down[m + 1, c] - up[m - 1, c] - down[m - 1, c]
    corners_y = down[m - 1, c] + down[m + 1, c] - up[m - 1, c] - up[m + 1, c]
    gx = corners_x + 2 * (own[m + 1, c] - own[m - 1, c])
    gy = corners_y + 2 * (down[m, c] - up[m, c])
    if abs(gx) >= abs(gy):
        before, first, second, after = own[m - 2, c], own[m - 1, c], own[m + 1, c], own[m + 2, c]
    else:
        before, first, second, after = cells[k - 2][m, c], up[m, c], down[m, c], cells[k + 2][m, c]
    if after < before:
        before, first, second, after = after, second, first, before
    range_ = after - before
    steep = abs(gx) + abs(gy)
    flat = range_ <= faint * max(abs(after), abs(before)) or steep <= np.float32(1e-3) * range_
    found[0] = 0
    if flat or mean < before or mean > after:
        return
    across, along = max(abs(gx), abs(gy)) / steep, min(abs(gx), abs(gy)) / steep
    part = (after - mean) / range_
    if min(part, np.float32(1) - part) < PURE:
        found[0] = -1
        return
    alpha = _line(part, along)
    # what the same line, further on, would give the cells on both sides
    lower = after - range_ * _below(alpha + across, across, along)
    upper = after - range_ * _below(alpha - across, across, along)
    off = max(abs(first - lower), abs(second - upper)) / range_
    found[0] = min(max(np.float32(1.5) - off / np.float32(OFF), np.float32(0)), np.float32(1))
    found[1], found[2], found[3], found[4], found[5] = gx / steep, gy / steep, alpha, after, range_


@compiled
def edges(cells: np.ndarray, row: np.ndarray, column: np.ndarray, faint: float) -> np.ndarray:
    """(n, C, 6) of the cells (H, W, C) in ``row`` and ``column`` (n,), two or more from the rim: what `with_edges`
    takes."""
    out = np.empty((len(row), cells.shape[2], 6), np.float32)
    for n in range(len(row)):
        for c in range(cells.shape[2]):
            _edge(cells, row[n], column[n], c, faint, out[n, c])
    return out


@compiled
def _in_corner(
    cells: np.ndarray, k: int, m: int, c: int, corner: tuple[float, float, float, float], found: np.ndarray
) -> np.float32:
    """The integral of channel ``c`` over a ``corner`` (columns, from and to, and rows, each from 0 to 1) of the cell in
    row ``k`` and column ``m``."""
    x0, x1, y0, y1 = corner
    area = np.float32((x1 - x0) * (y1 - y0))
    total, sure = np.float32(0), max(found[0], np.float32(0))
    if sure < 1:
        own = cells[k, m, c]
        across = _slope(cells[k, m - 1, c], own, cells[k, m + 1, c]) * np.float32(0.5 * (x0 + x1 - 1))
        down = _slope(cells[k - 1, m, c], own, cells[k + 1, m, c]) * np.float32(0.5 * (y0 + y1 - 1))
        total += (np.float32(1) - sure) * area * (own + across + down)
    if sure > 0:
        if found[1] < 0:
            x0, x1 = 1 - x1, 1 - x0
        if found[2] < 0:
            y0, y1 = 1 - y1, 1 - y0
        a, b = abs(found[1]), abs(found[2])
        dark = _below(
            np.float32(found[3] - a * x0 - b * y0), np.float32(a * (x1 - x0)), np.float32(b * (y1 - y0))
        )
        total += sure * area * (found[4] - found[5] * dark)
    return total


@compiled
def with_edges(
    out: np.ndarray,
    cells: np.ndarray,
    place: np.ndarray,
    found: np.ndarray,
    column: np.ndarray,
    row: np.ndarray,
) -> None:
    """``cells`` (H, W, C) at places (r, w) into ``out`` (r, w, C), as `interchange.filtering.resample_cells` says,
    where all four cells that they lie between are among ``edges``: ``place`` (H, W) says which of ``found`` each is, or
    -1."""
    height, width, channels = cells.shape
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            x, y = column[i, j], row[i, j]
            m, k = int(np.floor(x)), int(np.floor(y))
            if m < 0 or k < 0 or m > width - 2 or k > height - 2:
                continue
            p, q, r, s = place[k, m], place[k, m + 1], place[k + 1, m], place[k + 1, m + 1]
            if p < 0 or q < 0 or r < 0 or s < 0:
                continue
            t, u = x - m, y - k
            # of bilinear interpolation's variance, which is what it misses of an edge; 1/4 halfway
            between = max(t * (1 - t), u * (1 - u))
            share = np.float32(min((between - NEAR) / (0.25 - NEAR) * 2, 1.0))
            if share <= 0:
                continue
            for c in range(channels):
                if (
                    found[p, c, 0] == 0
                    and found[q, c, 0] == 0
                    and found[r, c, 0] == 0
                    and found[s, c, 0] == 0
                ):
                    continue
                total = _in_corner(cells, k, m, c, (t, 1.0, u, 1.0), found[p, c])
                total += _in_corner(cells, k, m + 1, c, (0.0, t, u, 1.0), found[q, c])
                total += _in_corner(cells, k + 1, m, c, (t, 1.0, 0.0, u), found[r, c])
                total += _in_corner(cells, k + 1, m + 1, c, (0.0, t, 0.0, u), found[s, c])
                out[i, j, c] += share * (total - out[i, j, c])
