"""Where a surface is likely to reflect: the lobes that light paths are drawn from, model by model.

They decide how noisy an image is, never its mean (every path is weighted by the exact BRDF over this density),
so a model without an entry here is drawn with lobes that suit most.
"""

from collections.abc import Callable

from interchange.brdf import Brdf

MIRROR = "-wo[0], -wo[1], wo[2]"
Lobe = tuple[
    str, int, str, str
]  # weight (not yet normalised), kind (osl/lobes.osl), axis "x, y, z", exponent or alpha


def proposals(brdf: Brdf) -> tuple[int, str]:
    """The number of lobes (none for a matte surface), and the OSL statements that fill ``LO`` from ``wo`` and ``p``."""
    name = type(brdf).__name__
    lobes = MODELS.get(name, _any)(brdf)
    lines = ["float total = 0; float weight = 0; vector axis = 0;"]
    for k, (weight, kind, axis, n) in enumerate(lobes):
        lines.append(f"axis = vector({axis}); weight = {weight}; LO[{6 * k}] = weight; total += weight;")
        if kind == 1:  # an axis below the surface would draw most rays in vain
            lines.append("axis[2] = max(axis[2], 0.05); axis = normalize(axis);")
        lines.append(
            f"LO[{6 * k + 1}] = {kind}; LO[{6 * k + 2}] = axis[0]; LO[{6 * k + 3}] = axis[1]; "
            f"LO[{6 * k + 4}] = axis[2]; LO[{6 * k + 5}] = {n};"
        )
    lines += [f"LO[{6 * k}] /= total;" for k in range(len(lobes))]
    return len(lobes), "\n        ".join(lines)


def _cosine(weight: str) -> Lobe:
    return weight, 0, "0, 0, 1", "1"


def _mean(slots: range) -> str:
    return f"(p[{slots[0]}] + p[{slots[1]}] + p[{slots[2]}]) / 3"


def _lambert(brdf: Brdf) -> list[Lobe]:
    return []


def _lafortune(brdf: Brdf) -> list[Lobe]:
    slots = brdf.slots()
    if not brdf.lobes:
        return []
    lobes = []
    for k in range(brdf.lobes):
        w, c, n = slots["weight"].start + 3 * k, slots["C"].start + 3 * k, f"p[{slots['n'].start + k}]"
        axis = f"p[{c}] * wo[0], p[{c + 1}] * wo[1], p[{c + 2}] * wo[2]"
        height = f"power(length(vector({axis})), {n})"
        mean = f"(p[{w}] + p[{w + 1}] + p[{w + 2}])"
        lobes.append((f"1e-6 + {mean} * {height} / ({n} + 1)", 1, axis, n))
    total = " + ".join(f"({weight})" for weight, *_ in lobes)
    return [*lobes, _cosine(f"0.1 * ({total})")]


def _phong(brdf: Brdf) -> list[Lobe]:
    return [("0.9", 1, MIRROR, f"p[{brdf.slots()['n'].start}]"), _cosine("0.1")]


def _blinn_phong(brdf: Brdf) -> list[Lobe]:
    return [("0.9", 3, "0, 0, 1", f"p[{brdf.slots()['n'].start}]"), _cosine("0.1")]


def _usd_preview_surface(brdf: Brdf) -> list[Lobe]:
    s = brdf.slots()
    rough, coat = f"p[{s['roughness'].start}]", f"p[{s['clearcoatRoughness'].start}]"
    base, metal = f"({_mean(s['diffuseColor'])})", f"p[{s['metallic'].start}]"
    wide, narrow = f"max({rough}, 0.03)", f"max({coat}, 0.03)"
    return [
        _cosine(f"0.1 + {base} * (1 - {metal})"),
        (f"0.1 + {base} * {metal} + 0.3 * power(1 - wo[2], 5)", 2, "0, 0, 1", f"{wide} * {wide}"),
        (f"1e-6 + 0.2 * p[{s['clearcoat'].start}]", 2, "0, 0, 1", f"{narrow} * {narrow}"),
    ]  # fmt: skip


def _any(brdf: Brdf) -> list[Lobe]:
    return [_cosine("0.4"), *(("0.2", 1, MIRROR, n) for n in ("8", "64", "512"))]


MODELS: dict[str, Callable[[Brdf], list[Lobe]]] = {
    "Lambert": _lambert,
    "Lafortune": _lafortune,
    "Phong": _phong,
    "BlinnPhong": _blinn_phong,
    "UsdPreviewSurface": _usd_preview_surface,
}
