"""The second stage: the light that leaves each surface towards the eye, lamp by lamp, added up over the passes."""

from collections.abc import Iterator
from dataclasses import dataclass

import moderngl
import numpy as np

from realtime import materials
from realtime.gbuffer import GBuffer
from realtime.lamps import MAPS, POWER, Sample, is_shaped
from realtime.lens import Lensmap
from realtime.materials import Group, MaterialTable
from realtime.programs import Programs, defines, put, text
from realtime.shadow_fit import Frustum
from realtime.shadow_maps import bind
from realtime.uploads import Uploads
from realtime.view import View

CHUNK = 4  # lamps a draw
UNITS = {"g_plane": 0, "g_frame": 1, "g_coordinates": 2, "g_slopes": 3, "lens": 4, "materials": 5}
SHADOW_UNIT, PROFILE_UNIT, MAP_UNIT = 6, 10, 16


@dataclass(frozen=True, eq=False)
class Lit:
    """A lamp's point, ready for the shader: its record (rows, 4), and the frusta of its shadow map, if it casts any."""

    sample: Sample
    record: np.ndarray
    frusta: list[Frustum | None]

    @property
    def signature(self) -> tuple[str, bool, bool, int]:
        """Points of one signature are lit by one program: mode, shaped, with a profile, shadow maps."""
        light = self.sample.light
        return self.sample.mode, is_shaped(light), light.profile is not None, len(self.frusta)

    def scaled(self, share: float) -> "Lit":
        record = self.record.copy()
        record[POWER, :3] *= share
        return Lit(self.sample, record, self.frusta)


@dataclass(frozen=True, eq=False)
class Pass:
    """One pass over the image: ``grid``² samples a pixel; ``aperture``: the eye's shift over the distance in focus."""

    view: View
    grid: int
    jitter: np.ndarray
    aperture: np.ndarray
    lensmap: Lensmap | None


class LightingStage:
    def __init__(
        self, context: moderngl.Context, uploads: Uploads, programs: Programs, table: MaterialTable
    ) -> None:
        self.context, self.uploads, self.programs, self.table = context, uploads, programs, table
        self._arrays: dict[int, moderngl.VertexArray] = {}
        self._by_key: dict[tuple[object, ...], moderngl.Program] = {}
        self._records = context.buffer(reserve=65536)
        self._lens: tuple[Lensmap, moderngl.Texture] | None = None

    def add(
        self,
        target: moderngl.Framebuffer,
        buffer: GBuffer,
        drawn: Pass,
        chunk: list[Lit],
        maps: list[moderngl.Texture],
        weight: float,
        lit: bool = False,
    ) -> None:
        """Add the light of a chunk to ``target``; of none, what surfaces emit. ``lit``: visibility instead."""
        context = self.context
        target.use()
        context.disable(moderngl.DEPTH_TEST)
        context.enable(moderngl.BLEND)
        context.blend_func = moderngl.ONE, moderngl.ONE
        for unit, texture in enumerate(buffer.textures):
            texture.use(unit)
        if drawn.lensmap is not None:
            self._lens_texture(drawn.lensmap).use(UNITS["lens"])
        if self.table.texture is not None:
            self.table.texture.use(UNITS["materials"])
        self._bind(chunk, maps)
        for group in self.table.groups[:1] if lit else self.table.groups:
            program = self._program(group, chunk, buffer, drawn, lit)
            put(
                program,
                world_from_eye=tuple(drawn.view.world_from_eye.T.ravel()),
                pinhole=(*drawn.view.focal, *drawn.view.centre),
                grid=drawn.grid,
                jitter=tuple(drawn.jitter),
                aperture=tuple(drawn.aperture),
                rows=(0, len(self.table.materials)) if lit else (group.first, group.last),
                weight=weight,
                emitting=float(not chunk),
            )
            if not lit:
                for i, (name, record) in enumerate(sorted(group.textures.items())):
                    bind(program, name, self.uploads, record, MAP_UNIT + i)
            self._screen(program).render(moderngl.TRIANGLES, vertices=3)
        context.disable(moderngl.BLEND)

    def _bind(self, chunk: list[Lit], maps: list[moderngl.Texture]) -> None:
        if not chunk:
            return
        self._records.write(np.concatenate([p.record for p in chunk]).astype(np.float32).tobytes())
        self._records.bind_to_uniform_block(0)
        for i, texture in enumerate(maps):
            texture.use(SHADOW_UNIT + i)
        for i, point in enumerate(chunk):
            if point.sample.light.profile is not None:
                self.uploads.profile(point.sample.light.profile).texture.use(PROFILE_UNIT + i)

    def _program(
        self, group: Group, chunk: list[Lit], buffer: GBuffer, drawn: Pass, lit: bool
    ) -> moderngl.Program:
        signature = chunk[0].signature if chunk else ("NONE", False, False, 0)
        uv, telecentric = buffer.coordinates is not None, drawn.view.telecentric
        key = (lit or group.key, signature, len(chunk), uv, telecentric, drawn.lensmap is not None)
        if key not in self._by_key:
            self._by_key[key] = self._compose(group, signature, len(chunk), uv, drawn, lit)
        return self._by_key[key]

    def _compose(
        self,
        group: Group,
        signature: tuple[str, bool, bool, int],
        count: int,
        uv: bool,
        drawn: Pass,
        lit: bool,
    ) -> moderngl.Program:
        mode, shaped, profiled, faces = signature
        fragment = bool(group.material and group.material.glsl)
        head = defines(
            {
                f"MODE_{mode}": True,
                "LIGHTS": count,
                "STRIDE": MAPS + 8 * faces,
                "MAPS": MAPS,
                "FACES": faces or None,
                "SHAPED": shaped,
                "PROFILED": profiled,
                "TELECENTRIC": drawn.view.telecentric,
                "UV": uv,
                "UV_OR_ZERO": "st" if uv else "vec2(0.0)",
                "LENS": drawn.lensmap is not None,
                "LIT": lit,
                "FRAGMENT": fragment,
                "PARAMETERS": max(len(group.brdf.flat()), 1),
            }
        )
        declared = "uniform sampler2D materials;\n"
        if drawn.lensmap is not None:
            declared += "uniform vec2 aperture;\n"
        lights = ""
        if count:
            declared += "layout(std140) uniform Lights { vec4 lights[LIGHTS * STRIDE]; };\n"
            declared += "uniform sampler2D shadow_map[LIGHTS];\n" if faces else ""
            declared += "uniform sampler2D profile[LIGHTS];\n" + text("profile.glsl") if profiled else ""
            lights = text("lights.glsl")
        model = "" if lit else materials.source(group)
        about = f"of material {group.material.where or group.material.name}" if group.material else ""
        program = self.programs.get(
            [text("screen_vertex.glsl")],
            [head, text("common.glsl"), declared, model, lights, text("lighting_fragment.glsl")],
            about,
        )
        put(program, **UNITS)
        if faces:
            put(program, shadow_map=_units(SHADOW_UNIT, count))
        if profiled:
            put(program, profile=_units(PROFILE_UNIT, count))
        return program

    def _screen(self, program: moderngl.Program) -> moderngl.VertexArray:
        if program.glo not in self._arrays:
            self._arrays[program.glo] = self.context.vertex_array(program, [])
        return self._arrays[program.glo]

    def _lens_texture(self, lensmap: Lensmap) -> moderngl.Texture:
        if self._lens is None or self._lens[0] is not lensmap:
            if self._lens is not None:
                self._lens[1].release()
            height, width = lensmap.d.shape[:2]
            texture = self.context.texture((width, height), 2, lensmap.d.tobytes(), dtype="f4")
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
            self._lens = (lensmap, texture)
        return self._lens[1]

    def release(self) -> None:
        for array in self._arrays.values():
            array.release()
        self._arrays.clear()
        self._records.release()
        if self._lens is not None:
            self._lens[1].release()


def _units(first: int, count: int) -> object:
    return first if count == 1 else tuple(range(first, first + count))


def chunks(points: list[Lit], apart: bool) -> Iterator[list[Lit]]:
    """Points of one signature, at most CHUNK at a time; ``apart``: of one lamp only."""
    alike: dict[tuple[object, ...], list[Lit]] = {}
    for point in points:
        alike.setdefault((point.signature, id(point.sample.light) if apart else 0), []).append(point)
    for group in alike.values():
        for i in range(0, len(group), CHUNK):
            yield group[i : i + CHUNK]
