"""The lobes of a BRDF (``Brdf.sampling``) as OSL: traced by the same way as its formula."""

import numpy as np

from interchange.brdf import Brdf
from interchange.brdf.sampling import Shape
from interchange.shader import OSL, Body, bound, spell, vector

STRIDE = 7  # numbers a lobe in osl/lobes.osl


def proposals(brdf: Brdf) -> tuple[int, str]:
    """The number of lobes, and the OSL statements that fill ``LO`` from ``wo`` and ``p``."""
    body = Body(OSL)
    lobes = bound(brdf, body, None).sampling(vector("wo", body))
    if not lobes:
        return 0, ""
    weights = [spell(np.maximum(lobe.weight, 1e-6)) for lobe in lobes]
    lines = [*body.lines, f"float total = {' + '.join(weights)}; vector axis = 0;"]
    for k, (lobe, weight) in enumerate(zip(lobes, weights, strict=True)):
        across = lobe.width if lobe.across is None else lobe.across
        lines.append(f"axis = vector({', '.join(map(spell, lobe.axis))});")
        if lobe.shape is Shape.POWER:  # an axis below the surface would draw most rays in vain
            lines.append("axis[2] = max(axis[2], 0.05); axis = normalize(axis);")
        axis = ("axis[0]", "axis[1]", "axis[2]")
        numbers = (f"{weight} / total", int(lobe.shape), *axis, spell(lobe.width), spell(across))
        lines += [f"LO[{STRIDE * k + j}] = {number};" for j, number in enumerate(numbers)]
    return len(lobes), "\n        ".join(lines)
