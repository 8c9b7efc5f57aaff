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
