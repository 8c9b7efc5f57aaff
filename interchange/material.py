"""What a surface is made of: a BRDF, textures over its parameters, and what the surface emits."""

from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from interchange.brdf.base import Brdf
from interchange.brdf.lambert import Lambert
from interchange.problems import Where


class Wrap(StrEnum):
    """How a texture goes on outside [0, 1], in UsdUVTexture's words."""

    BLACK = "black"
    CLAMP = "clamp"
    REPEAT = "repeat"
    MIRROR = "mirror"


@dataclass(frozen=True, eq=False)
class Texture:
    """Values over (u, v), bilinear between pixel centres.

    ``pixels`` (h, w, C) float32 with C = 1 or 3, linear (sRGB files are decoded, scale and bias applied);
    row 0 is the top, v = 1. Compared by identity, as meshes are.
    """

    pixels: np.ndarray
    wrap: tuple[Wrap, Wrap] = (Wrap.REPEAT, Wrap.REPEAT)
    file: str = ""
    uv_from_st: np.ndarray = field(
        default_factory=lambda: np.eye(3)
    )  # UsdTransform2d: scale, rotate, translate


@dataclass(frozen=True)
class Material:
    """``maps`` gives, for a parameter of ``brdf``, the texture that replaces its value at every point.

    ``normal_map``: (h, w, 3) tangent-space normals in [-1, 1], z outward. ``emission``: radiance that the
    surface itself sends out on both sides, W m⁻² sr⁻¹ a channel. ``opacity``: share of rays that meet the
    surface; the rest go straight on. ``opacity_threshold`` > 0 makes opacity a cut-out: below it nothing, else
    all. ``glsl``: a fragment ``vec3 brdf(vec3 wi, vec3 wo, vec2 uv)`` in 1/sr that replaces ``brdf`` in the
    rasteriser; no other renderer can draw it.
    """

    name: str = ""
    brdf: Brdf = field(default_factory=Lambert)
    maps: dict[str, Texture] = field(default_factory=dict)
    normal_map: Texture | None = None
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    emission_map: Texture | None = None
    opacity: float = 1.0
    opacity_map: Texture | None = None
    opacity_threshold: float = 0.0
    glsl: str = ""
    where: Where = field(default=Where(), compare=False)


def evaluate_texture(texture: Texture, uv: np.ndarray) -> np.ndarray:
    """Bilinear values (..., C) at ``uv`` (..., 2): the definition that both renderers follow."""
    st = uv @ texture.uv_from_st[:2, :2].T + texture.uv_from_st[:2, 2]
    h, w = texture.pixels.shape[:2]
    x, y = st[..., 0] * w - 0.5, (1.0 - st[..., 1]) * h - 0.5
    x0, y0 = np.floor(x).astype(int), np.floor(y).astype(int)
    total = np.zeros((*uv.shape[:-1], texture.pixels.shape[2]))
    for dx in (0, 1):
        for dy in (0, 1):
            column, row = x0 + dx, y0 + dy
            weight = np.abs(1 - dx - (x - x0)) * np.abs(1 - dy - (y - y0))
            inside = np.ones(weight.shape, bool)
            index = []
            for i, n, wrap in ((row, h, texture.wrap[1]), (column, w, texture.wrap[0])):
                if wrap is Wrap.BLACK:
                    inside &= (i >= 0) & (i < n)
                if wrap is Wrap.REPEAT:
                    index.append(i % n)
                elif wrap is Wrap.MIRROR:
                    m = i % (2 * n)
                    index.append(np.where(m < n, m, 2 * n - 1 - m))
                else:
                    index.append(np.clip(i, 0, n - 1))
            total += (weight * inside)[..., None] * texture.pixels[index[0], index[1]]
    return total
