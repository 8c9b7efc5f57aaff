"""From planes to what a sensor's sites see, and to sums over cells of the image.

Planes are as interchange.plane_kernels has them.
"""

import numpy as np

from interchange.plane_kernels import summing


@summing
def measured(
    a: np.ndarray, b: np.ndarray, c: np.ndarray, out: np.ndarray, start: int, weights: np.ndarray, pad: int
) -> float:
    """out (r, W) = Σ_c weights[y % 2, x % 2, c] of the planes a, b, c: what a mosaic's sites see. Returns its sum."""
    width = out.shape[1]
    by_column = np.empty((2, 3, width), np.float32)
    for i in range(2):
        for k in range(3):
            for x in range(width):
                by_column[i, k, x] = weights[i, x % 2, k]
    total = 0.0
    for i in range(out.shape[0]):
        w, row = by_column[(start + i) % 2], out[i]
        p, q, r = a[i, pad : pad + width], b[i, pad : pad + width], c[i, pad : pad + width]
        wp, wq, wr = w[0], w[1], w[2]
        for x in range(width):
            row[x] = wp[x] * p[x] + wq[x] * q[x] + wr[x] * r[x]
        part = np.float32(0)
        for x in range(width):
            part += row[x]
        total += float(part)
    return total


@summing
def scaled(plane: np.ndarray, out: np.ndarray, factor: float, pad: int) -> float:
    """out (r, W), rows of which may lie apart, = ``factor`` times the plane. Returns its sum."""
    width, f, total = out.shape[1], np.float32(factor), 0.0
    for i in range(out.shape[0]):
        row, into = plane[i, pad : pad + width], out[i]
        part = np.float32(0)
        for x in range(width):
            into[x] = f * row[x]
            part += row[x]
        total += float(part)
    return total * factor


@summing
def binned(plane: np.ndarray, start: int, height: int, sums: np.ndarray, pad: int) -> None:
    """Add a plane's light to ``sums`` (h, w) float64 of even cells of the image, shared by area."""
    width = plane.shape[1] - 2 * pad
    across, down = width / sums.shape[1], height / sums.shape[0]
    line = np.empty(sums.shape[1], np.float64)
    for i in range(plane.shape[0]):
        row = plane[i, pad : pad + width]
        for k in range(len(line)):
            a, b = k * across, min((k + 1) * across, float(width))
            first, last = int(np.ceil(a)), int(np.floor(b))
            if last < first:  # within one pixel
                line[k] = row[last] * (b - a)
                continue
            part = np.float32(0)
            cells = row[first:last]
            for x in range(last - first):
                part += cells[x]
            value = float(part)
            if first > a:
                value += row[first - 1] * (first - a)
            if b > last and last < width:
                value += row[last] * (b - last)
            line[k] = value
        y = float(start + i)
        k = min(int(y / down), len(sums) - 1)
        while k < len(sums) and k * down < y + 1:
            share = min(y + 1, (k + 1) * down) - max(y, k * down)
            if share > 0:
                for x in range(len(line)):
                    sums[k, x] += share * line[x]
            k += 1
