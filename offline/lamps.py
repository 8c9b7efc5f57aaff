"""Lamps as the array of numbers that osl/lamps.osl reads."""

from collections.abc import Callable, Sequence

import numpy as np

from interchange.light import Light, LightKind
from interchange.material import Texture, Wrap, evaluate_texture

STRIDE = 32
KINDS = {
    LightKind.SPHERE: 0,
    LightKind.DISK: 1,
    LightKind.RECT: 2,
    LightKind.CYLINDER: 3,
    LightKind.DISTANT: 4,
    LightKind.DOME: 5,
}
DOME_ROWS, DOME_COLUMNS = 16, 32  # cells that a textured dome is drawn from


def pack(lights: Sequence[Light]) -> list[float]:
    """``STRIDE`` numbers a lamp, then the tables of profiles and textured domes that they point to."""
    head: list[float] = []
    tables: list[float] = []
    first = STRIDE * len(lights)
    textures = 0
    for light in lights:
        pose = light.world_from_light
        delta = light.is_delta and light.kind is not LightKind.DOME
        size = {
            LightKind.SPHERE: (light.radius, 0.0),
            LightKind.DISK: (light.radius, 0.0),
            LightKind.RECT: (light.width, light.height),
            LightKind.CYLINDER: (light.radius, light.length),
            LightKind.DISTANT: (min(light.angle, np.pi) / 2, 0.0),
            LightKind.DOME: (0.0, 0.0),
        }[light.kind]
        profile = dome = texture = -1.0
        if light.profile is not None:
            profile = first + len(tables)
            q = light.profile
            tables += [len(q.horizontal), len(q.vertical), *q.horizontal, *q.vertical, *q.candela.ravel()]
        if light.projector is not None:
            profile = -2.0 - (first + len(tables))
            tables += [textures, *light.projector.numbers()]
            textures += 1
        if light.texture is not None:
            texture, textures = float(textures), textures + 1
            if light.kind is LightKind.DOME:
                dome = first + len(tables)
                tables += dome_table(light.texture)
        mean = 1.0 if light.texture is None else float(np.mean(light.texture.pixels))
        area = light.projected_area * mean
        head += [
            KINDS[light.kind] + (10.0 if delta else 0.0),
            *pose[:3, 3],
            *pose[:3, :3].T.ravel(),
            *size,
            *(light.intensity if delta else light.radiance),
            light.cone_angle, light.cone_softness, light.focus, *light.focus_tint, float(is_shaped(light)),
            profile, light.profile_angle_scale, texture, float(light.casts_shadows),
            float(np.hypot(*size)) if light.kind in (LightKind.RECT, LightKind.CYLINDER) else size[0],
            area if area > 0 else 1.0,
            dome,
        ]  # fmt: skip
    return [float(x) for x in head + tables]


def features(lights: Sequence[Light]) -> dict[str, bool]:
    """Which parts of osl/lamps.osl these lamps need: the others are not compiled."""
    kinds = {x.kind for x in lights if x.kind is LightKind.DOME or not x.is_delta}
    area = {LightKind.SPHERE, LightKind.DISK, LightKind.RECT, LightKind.CYLINDER} & kinds
    return {
        "HAS_DELTA": any(x.is_delta and x.kind is not LightKind.DOME for x in lights),
        "HAS_EXTENT": bool(kinds),
        "HAS_AREA": bool(area),
        "HAS_SPHERE": LightKind.SPHERE in kinds,
        "HAS_FLAT": bool({LightKind.DISK, LightKind.RECT} & kinds),
        "HAS_CYLINDER": LightKind.CYLINDER in kinds,
        "HAS_DISTANT": LightKind.DISTANT in kinds,
        "HAS_DOME": LightKind.DOME in kinds,
        "HAS_SHAPING": any(map(is_shaped, lights)),
        "HAS_PROFILE": any(x.profile is not None for x in lights),
        "HAS_PROJECTOR": any(x.projector is not None for x in lights),
        "HAS_TEXTURE": any(x.texture is not None or x.projector is not None for x in lights),
    }


def is_shaped(light: Light) -> bool:
    return light.cone_angle < np.pi or light.cone_softness > 0 or light.focus > 0 or light.beam is not None


def dome_table(texture: Texture) -> list[float]:
    """Rows, columns, and cumulated chances to draw each cell of a latitude-longitude image, by its light.

    A twentieth of the chances is spread evenly, so that no direction is left out.
    """
    t, s = (np.arange(n * 8) for n in (DOME_ROWS, DOME_COLUMNS))
    uv = np.stack(np.meshgrid((s + 0.5) / len(s), 1 - (t + 0.5) / len(t)), axis=-1)
    around = Texture(texture.pixels, (Wrap.REPEAT, Wrap.CLAMP))
    light = evaluate_texture(around, uv).mean(axis=-1)
    sine = np.sin(np.pi * (t + 0.5) / len(t))[:, None]
    cells = (light * sine).reshape(DOME_ROWS, 8, DOME_COLUMNS, 8).mean(axis=(1, 3))
    even = sine.reshape(DOME_ROWS, 8).mean(axis=1)[:, None] * np.ones(DOME_COLUMNS)
    cells = 0.95 * cells / max(cells.sum(), 1e-30) + 0.05 * even / even.sum()
    marginal = np.concatenate([[0], np.cumsum(cells.sum(1))])
    conditional = np.concatenate([np.zeros((DOME_ROWS, 1)), np.cumsum(cells, axis=1)], axis=1)
    conditional /= conditional[:, -1:]
    return [DOME_ROWS, DOME_COLUMNS, *(marginal / marginal[-1]), *conditional.ravel()]


def pictures(lights: Sequence[Light]) -> list[tuple[Texture, str, str]]:
    """The lamps' images, in the order in which ``pack`` counts them, and how each goes on across and down."""
    found = []
    for light in lights:
        if light.projector is not None:
            found.append((light.projector.image, "black", "black"))
        if light.texture is not None:
            found.append((light.texture, "periodic" if light.kind is LightKind.DOME else "clamp", "clamp"))
    return found


def texture_function(lights: Sequence[Light], file_of: Callable[[Texture], str]) -> str:
    """OSL's ``color lamp_texture(int k, float s, float t)``: the lamps' k-th image, t down."""
    lines = []
    for k, (texture, s, t) in enumerate(pictures(lights)):
        kind = "float" if texture.pixels.shape[2] == 1 else "color"
        wrapped = f'"swrap", "{s}", "twrap", "{t}"'
        call = f'({kind})texture("{file_of(texture)}", s, t, 0, 0, 0, 0, "interp", "linear", {wrapped})'
        lines.append(f"if (k == {k}) c = {call};")
    body = "\n    ".join(lines)
    return (
        f"color lamp_texture(int k, float s, float t)\n{{\n    color c = 1;\n    {body}\n    return c;\n}}\n"
    )
