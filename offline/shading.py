"""The OSL text of a material: its BRDF as traced from the catalogue, its maps, the lamps and the way to sample them.

Every number that may change from frame to frame without changing the text is a socket of the shader
(``sockets``); the lamps are an array in the text. Nothing here knows Blender.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

from interchange.brdf import Brdf
from interchange.light import Light
from interchange.material import Material, Texture, Wrap
from interchange.parameter import Kind, parameters
from interchange.shader import OSL, function
from interchange.table import WIDTH, Table
from offline import lamps
from offline.proposals import STRIDE, proposals

Pixels = Texture | Table

WRAP = {Wrap.BLACK: "black", Wrap.CLAMP: "clamp", Wrap.REPEAT: "periodic", Wrap.MIRROR: "mirror"}


@cache
def library(name: str) -> str:
    return (files("offline") / "osl" / name).read_text(encoding="utf8")


def number(x: float) -> str:
    """A float literal that OSL reads back to the same single-precision value."""
    return repr(float(np.float32(x)))


def lookup(texture: Texture, file: str, uv: str = "uv") -> str:
    """OSL expression of ``material.evaluate_texture`` at ``uv``: a color for three channels, a float for one."""
    m = texture.uv_from_st
    s, t = (f"({number(r[0])} * {uv}[0] + {number(r[1])} * {uv}[1] + {number(r[2])})" for r in m[:2])
    kind = "float" if texture.pixels.shape[2] == 1 else "color"
    return (
        f'({kind})texture("{file}", {s}, 1 - {t}, 0, 0, 0, 0, "interp", "linear", '
        f'"swrap", "{WRAP[texture.wrap[0]]}", "twrap", "{WRAP[texture.wrap[1]]}")'
    )


def _rows(k: int, table: Table, file: str) -> str:
    """The function that reads a row of a table."""
    height = len(table.pixels)
    x, y = f"(mod(i, {WIDTH}.0) + 0.5) / {WIDTH}.0", f"(floor(i / {WIDTH}.0) + 0.5) / {height}.0"
    return (
        f'color table_{k}(float i) {{ return texture("{file}", {x}, {y}, 0, 0, 0, 0, "interp", "closest"); }}'
    )


def splits(brdf: Brdf) -> bool:
    """Whether the model stands on a Lambertian base: f(diffuse) - f(0) = diffuse / pi for every direction."""
    if "diffuse" not in parameters(brdf) or parameters(brdf)["diffuse"].kind is not Kind.COLOR:
        return False
    rng = np.random.default_rng(0)
    w = np.abs(rng.normal(size=(2, 8, 3))) + 0.1
    wi, wo = w / np.linalg.norm(w, axis=-1, keepdims=True)
    slots = brdf.slots()["diffuse"]
    values = [np.array(brdf.flat()), np.array(brdf.flat())]
    values[0][slots.start : slots.stop], values[1][slots.start : slots.stop] = 0.0, 0.5
    i, o = wi.T, wo.T
    with np.errstate(all="ignore"):
        low, high = (np.asarray(brdf.bind(list(v), 0).f(tuple(i), tuple(o))) for v in values)
    return bool(np.allclose(high - low, 0.5 / np.pi, rtol=1e-9, atol=1e-9))


@dataclass(frozen=True)
class Lamps:
    """The lamps of a frame in OSL: numbers, the functions of their textures, and what parts they need."""

    count: int
    numbers: tuple[float, ...]
    functions: str
    features: tuple[tuple[str, bool], ...]


def lamps_of(lights: Sequence[Light], file_of: Callable[[Texture], str]) -> Lamps:
    functions = lamps.texture_function(lights, file_of)
    return Lamps(len(lights), tuple(lamps.pack(lights)), functions, tuple(lamps.features(lights).items()))


def surface(material: Material, lit_by: Lamps, see_through: bool, file_of: Callable[[Pixels], str]) -> str:
    """The OSL source of ``material``. ``file_of`` writes a texture or a table and says where."""
    brdf = material.brdf
    count = len(brdf.flat())
    slots = brdf.slots()
    maps: list[str] = []
    for k, (name, texture) in enumerate(material.maps.items()):
        value = f"m{k}"
        channels = texture.pixels.shape[2]
        maps.append(f"{'float' if channels == 1 else 'color'} {value} = {lookup(texture, file_of(texture))};")
        maps += [
            f"p[{i}] = {value if channels == 1 else f'{value}[{j % 3}]'};" for j, i in enumerate(slots[name])
        ]
    if material.emission_map is not None:
        maps.append(f"emitted = {lookup(material.emission_map, file_of(material.emission_map))};")
    if material.opacity_map is not None:
        text = lookup(material.opacity_map, file_of(material.opacity_map))
        maps.append(
            f"opacity = {text.replace('(color)', 'luminance((color)', 1) + ')' if '(color)' in text else text};"
        )
    normal_map = ""
    if material.normal_map is not None:
        normal_map = (
            f"color nm = {lookup(material.normal_map, file_of(material.normal_map))};\n"
            "    vector T0 = normalize(T - dot(T, n) * n);\n"
            "    n = normalize(nm[0] * T0 + nm[1] * cross(n, T0) + nm[2] * n);"
        )
    lobe_count, lobe_code = proposals(brdf)
    matte = "0"
    if splits(brdf):
        d = slots["diffuse"].start
        matte = f"color(p[{d}], p[{d + 1}], p[{d + 2}])"
    fill: Mapping[str, str] = {
        "PARAMETERS": " ".join(f"vector p{k} = 0," for k in range((count + 2) // 3)),
        "COUNT": str(max(count, 1)),
        "GATHER": " ".join(f"p[{i}] = p{i // 3}[{i % 3}];" for i in range(count)),
        "MAPS": "\n    ".join(maps),
        "NORMAL_MAP": normal_map,
        "LAMP_NUMBERS": str(max(len(lit_by.numbers), 1)),
        "LAMPS": ", ".join(map(number, lit_by.numbers or (0.0,))),
        "LAMP_COUNT": str(lit_by.count),
        "LOBE_NUMBERS": str(STRIDE * lobe_count),
        "LOBE_CODE": lobe_code,
        "MATTE": matte,
    }
    text = library("surface.osl")
    for key, value in fill.items():
        text = text.replace(f"@{key}@", value)
    flags = {"LOBES": lobe_count, "SEE_THROUGH": see_through, **dict(lit_by.features)}
    head = ['#include "stdcycles.h"', *(f"#define {name} {int(value)}" for name, value in flags.items())]
    parts = [
        OSL.prelude,
        *(_rows(k, table, file_of(table)) for k, table in enumerate(brdf.tables)),
        function(brdf, OSL, "brdf"),
        lit_by.functions,
        library("lamps.osl"),
        library("lobes.osl"),
    ]
    return "\n".join([*head, *parts, text])


def sockets(material: Material) -> dict[str, Any]:
    """The values of the shader's sockets that belong to the material."""
    flat = material.brdf.flat()
    flat += [0.0] * (-len(flat) % 3)
    return {
        **{f"p{i // 3}": tuple(flat[i : i + 3]) for i in range(0, len(flat), 3)},
        "glow": tuple(material.emission),
        "cover": float(material.opacity),
        "cutout": float(material.opacity_threshold),
    }
