"""Loops of a sensor's read-out: random numbers by pixel, electrons to whole DN in one pass, and a mosaic's colours.

Random numbers are a function of seed and pixel (a counter-based generator: SplitMix64's mixing of seed + n γ; Steele,
Lea, Flood: Fast splittable pseudorandom number generators, OOPSLA 2014): the same however an image is cut into bands.
"""

import numpy as np

from interchange.kernels import _mixed, compiled
from interchange.plane_kernels import aligned, summing

PART = 1024  # pixels at a time: buffers stay in the first cache
GAMMA = np.uint64(0x9E3779B97F4A7C15)
OTHER = np.uint64(0xD1B54A32D192ED03)  # parts the stream of photons drawn one by one from the other

# ln(1 + m), 0 <= m < 1, by Chebyshev's polynomial: within 1e-8
_places = (1 - np.cos((np.arange(10) + 0.5) * np.pi / 10)) / 2
LOG = tuple(np.float32(c) for c in np.linalg.solve(np.vander(_places, increasing=True), np.log1p(_places)))
LN2 = np.float32(np.log(2))
# √2 erf⁻¹ in single precision: Giles, Approximating the erfinv function, GPU Computing Gems 2, 2011, table 5
CENTRAL = tuple(
    np.float32(np.sqrt(2) * c)
    for c in (
        2.81022636e-08, 3.43273939e-07, -3.5233877e-06, -4.39150654e-06, 0.00021858087, -0.00125372503,
        -0.00417768164, 0.246640727, 1.50140941,
    )
)  # fmt: skip
FAR = tuple(
    np.float32(np.sqrt(2) * c)
    for c in (
        -0.000200214257, 0.000100950558, 0.00134934322, -0.00367342844, 0.00573950773, -0.0076224613,
        0.00943887047, 1.00167406, 2.83297682,
    )
)  # fmt: skip
L0, L1, L2, L3, L4, L5, L6, L7, L8, L9 = LOG
C0, C1, C2, C3, C4, C5, C6, C7, C8 = CENTRAL
F0, F1, F2, F3, F4, F5, F6, F7, F8 = FAR


@summing
def normal(seed: np.uint64, first: int, z: np.ndarray, words: np.ndarray, w: np.ndarray) -> None:
    """Standard normal numbers of the pixels ``first`` (even) on; z, w (PART,), words (PART / 2,) uint64."""
    base = seed + np.uint64(first // 2) * GAMMA
    for k in range(np.uint64(PART // 2)):
        words[k] = _mixed(base + k * GAMMA)
    bits = words.view(np.uint32)
    parts = w.view(np.uint32)
    one, two = np.float32(1), np.float32(2)
    for k in range(PART):  # 1 - |x| to 2^-32 relative to the tail, x even in (-1, 1)
        tail = (np.float32(bits[k] >> np.uint32(1)) + np.float32(0.5)) * np.float32(2.0**-31)
        z[k] = tail
        w[k] = tail * (two - tail)  # 1 - x²
    for k in range(PART):
        b = parts[k]
        e = np.float32(np.int32(b >> np.uint32(23)) - np.int32(127))
        # the mantissa m of 2^e (1 + m)
        m = np.float32(b & np.uint32(0x7FFFFF)) * np.float32(2.0**-23)
        ln = L9
        ln = ln * m + L8
        ln = ln * m + L7
        ln = ln * m + L6
        ln = ln * m + L5
        ln = ln * m + L4
        ln = ln * m + L3
        ln = ln * m + L2
        ln = ln * m + L1
        ln = ln * m + L0
        y = -(ln + e * LN2)  # Giles's w
        a = y - np.float32(2.5)
        p = C0
        p = p * a + C1
        p = p * a + C2
        p = p * a + C3
        p = p * a + C4
        p = p * a + C5
        p = p * a + C6
        p = p * a + C7
        p = p * a + C8
        c = np.sqrt(max(y, np.float32(0))) - np.float32(3)
        q = F0
        q = q * c + F1
        q = q * c + F2
        q = q * c + F3
        q = q * c + F4
        q = q * c + F5
        q = q * c + F6
        q = q * c + F7
        q = q * c + F8
        x = one - z[k]
        v = x * (p if y < np.float32(5) else q)
        z[k] = v if bits[k] & np.uint32(1) else -v


@compiled
def _photons(bits: np.uint64, mean: float) -> float:
    """Poisson by inversion, for small means: the number of steps is about the mean."""
    u = (float(bits >> np.uint64(11)) + 0.5) / 9007199254740992.0
    p = np.exp(-mean)
    total, k = p, 0.0
    while u > total and k < 1000.0:
        k += 1.0
        p *= mean / k
        total += p
    return k


@summing
def read_out(
    electrons: np.ndarray,
    first_row: int,
    out: np.ndarray,
    dark: float,
    noisy: bool,
    seed: np.uint64,
    sigma: float,
    exact_below: float,
    gain: np.ndarray,
    offset: np.ndarray,
    rows: np.ndarray,
    columns: np.ndarray,
    full: float,
    K: float,
    black: float,
    top: float,
    balance: np.ndarray,
) -> None:
    """Mean electrons (r, W) to what is read out (r, W): noise, patterns, full well; and DN where ``top`` is not 0.

    ``gain``, ``offset``: (r, W), or of no size where there is none. ``rows`` (r,) and ``columns`` (W,): e- added by
    temporal noise. ``balance`` (2, 2): gains of DN above black by site, as in a raw mosaic.
    """
    width = electrons.shape[1]
    z, w, words = aligned(PART), aligned(PART), np.empty(PART // 2, np.uint64)
    e = aligned(PART)
    read, least = np.float32(sigma * sigma), np.float32(exact_below)
    sd, one, two, sixth = np.float32(sigma), np.float32(1), np.float32(2), np.float32(1 / 6)
    d, well, k_, b, t = np.float32(dark), np.float32(full), np.float32(K), np.float32(black), np.float32(top)
    stride = (width + 1) // 2 * 2
    balanced = np.any(balance != 1)
    by_column = np.empty((2, width), np.float32)
    for i in range(2):
        for x in range(width):
            by_column[i, x] = balance[i, x % 2]
    for i in range(electrons.shape[0]):
        y = first_row + i
        for x0 in range(0, width, PART):
            n = min(PART, width - x0)
            mean = electrons[i, x0 : x0 + n]
            if noisy:
                normal(seed, y * stride + x0, z, words, w)
                few = 0
                for x in range(n):
                    m = mean[x] + d
                    lam = max(m, least)
                    few |= m < least
                    variance = lam + read
                    c = lam / variance * sixth
                    v = z[x]
                    e[x] = m + np.sqrt(variance - two * c * c) * v + c * (v * v - one)
                if few:
                    for x in range(n):
                        m = mean[x] + d
                        if m < least:
                            photons = np.float32(0)
                            if m > 0:
                                counter = np.uint64(y * stride + x0 + x)
                                photons = (
                                    np.float32(_photons(_mixed((seed ^ OTHER) + counter * GAMMA), m)) - m
                                )
                            e[x] = m + photons + sd * z[x]
            else:
                for x in range(n):
                    e[x] = mean[x] + d
            if len(rows) or len(columns):
                r = rows[i]
                add = columns[x0 : x0 + n]
                for x in range(n):
                    e[x] += r + add[x]
            if gain.size:
                g = gain[i, x0 : x0 + n]
                for x in range(n):
                    e[x] *= g[x]
            if offset.size:
                o = offset[i, x0 : x0 + n]
                for x in range(n):
                    e[x] += o[x]
            into = out[i, x0 : x0 + n]
            if t == 0:
                for x in range(n):
                    into[x] = min(e[x], well)
                continue
            for x in range(n):
                e[x] = min(max(np.rint(min(e[x], well) * k_ + b), np.float32(0)), t)
            if balanced:
                scale = by_column[y % 2, x0 : x0 + n]
                for x in range(n):
                    e[x] = min(max(np.rint((e[x] - b) * scale[x] + b), np.float32(0)), t)
            for x in range(n):
                into[x] = e[x]


@summing
def veiled(electrons: np.ndarray, first_row: int, height: int, veil: np.ndarray) -> None:
    """Add ``veil`` (2, 2, h, w), electrons by site, drawn larger bilinearly between the middles of its cells."""
    width = electrons.shape[1]
    cells_y, cells_x = veil.shape[2], veil.shape[3]
    left, share = np.empty(width, np.int64), np.empty(width, np.float32)
    for x in range(width):
        at = min(max((x + 0.5) * cells_x / width - 0.5, 0.0), cells_x - 1.0)
        left[x] = min(int(at), max(cells_x - 2, 0))
        share[x] = at - left[x]
    line = np.empty((2, cells_x + 1), np.float32)
    for i in range(electrons.shape[0]):
        y = first_row + i
        at = min(max((y + 0.5) * cells_y / height - 0.5, 0.0), cells_y - 1.0)
        above = min(int(at), max(cells_y - 2, 0))
        below, t = min(above + 1, cells_y - 1), np.float32(at - above)
        for j in range(2):
            v = veil[y % 2, j]
            for k in range(cells_x):
                line[j, k] = v[above, k] + t * (v[below, k] - v[above, k])
            line[j, cells_x] = line[j, cells_x - 1]
        row = electrons[i]
        if cells_x == 1:
            for j in range(2):
                row[j::2] += line[j, 0]
        else:
            for j in range(2):
                for x in range(j, width, 2):
                    k = left[x]
                    row[x] += line[j, k] + share[x] * (line[j, k + 1] - line[j, k])


@summing
def developed(
    raw: np.ndarray,
    first: int,
    stop: int,
    red_row: int,
    red_column: int,
    matrix: np.ndarray,
    offset: np.ndarray,
    table: np.ndarray,
    out: np.ndarray,
) -> None:
    """Rows ``first`` to ``stop`` of a mosaic (H, W) uint16 as colours: bilinear, then matrix, then table, into
    out (H, W, 3).

    The red site of a 2 x 2 lies at (``red_row``, ``red_column``). Averages are rounded and the border repeats its
    neighbours' colours, as OpenCV's do.
    """
    height, width = raw.shape
    own, green, other = np.empty(width, np.float32), np.empty(width, np.float32), np.empty(width, np.float32)
    values = np.empty(width, np.int32)
    top = np.float32(len(table) - 1)
    one, two = np.int32(1), np.int32(2)
    for y in range(first, stop):
        inside = min(max(y, 1), height - 2)
        above, row, below = raw[inside - 1], raw[inside], raw[inside + 1]
        red = inside % 2 == red_row
        column = red_column if red else 1 - red_column  # of the sites of this row's own colour
        n = width - 2
        u0, u1, u2 = above[:n], above[1 : n + 1], above[2 : n + 2]
        c0, c1, c2 = row[:n], row[1 : n + 1], row[2 : n + 2]
        d0, d1, d2 = below[:n], below[1 : n + 1], below[2 : n + 2]
        a, g, b = own[1 : n + 1], green[1 : n + 1], other[1 : n + 1]
        odd = 1 - column  # x - 1 counts from the second column
        for x in range(n):
            here = np.int32(c1[x])
            across, down = np.int32(c0[x]) + np.int32(c2[x]), np.int32(u1[x]) + np.int32(d1[x])
            corners = np.int32(u0[x]) + np.int32(u2[x]) + np.int32(d0[x]) + np.int32(d2[x])
            mine = (x & 1) == odd
            a[x] = here if mine else (across + one) >> one
            g[x] = (across + down + two) >> two if mine else here
            b[x] = (corners + two) >> two if mine else (down + one) >> one
        for plane in (own, green, other):
            plane[0], plane[width - 1] = plane[1], plane[width - 2]
        r, blue = (own, other) if red else (other, own)
        for c in range(3):
            m0, m1, m2, m3 = matrix[c, 0], matrix[c, 1], matrix[c, 2], offset[c]
            for x in range(width):
                v = m0 * r[x] + m1 * green[x] + m2 * blue[x] + m3
                values[x] = np.int32(np.rint(min(max(v, np.float32(0)), top)))
            into = out[y, :, c]
            for x in range(width):
                into[x] = table[values[x]]
