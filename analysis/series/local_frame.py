"""Directions in each pixel's own frame: what makes features independent of how the surface is turned."""

import numpy as np

from interchange.problems import BrightfieldError
from interchange.series import Series


def frames_of(normals: np.ndarray) -> np.ndarray:
    """(H, W, 3, 3): tangent, bitangent and normal as rows; the tangent is x laid onto the surface."""
    n = np.asarray(normals, np.float64)
    axis = np.where(np.abs(n[..., :1]) < 0.9, [1.0, 0, 0], [0.0, 1, 0])
    t = axis - n * np.sum(axis * n, axis=-1, keepdims=True)
    t = t / np.linalg.norm(t, axis=-1, keepdims=True)
    return np.stack([t, np.cross(n, t), n], axis=-2)


def cosines(series: Series, normals: np.ndarray | None = None) -> np.ndarray:
    """(L, H, W) or (L, 1, 1): cos θ_i at every pixel; ``normals`` (H, W, 3), None for z everywhere."""
    wi = series.wi
    if normals is None:
        return wi[..., 2] if wi.ndim == 4 else wi[:, 2][:, None, None]
    if np.shape(normals) != (*series.shape, 3):
        raise BrightfieldError(
            f"Normals must have the shape {(*series.shape, 3)} of the images; got {np.shape(normals)}."
        )
    if wi.ndim == 4:
        return np.einsum("lhwk,hwk->lhw", wi, normals)
    return np.einsum("lk,hwk->lhw", wi, normals)


def local(series: Series, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """``wi`` (L, H, W, 3) and ``wo`` (H, W, 3) in the frames of the pixels."""
    frames = frames_of(normals)
    wi = series.wi if series.wi.ndim == 4 else series.wi[:, None, None]
    wi = np.einsum("hwij,lhwj->lhwi", frames, np.broadcast_to(wi, (len(series), *series.shape, 3)))
    wo = np.einsum("hwij,hwj->hwi", frames, np.broadcast_to(series.wo, (*series.shape, 3)))
    return wi, wo
