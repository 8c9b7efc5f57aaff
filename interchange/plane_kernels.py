"""Loops over rows of planes: convolution, magnification, fall-off.

A plane is (rows, P + W + P) float32, ``pad`` P columns at either side, into which the border goes on. ``low`` is the
image's row that a plane begins with, ``height`` the image's rows; a row that is asked for outside the image is the
border's. Loops of a fixed length may read up to ``SLACK`` numbers beyond a plane's end, which the memory of ``local``
has, and use none of them. Inner loops read from buffers that begin with a cache line: vectors of 64 bytes that lie
across two of them take twice the time.
"""

import numpy as np

from interchange.compiled import jit
from interchange.kernels import compiled

LINE = 16  # float32 in a cache line
CHUNK = 128  # columns at a time, a multiple of LINE: what 21 rows need stays in the first cache
SLACK = 4 * CHUNK  # float32 beyond a plane's end
STEP = np.uint64(CHUNK)  # an index that is not signed needs no test for being negative

# sums may be reordered: of some 20 numbers of one sign, an error of 20 · 2^-24
summing = jit(nogil=True, error_model="numpy", fastmath={"contract", "nsz", "arcp", "reassoc"})


@compiled
def aligned(count: int) -> np.ndarray:
    """(count,) float32, not set, beginning with a cache line."""
    buffer = np.empty(count + LINE, np.float32)
    start = (-(buffer.ctypes.data // 4)) % LINE
    return buffer[start : start + count]


@compiled
def extended(plane: np.ndarray, pad: int) -> None:
    """Let the first and the last column go on into the margins."""
    end = plane.shape[1] - pad
    for i in range(plane.shape[0]):
        row = plane[i]
        first, last = row[pad], row[end - 1]
        row[:pad] = first
        row[end:] = last


@compiled
def loaded(pixels: np.ndarray, planes: np.ndarray, pad: int) -> None:
    """Rows (r, W, C) into planes (C, r, P + W + P)."""
    width, channels = pixels.shape[1], pixels.shape[2]
    for i in range(pixels.shape[0]):
        row = pixels[i]
        if channels == 3:
            a, b, c = (
                planes[0, i, pad : pad + width],
                planes[1, i, pad : pad + width],
                planes[2, i, pad : pad + width],
            )
            for x in range(width):
                a[x] = row[x, 0]
            for x in range(width):
                b[x] = row[x, 1]
            for x in range(width):
                c[x] = row[x, 2]
        else:
            for k in range(channels):
                planes[k, i, pad : pad + width] = row[:, k]
    for k in range(channels):
        extended(planes[k], pad)


@summing
def separable(
    plane: np.ndarray,
    low: int,
    height: int,
    out: np.ndarray,
    start: int,
    across: np.ndarray,
    down: np.ndarray,
    pad: int,
) -> None:
    """Convolve with Σ_t down_t across_tᵀ into ``out``, whose first row is the image's ``start``.

    ``across`` (T, 4 G) and ``down`` (T, 4 G) hold the halves of symmetric vectors, middle first, zeros at the end.
    """
    terms, groups = across.shape[0], across.shape[1] // 4
    reach = across.shape[1]
    width = plane.shape[1] - 2 * pad
    # rows beyond the plane's are the border's, or have no weight
    first, stop = max(start - reach + 1, low), min(start + out.shape[0] + reach - 1, low + plane.shape[0])
    rows = stop - first
    pairs, total = aligned(reach * CHUNK), aligned(CHUNK)
    scratch = aligned(terms * rows * CHUNK)
    pairs[:] = 0
    flat = plane.reshape(-1)
    half = down.copy()
    half[:, 0] *= np.float32(0.5)  # the middle comes from both sides
    for x0 in range(0, width, CHUNK):
        n = min(CHUNK, width - x0)
        for i in range(rows):
            row = plane[first - low + i]
            middle = pad + x0
            pairs[:n] = row[middle : middle + n]
            at = (first - low + i) * plane.shape[1] + middle
            for u in range(1, reach):
                _pair(flat, at - u, at + u, pairs, u * CHUNK)
            for t in range(terms):
                for g in range(groups):
                    _four(pairs, 4 * g * CHUNK, across, t, g, scratch, (t * rows + i) * CHUNK)
        for i in range(out.shape[0]):
            y = start + i - first
            top, bottom = 0, rows - 1
            total[:] = 0
            for t in range(terms):
                for g in range(groups):
                    _eight(scratch, t * rows, y, 4 * g, top, bottom, half, t, total)
            out[i, pad + x0 : pad + x0 + n] = total[:n]
    extended(out, pad)


@summing
def _pair(flat: np.ndarray, left: int, right: int, out: np.ndarray, to: int) -> None:
    """out = two stretches of a plane, added."""
    a, b, o = np.uint64(left), np.uint64(right), np.uint64(to)
    for x in range(STEP):
        out[o + x] = flat[a + x] + flat[b + x]


@summing
def _four(
    rows: np.ndarray, at: int, weights: np.ndarray, term: int, g: int, out: np.ndarray, to: int
) -> None:
    """out (+)= Σ of four following rows by the weights of group ``g``; the first group sets."""
    a, o = np.uint64(at), np.uint64(to)
    b, c, d = a + STEP, a + STEP + STEP, a + STEP + STEP + STEP
    w0, w1, w2, w3 = (
        weights[term, 4 * g],
        weights[term, 4 * g + 1],
        weights[term, 4 * g + 2],
        weights[term, 4 * g + 3],
    )
    if g == 0:
        for x in range(STEP):
            out[o + x] = w0 * rows[a + x] + w1 * rows[b + x] + w2 * rows[c + x] + w3 * rows[d + x]
    else:
        for x in range(STEP):
            out[o + x] += w0 * rows[a + x] + w1 * rows[b + x] + w2 * rows[c + x] + w3 * rows[d + x]


@summing
def _eight(
    rows: np.ndarray,
    base: int,
    y: int,
    v: int,
    top: int,
    bottom: int,
    weights: np.ndarray,
    t: int,
    out: np.ndarray,
) -> None:
    """out += Σ of the rows v to v + 3 above and below ``y`` by their weights, within ``top`` and ``bottom``."""
    w0, w1, w2, w3 = weights[t, v], weights[t, v + 1], weights[t, v + 2], weights[t, v + 3]
    a = np.uint64((base + max(y - v, top)) * CHUNK)
    b = np.uint64((base + max(y - v - 1, top)) * CHUNK)
    c = np.uint64((base + max(y - v - 2, top)) * CHUNK)
    d = np.uint64((base + max(y - v - 3, top)) * CHUNK)
    e = np.uint64((base + min(y + v, bottom)) * CHUNK)
    f = np.uint64((base + min(y + v + 1, bottom)) * CHUNK)
    g = np.uint64((base + min(y + v + 2, bottom)) * CHUNK)
    h = np.uint64((base + min(y + v + 3, bottom)) * CHUNK)
    for x in range(STEP):
        out[x] += (w0 * (rows[a + x] + rows[e + x]) + w1 * (rows[b + x] + rows[f + x])) + (
            w2 * (rows[c + x] + rows[g + x]) + w3 * (rows[d + x] + rows[h + x])
        )


@summing
def taps(
    plane: np.ndarray,
    low: int,
    height: int,
    out: np.ndarray,
    start: int,
    offsets: np.ndarray,
    weights: np.ndarray,
    pad: int,
) -> None:
    """out(y, x) = Σ_m weights[m] plane(y + offsets[m, 0], x + offsets[m, 1]); weights a multiple of 4."""
    width = plane.shape[1] - 2 * pad
    for i in range(out.shape[0]):
        into = out[i, pad : pad + width]
        for m in range(0, len(weights), 4):
            y0 = min(max(start + i + offsets[m, 0], 0), height - 1) - low
            y1 = min(max(start + i + offsets[m + 1, 0], 0), height - 1) - low
            y2 = min(max(start + i + offsets[m + 2, 0], 0), height - 1) - low
            y3 = min(max(start + i + offsets[m + 3, 0], 0), height - 1) - low
            x0, x1 = pad + offsets[m, 1], pad + offsets[m + 1, 1]
            x2, x3 = pad + offsets[m + 2, 1], pad + offsets[m + 3, 1]
            p, q = plane[y0, x0 : x0 + width], plane[y1, x1 : x1 + width]
            r, s = plane[y2, x2 : x2 + width], plane[y3, x3 : x3 + width]
            w0, w1, w2, w3 = weights[m], weights[m + 1], weights[m + 2], weights[m + 3]
            if m == 0:
                for x in range(width):
                    into[x] = w0 * p[x] + w1 * q[x] + w2 * r[x] + w3 * s[x]
            else:
                for x in range(width):
                    into[x] += w0 * p[x] + w1 * q[x] + w2 * r[x] + w3 * s[x]
    extended(out, pad)


@summing
def magnified(
    plane: np.ndarray,
    low: int,
    height: int,
    out: np.ndarray,
    start: int,
    centre: np.ndarray,
    per_r2: np.ndarray,
    unit: float,
    aside: np.ndarray,
    pad: int,
) -> None:
    """out(p) = plane(p - aside + (p - centre) m(q)),   m = Σ_k per_r2[k] q^k,   q = |p - centre|² / unit²

    by Lagrange's cubic through 4 x 4 pixels. ``pad`` must be 2 px more than the largest shift.
    """
    width = plane.shape[1] - 2 * pad
    cx, scale = np.float32(centre[0]), np.float32(1 / unit**2)
    m = per_r2.astype(np.float32)
    aside_x, aside_y = np.float32(aside[0]), np.float32(aside[1])
    whole_x, whole_y = np.empty(width, np.int32), np.empty(width, np.int32)
    tx, ty, q, s = aligned(width), aligned(width), aligned(width), aligned(width)
    for i in range(out.shape[0]):
        y = start + i
        dy = np.float32(y - centre[1])
        for x in range(width):
            dx = np.float32(x) - cx
            q[x] = (dx * dx + dy * dy) * scale
        s[:] = m[len(m) - 1]
        for k in range(len(m) - 2, -1, -1):
            c = m[k]
            for x in range(width):
                s[x] = s[x] * q[x] + c
        for x in range(width):
            a = (np.float32(x) - cx) * s[x] - aside_x
            f = np.floor(a)
            whole_x[x] = np.int32(f)
            tx[x] = a - f
        for x in range(width):
            b = dy * s[x] - aside_y
            f = np.floor(b)
            whole_y[x] = np.int32(f)
            ty[x] = b - f
        into = out[i, pad : pad + width]
        x0 = 0
        while x0 < width:  # pixels that are shifted by the same whole ones are taken together
            u, v = whole_x[x0], whole_y[x0]
            stop = x0
            while stop < width:
                n = min(CHUNK, width - stop)
                mixed = 0
                for x in range(stop, stop + n):
                    mixed |= (whole_x[x] ^ u) | (whole_y[x] ^ v)
                if mixed == 0:
                    stop += n
                    continue
                while whole_x[stop] == u and whole_y[stop] == v:
                    stop += 1
                break
            r0 = plane[min(max(y + v - 1, 0), height - 1) - low]
            r1 = plane[min(max(y + v, 0), height - 1) - low]
            r2 = plane[min(max(y + v + 1, 0), height - 1) - low]
            r3 = plane[min(max(y + v + 2, 0), height - 1) - low]
            _cubic(r0, r1, r2, r3, pad + x0 + u - 1, tx[x0:stop], ty[x0:stop], into[x0:stop], stop - x0)
            x0 = stop
    extended(out, pad)


@summing
def _cubic(
    r0: np.ndarray,
    r1: np.ndarray,
    r2: np.ndarray,
    r3: np.ndarray,
    at: int,
    tx: np.ndarray,
    ty: np.ndarray,
    out: np.ndarray,
    n: int,
) -> None:
    """Between 4 x 4 pixels, the first column ``at``, at the shares ``tx``, ``ty`` of the way from the second."""
    a0, a1, a2, a3 = (
        r0[at : at + n],
        r0[at + 1 : at + 1 + n],
        r0[at + 2 : at + 2 + n],
        r0[at + 3 : at + 3 + n],
    )
    b0, b1, b2, b3 = (
        r1[at : at + n],
        r1[at + 1 : at + 1 + n],
        r1[at + 2 : at + 2 + n],
        r1[at + 3 : at + 3 + n],
    )
    c0, c1, c2, c3 = (
        r2[at : at + n],
        r2[at + 1 : at + 1 + n],
        r2[at + 2 : at + 2 + n],
        r2[at + 3 : at + 3 + n],
    )
    d0, d1, d2, d3 = (
        r3[at : at + n],
        r3[at + 1 : at + 1 + n],
        r3[at + 2 : at + 2 + n],
        r3[at + 3 : at + 3 + n],
    )
    one, two, half, sixth = np.float32(1), np.float32(2), np.float32(0.5), np.float32(1 / 6)
    for x in range(n):
        t = tx[x]
        f, g, h = one - t, two - t, one + t
        w0, w1, w2, w3 = -t * f * g * sixth, h * f * g * half, h * t * g * half, -h * t * f * sixth
        s = ty[x]
        f, g, h = one - s, two - s, one + s
        out[x] = (
            -s * f * g * sixth * (w0 * a0[x] + w1 * a1[x] + w2 * a2[x] + w3 * a3[x])
            + h * f * g * half * (w0 * b0[x] + w1 * b1[x] + w2 * b2[x] + w3 * b3[x])
            + h * s * g * half * (w0 * c0[x] + w1 * c1[x] + w2 * c2[x] + w3 * c3[x])
            - h * s * f * sixth * (w0 * d0[x] + w1 * d1[x] + w2 * d2[x] + w3 * d3[x])
        )


@compiled
def dimmed(
    plane: np.ndarray,
    low: int,
    height: int,
    out: np.ndarray,
    start: int,
    centre: np.ndarray,
    a2: float,
    a4: float,
    unit: float,
    pad: int,
) -> None:
    """out = plane times 1 + a2 q + a4 q², not below 0, q as in ``magnified``."""
    width = plane.shape[1] - 2 * pad
    cx, scale = np.float32(centre[0]), np.float32(1 / unit**2)
    b2, b4, one, none = np.float32(a2), np.float32(a4), np.float32(1), np.float32(0)
    for i in range(out.shape[0]):
        dy = np.float32(start + i - centre[1])
        row, into = plane[start - low + i, pad : pad + width], out[i, pad : pad + width]
        for x in range(width):
            dx = np.float32(x) - cx
            q = (dx * dx + dy * dy) * scale
            into[x] = row[x] * max(one + q * (b2 + b4 * q), none)
    extended(out, pad)
