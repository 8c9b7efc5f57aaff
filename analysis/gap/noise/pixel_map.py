"""Maps of pixels: what each one's gain and offset are off by, from the captures fitted to, for those held out.

Of condition c, with s DN above black at a pixel, the residual less its mean over ``AROUND`` × ``AROUND`` px (what
is smooth is no pixel's own) is

    r_c = s_c p + K_c d + noise,    p ~ N(0, PRNU²), d ~ N(0, DSNU²)

and p, d are their means given every r_c (best linear unbiased prediction): the fewer captures and the more noise, the
closer to 0. Robinson: That BLUP is a good thing: the estimation of random effects. Stat. Sci. 1991.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import cv2
import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.noise.fixed_pattern import flat
from analysis.gap.noise.hot_pixels import hot_pixels
from analysis.gap.sensor.expected import noise_variance

AROUND = 7
LEAST = (1e-5, 1e-2)  # PRNU and DSNU (e-) that are next to none


@dataclass(frozen=True, eq=False)
class PixelMaps:
    """By camera: gain less 1, and offset e-, (H, W, C) each; of those that have some, what is hot, e-/s."""

    of: Mapping[str, tuple[np.ndarray, np.ndarray]]
    hot: Mapping[str, np.ndarray] = field(default_factory=dict)

    def applied(self, conditions: Sequence[Condition], images: Sequence[np.ndarray]) -> list[np.ndarray]:
        """``images`` (H, W, C) DN of ``conditions`` with their cameras' pixels; those without a map stay."""
        out = []
        for c, dn in zip(conditions, images, strict=True):
            sensor = c.camera.sensor
            gain, offset = self.of.get(c.camera.name, (0.0, 0.0))
            electrons = offset + c.camera.t_exp * self.hot.get(c.camera.name, 0.0)
            out.append(dn + (dn - sensor.black_out) * gain + sensor.K_out * electrons)
        return out


def pixel_maps(conditions: Sequence[Condition], simulations: Sequence[np.ndarray]) -> PixelMaps:
    """Of every camera whose noise is known (Condition.noise), from its conditions that are not held out;
    ``simulations``: (H, W, C) DN of each condition with all that the fit corrects."""
    groups: dict[str, list[tuple[Condition, np.ndarray]]] = {}
    for c, dn in zip(conditions, simulations, strict=True):
        if not c.held_out and c.noise is not None:
            groups.setdefault(c.camera.name, []).append((c, dn))
    hot = {k: v for own in groups.values() for k, v in hot_pixels(*zip(*own, strict=True)).items()}
    currents = {name: x.current for name, x in hot.items()}
    return PixelMaps({name: _predicted(own, currents.get(name)) for name, own in groups.items()}, currents)


def _predicted(
    own: Sequence[tuple[Condition, np.ndarray]], hot: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    noise = own[0][0].noise
    assert noise is not None
    precision = 1 / np.maximum([noise.prnu, noise.dsnu], LEAST) ** 2
    gains = np.full(own[0][1].shape, precision[0])
    both, left, left_of_offset = (np.zeros_like(gains) for _ in range(3))
    offsets = np.full_like(gains, precision[1])
    for c, dn in own:
        s, seen = flat(c, dn)
        ok = (seen > 0).astype(np.float32)
        temporal = noise_variance(dn, replace(c.camera, sensor=noise.of(c.camera.sensor)))[0] / len(
            c.captures
        )
        w, K = ok / temporal, c.camera.sensor.K_out
        known = dn if hot is None else dn + K * c.camera.t_exp * hot
        r = _less_smooth((c.mean - known).astype(np.float32), ok)
        gains += w * s * s
        both += w * s * K
        offsets += w * K * K
        left += w * s * r
        left_of_offset += w * K * r
    determinant = gains * offsets - both**2
    gain = (offsets * left - both * left_of_offset) / determinant
    offset = (gains * left_of_offset - both * left) / determinant
    return gain.astype(np.float32), offset.astype(np.float32)


def _less_smooth(r: np.ndarray, ok: np.ndarray) -> np.ndarray:
    """``r`` (H, W, C) less its mean over those around that are ``ok``."""

    def mean(x: np.ndarray) -> np.ndarray:
        return cv2.boxFilter(x, -1, (AROUND, AROUND), borderType=cv2.BORDER_REFLECT).reshape(x.shape)

    return r - mean(r * ok) / np.maximum(mean(ok), 1 / AROUND**2)
