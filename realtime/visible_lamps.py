"""Lamps that the camera sees themselves, met exactly by each sample's ray (Light.visible)."""

import moderngl
import numpy as np

from interchange.light import Light, LightKind
from realtime.lamps import MAPS, is_shaped, samples
from realtime.programs import defines, put, text, texture_uniforms
from realtime.uploads import Uploads
from realtime.view import View

MAP_UNIT, PROFILE_UNIT = 16, 11


def far_to_near(lights: list[Light], eye: np.ndarray) -> list[Light]:
    """The lamps that can be seen, each before those that may hide it. ``eye`` (3,), world."""
    seen = [light for light in lights if light.visible and not light.is_delta]
    order = {LightKind.DOME: 2, LightKind.DISTANT: 1}

    def key(light: Light) -> tuple[int, float]:
        return order.get(light.kind, 0), float(np.linalg.norm(light.world_from_light[:3, 3] - eye))

    return sorted(seen, key=key, reverse=True)


def sources(light: Light, view: View, lens: dict[str, object]) -> tuple[list[str], list[str]]:
    """The texts of the program that draws a lamp. ``lens``: the pass's defines."""
    mapped = light.texture is not None and light.kind in (LightKind.RECT, LightKind.DOME)
    kind = light.kind.value.upper()
    head = defines(
        {
            f"KIND_{kind}": True,
            f"KIND_{kind}_MAP": mapped,
            "GREY(x)": "(x).xxx"
            if light.texture is not None and light.texture.pixels.shape[2] == 1
            else "(x)",
            "LIGHTS": 1,
            "STRIDE": MAPS,
            "MAPS": MAPS,
            "SHAPED": is_shaped(light),
            "FOCUSED": light.focus != 0,
            "PROFILED": light.profile is not None,
            "TELECENTRIC": view.telecentric,
            **lens,
            "MODE_POINT": True,
        }
    )
    declared = "layout(std140) uniform Lights { vec4 lights[LIGHTS * STRIDE]; };\n"
    if light.profile is not None:
        declared += "uniform sampler2D profile[LIGHTS];\n" + text("profile.glsl")
    if mapped:
        declared += texture_uniforms("lamp_map")
    parts = [head, text("common.glsl"), text("locate.glsl"), declared, text("lights.glsl")]
    return [text("screen_vertex.glsl")], [*parts, text("visible_lamp_fragment.glsl")]


def fill(
    program: moderngl.Program, light: Light, origin: np.ndarray, uploads: Uploads, records: moderngl.Buffer
) -> None:
    """The program's uniforms and textures."""
    record = samples(light, 0, 1, origin)[0][0].record.astype(np.float32)
    record[0, :3] = light.world_from_light[:3, 3] - origin
    records.write(record.tobytes())
    records.bind_to_uniform_block(0)
    first = np.cos(min(light.angle, np.pi) / 2) if light.kind is LightKind.DISTANT else light.radius
    put(program, lamp_radiance=tuple(light.radiance), extent=(first, light.width, light.height, light.length))
    if light.texture is not None and "lamp_map" in program:
        picture = uploads.picture(light.texture)
        picture.texture.use(MAP_UNIT)
        put(program, lamp_map=MAP_UNIT, lamp_map_uv=picture.uv_from_st, lamp_map_wrap=picture.wrap)
    if light.profile is not None:
        uploads.beam(light.profile).texture.use(PROFILE_UNIT)
        put(program, profile=PROFILE_UNIT)
