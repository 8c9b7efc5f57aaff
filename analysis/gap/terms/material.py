"""Terms of a material's surface: texture, and light that bleeds beneath it.

∂S/∂c_ij = S cos(π i u) cos(π j v)       u, v: along the two longest sides of the object's box
(G_σ * S - S) / σ                        inside one body, at a σ of some px: across a sharp shadow's edge a blur's
                                         change grows more with σ than with σ²
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.compared.laid import Part, laid, parts
from analysis.gap.compared.state import State
from analysis.gap.terms.base import Cells, Family, Field, Term, in_cells
from analysis.gap.terms.generic import SPARE, UNEVEN, bilinear
from analysis.gap.terms.knot import covered
from analysis.gap.terms.left import EDGED, LAMP
from analysis.gap.terms.surface_pattern import SIZES, pattern_fields
from interchange.brdf.base import Brdf
from interchange.captures import Tolerances
from interchange.effects.texture import WAVES
from interchange.effects.translucency import Translucency, spread

LEAST_PIXELS = 400  # that a material must cover, of an image of 480 x 360
LARGE_PIXELS = 8000  # the same, to have a pattern in places
IN_PLACES = ", in places"  # what is said after the name of a material whose pattern has no formula
SEEN_TWICE = ", as other views show it"  # the same where it is what they have in common
DETAIL = tuple(f"{a:.0f} to {2 * a:.0f} texels" for a in SIZES[:-1])
GRID = (20, 16)  # places of what is seen of a body, along the two longest sides of its box
SHARED = 0.0001  # rms over the signal of each size that views have in common anyway
SPOTS = tuple(
    f"{100 * (i + 0.5) / GRID[0]:.0f} % along, {100 * (j + 0.5) / GRID[1]:.0f} % across"
    for j in range(GRID[1])
    for i in range(GRID[0])
)
# of its light: the least share of a body colour whose pattern could be told from what a lobe mirrors
BODY = 0.5
BLUR_PX = 1.5  # of the step that translucency is told by


def patterns(conditions: Sequence[Condition]) -> dict[str, list[Field]]:
    """Of materials that cover enough of some image and show their body more than what it mirrors, what several views
    share."""
    seen_of = covered(conditions, "material_id")
    materials = {b.material.name: b.material for c in conditions for b in c.shown.scene.bodies}
    chosen = [n for n, k in seen_of.items() if k >= LEAST_PIXELS and matte_share(materials[n].brdf) > BODY]
    return pattern_fields(conditions, chosen)


def material_terms(
    conditions: Sequence[Condition], tolerances: Tolerances, shared: dict[str, list[Field]] | None = None
) -> list[Term]:
    """Of the materials of ``patterns``; ``shared``: those, where they are known, as no tolerance changes them."""
    shared = patterns(conditions) if shared is None else shared
    seen_of, chosen = covered(conditions, "material_id"), list(shared)
    spike = UNEVEN * tolerances.albedo / np.sqrt(len(WAVES))
    terms = [
        Term("texture", name, word, "1", spike, _wave(name, i, j))
        for name in chosen
        for word, (i, j) in WAVES.items()
    ]
    seen = parts(conditions, chosen)
    for name in chosen:
        step = _blur_mm(conditions, name)
        if seen_of[name] >= LARGE_PIXELS:
            terms += in_cells(
                "texture",
                f"{name}{IN_PLACES}",
                SPARE,
                Family(_spots(name, seen[name]), SPOTS),
                generic=False,
            )
        coarsest = LAMP * tolerances.flat_field  # where light is off, all views show that on a surface, too
        terms += [
            Term("texture", f"{name}{SEEN_TWICE}", word, "1", anyway, field, True, pattern=True)
            for word, anyway, field in zip(
                DETAIL, [SHARED] * (len(DETAIL) - 1) + [coarsest], shared[name], strict=False
            )
        ]
        terms.append(
            Term("translucency", name, "sigma", "mm", EDGED * tolerances.flat_field, _bleeding(name, step),
                 relative=True, low=0.0)
        )  # fmt: skip
    return terms


def matte_share(brdf: Brdf) -> float:
    """Of the light that it reflects to 45 degrees from above, what its body colour gives. By the midpoint rule, steps
    of 3.75 degrees of height and 7.5 about the normal."""
    if not brdf.matte:
        return 0.0
    height, around = np.deg2rad(np.arange(24) * 3.75 + 1.875), np.deg2rad(np.arange(48) * 7.5)
    t, p = np.meshgrid(height, around, indexing="ij")
    wi = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1)
    weight = (np.cos(t) * np.sin(t))[..., None]
    wo = np.array([np.sqrt(0.5), 0.0, np.sqrt(0.5)])
    bare = replace(brdf, **{brdf.matte: 0.0 * np.asarray(getattr(brdf, brdf.matte))})  # type: ignore[type-var]
    whole, lobes = (float((weight * b.evaluate(wi, wo)).sum()) for b in (brdf, bare))
    return 1 - lobes / whole if whole > 0 else 0.0


def _wave(name: str, i: int, j: int) -> Field:
    def field(s: State) -> np.ndarray | None:
        scene = s.shown.scene
        if name not in scene.material_names or not s.lamps:
            return None
        out = np.zeros_like(s.signal)
        for _, own, u, v in laid(s, name):
            wave = np.cos(np.float32(np.pi * i) * u) * np.cos(np.float32(np.pi * j) * v)
            out[own] = s.signal[own] * wave[:, None]
        return out

    return field


def _spots(name: str, seen: dict[str, Part]) -> Cells:
    """A pattern of no formula: bilinear between places of the part of each body that is seen."""

    def cells(s: State) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        scene = s.shown.scene
        if name not in scene.material_names or not s.lamps:
            return None
        ids = np.full((*s.grid[0].shape, 4), -1)
        share = np.zeros(ids.shape, np.float32)
        for body, own, u, v in laid(s, name):
            if body in seen:
                x, y = seen[body].share(u, v)
                ids[own], share[own] = bilinear(x * GRID[0] - 0.5, y * GRID[1] - 0.5, *GRID)
        return ids, share, s.signal

    return cells


def _blur_mm(conditions: Sequence[Condition], name: str) -> float:
    """mm on the surface that ``BLUR_PX`` are where the material is seen first."""
    for c in conditions:
        names = c.shown.scene.material_names
        if name in names:
            own = c.shown.passes["material_id"] == names.index(name)
            if own.any():
                return BLUR_PX / Translucency(1.0).sigma_px(c.shown.passes["depth"][own], c.camera)
    return 1.0


def _bleeding(name: str, step: float) -> Field:
    def field(s: State) -> np.ndarray | None:
        names = s.shown.scene.material_names
        if name not in names or not s.lamps:
            return None
        L, passes = s.radiance, s.shown.passes
        mask = passes["material_id"] == names.index(name)
        change = np.zeros_like(L)
        for body in np.unique(passes["object_id"][mask]):
            own = mask & (passes["object_id"] == body)
            px = Translucency(step).sigma_px(passes["depth"][own], s.camera)
            change[own] = spread(L, own, px)[own] - L[own]
        return np.asarray(s.per_radiance * s.channels(s.take(change)) / np.float32(step), np.float32)

    return field
