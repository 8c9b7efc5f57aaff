"""The programs that light samples: one for each material group, kind of lamps and way of looking the surface up."""

import moderngl

from realtime import materials
from realtime.lamps import MAPS, rows
from realtime.layers import Layer, Lit, Signature
from realtime.materials import Group
from realtime.programs import Programs, defines, put, text

VECTORS = 31  # that a vertex shader may pass on
UNITS = {
    "g_surface": 0,
    "g_facet": 1,
    "g_coordinates": 2,
    "g_slopes": 3,
    "lens": 4,
    "materials": 5,
    "bodies": 6,
    "tiles": 15,
    "samples": 0,
}
SHADOW_UNIT, PROFILE_UNIT, MAP_UNIT = 7, 11, 16


class Shading:
    """Programs by what decides their text; most are found without putting it together."""

    def __init__(self, context: moderngl.Context, programs: Programs) -> None:
        self.programs = programs
        self._by_key: dict[tuple[object, ...], moderngl.Program] = {}
        self._vectors = min(VECTORS, int(context.info["GL_MAX_VARYING_VECTORS"]) - 1)

    def program(
        self, layer: Layer, group: Group, chunk: list[Lit], lit: bool, tiled: bool
    ) -> moderngl.Program:
        """Of a chunk of lamps on a layer's samples of one group. ``lit``: visibility instead of radiance; ``tiled``:
        drawn tile by tile."""
        buffer, drawn, pick = layer.buffer, layer.drawn, layer.pick
        signature = chunk[0].signature if chunk else ("NONE", False, False, "", 0)
        uv, telecentric = buffer.coordinates is not None, drawn.view.telecentric
        key = (
            lit or group.key,
            signature,
            len(chunk),
            uv,
            telecentric,
            tuple(drawn.defines.items()),
            buffer.kind.compact,
            pick,
            tiled,
        )
        if key not in self._by_key:
            self._by_key[key] = self._compose(layer, group, signature, len(chunk), lit, tiled)
        return self._by_key[key]

    def _compose(
        self,
        layer: Layer,
        group: Group,
        signature: Signature,
        count: int,
        lit: bool,
        tiled: bool,
    ) -> moderngl.Program:
        drawn, uv = layer.drawn, layer.buffer.coordinates is not None
        mode, shaped, focused, by_direction, faces = signature
        fragment = bool(group.material and group.material.glsl)
        head = defines(
            {
                f"MODE_{mode}": True,
                "HOLDS": True,
                "LIGHTS": None if count else 0,
                "ALL_LAMPS": " ".join(f"total += lamp({k}, x, values);" for k in range(count)),
                "MAPS": MAPS,
                "FACES": faces or None,
                "SHAPED": shaped,
                "FOCUSED": focused,
                "PROFILED": bool(by_direction),
                "PROJECTED": by_direction == "PROJECTED",
                "ISOTROPIC": group.isotropic,
                "ALONE": group.alone,
                "TELECENTRIC": drawn.view.telecentric,
                "UV": uv,
                **drawn.defines,
                "LIT": lit,
                "PICK": layer.pick,
                "COMPACT": layer.buffer.kind.compact,
                "FRAGMENT": fragment,
                "PARAMETERS": max(len(group.brdf.flat()), 1),
            }
        )
        declared = "uniform sampler2D materials;\n"
        lights, passed = "", ""
        if count:
            stride = MAPS + 8 * faces
            read = rows(*signature)
            held = min(count, (self._vectors - 4) // len(read))
            passed = defines(
                {
                    "LIGHTS": count,
                    "STRIDE": stride,
                    "HELD": held,
                    "ROWS": len(read),
                    "ROW_OF_SLOT": ", ".join(map(str, read)),
                    "SLOTS": stride,
                    "SLOT_OF_ROW": ", ".join(str(read.index(i) if i in read else 0) for i in range(stride)),
                }
            )
            head += passed
            declared += "layout(std140) uniform Lights { vec4 lights[LIGHTS * STRIDE]; };\n"
            declared += "uniform sampler2D shadow_map[LIGHTS];\n" if faces else ""
            declared += beam_source(by_direction)
            lights = text("lights.glsl")
        model = "" if lit else materials.source(group)
        about = f"of material {str(group.material.where) or group.material.name}" if group.material else ""
        program = self.programs.get(
            [
                "#define HOLDS\n",
                passed,
                text("held_vertex.glsl"),
                text("tile_vertex.glsl" if tiled else "screen_vertex.glsl"),
            ],
            [
                head,
                text("common.glsl"),
                text("locate.glsl"),
                text("surface.glsl"),
                declared,
                model,
                lights,
                text("lighting_fragment.glsl"),
            ],
            about,
        )
        put(program, **UNITS)
        if faces:
            put(program, shadow_map=_units(SHADOW_UNIT, count))
        if by_direction:
            put(program, profile=_units(PROFILE_UNIT, count))
        return program


def beam_source(beam: str) -> str:
    """The text that reads a lamp's profile or projected image."""
    if not beam:
        return ""
    return "uniform sampler2D profile[LIGHTS];\n" + text(
        "projector.glsl" if beam == "PROJECTED" else "profile.glsl"
    )


def _units(first: int, count: int) -> object:
    return first if count == 1 else tuple(range(first, first + count))
