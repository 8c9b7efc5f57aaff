"""Reflected light on a finer grid than it was drawn on.

It changes slowly over a surface, so the sensor's grid is fine enough for it; where surfaces meet, a fine point takes
the mean of the pixels around it that show the same surface, facing the same way, and nothing else. Every pixel's mean
stays what was drawn.

Kopf, Cohen, Lischinski, Uyttendaele: Joint bilateral upsampling. SIGGRAPH 2007.
"""

import cv2
import numpy as np

REACH, NEAR = 2, 0.8  # px around, and the deviation of their weight
FACING = 10.0  # weight exp(-FACING (1 - n n'))
MIXED = 1e-3  # weight of a pixel that shows other surfaces too
FLAT = 0.02  # 1 - n n' up to which neighbours face the same way
MOST = 2.0  # times that a pixel's mean is corrected by


def finely(planes: np.ndarray, surface: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """(n h, n w, C) float32 of (h, w, C) ``planes``. ``surface`` (n h, n w) tells surfaces apart, ``normal``
    (n h, n w, 3) is unit, NaN where nothing is; of an even n the middle is the part right below it."""
    h, w, channels = planes.shape
    n = surface.shape[0] // h
    if n == 1:
        return planes.astype(np.float32)
    facing = np.nan_to_num(normal).astype(np.float32)
    middle = slice(n // 2, None, n)
    whose, way = surface[middle, middle], facing[middle, middle]
    alone = _alone(surface, facing, whose, way, n)
    out = np.stack(
        [
            cv2.resize(np.ascontiguousarray(planes[..., k], np.float32), (n * w, n * h))
            for k in range(channels)
        ],
        axis=-1,
    )
    near = cv2.erode(alone.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool)
    rough = ~(near & _like_neighbours(whose, way))
    rows, columns = np.nonzero(np.kron(rough, np.ones((n, n), bool)))
    total = np.zeros((len(rows), channels), np.float32)
    weight = np.zeros(len(rows), np.float32)
    own, faces = surface[rows, columns], facing[rows, columns]
    y, x = (((place + 0.5) / n - 0.5).astype(np.float32) for place in (rows, columns))
    for dv in range(-REACH, REACH + 1):
        for du in range(-REACH, REACH + 1):
            v, u = rows // n + dv, columns // n + du
            there = (v >= 0) & (v < h) & (u >= 0) & (u < w)
            away = (y - v.astype(np.float32)) ** 2 + (x - u.astype(np.float32)) ** 2
            v, u = v.clip(0, h - 1), u.clip(0, w - 1)
            alike = np.einsum("nk,nk->n", faces, way[v, u])
            share = np.exp(np.float32(-0.5 / NEAR**2) * away - np.float32(FACING) * (1 - alike))
            share *= there & (own == whose[v, u])
            share *= np.where(alone[v, u], np.float32(1), np.float32(MIXED))
            total += share[:, None] * planes[v, u]
            weight += share
    seen = weight > 0
    out[rows[seen], columns[seen]] = total[seen] / weight[seen, None]
    mean = out.reshape(h, n, w, n, channels).mean(axis=(1, 3))
    ratio = np.divide(planes, mean, out=np.ones_like(mean), where=mean > 0).clip(1 / MOST, MOST)
    return np.asarray(out * np.repeat(np.repeat(ratio, n, axis=0), n, axis=1), np.float32)


def _like_neighbours(whose: np.ndarray, way: np.ndarray) -> np.ndarray:
    """(h, w) bool: pixels with neighbours all around that show the same surface, facing the same way."""
    ones = np.ones((3, 3), np.uint8)
    low, high = cv2.erode(whose.astype(np.float32), ones), cv2.dilate(whose.astype(np.float32), ones)
    spread = cv2.dilate(way, ones) - cv2.erode(way, ones)
    return np.asarray((low == high) & (0.5 * (spread**2).sum(axis=2) < FLAT))


def _alone(surface: np.ndarray, facing: np.ndarray, whose: np.ndarray, way: np.ndarray, n: int) -> np.ndarray:
    """(h, w) bool: pixels that show one surface, facing one way."""
    h, w = whose.shape
    same = np.ones((h, w), bool)
    for v in range(n):
        for u in range(n):
            part = slice(v, None, n), slice(u, None, n)
            same &= (surface[part] == whose) & (1 - (facing[part] * way).sum(axis=-1) < FLAT + (whose < 0))
    return same
