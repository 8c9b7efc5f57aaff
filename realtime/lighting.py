"""The second stage: the light that leaves each surface towards the eye, lamp by lamp, added up over the passes."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import moderngl
import numpy as np

from interchange.light import Light
from realtime import materials, stencil, visible_lamps
from realtime.bodies import Bodies
from realtime.context import depth_texture
from realtime.gbuffer import GBuffer
from realtime.lamps import MAPS, POWER, Sample, beam, is_shaped, rows
from realtime.lens import Lensmap
from realtime.materials import Group
from realtime.programs import Programs, defines, put, text
from realtime.shadow_fit import Frustum
from realtime.shadow_maps import bind
from realtime.tiles import Tiles
from realtime.tiles import bits as tile_bits
from realtime.uploads import Uploads
from realtime.view import View

CHUNK = 4  # lamps a draw
VECTORS = 31  # that a vertex shader may pass on
# depth of a pixel whose samples are lit one by one: if they are of one group more than its own, else
ALIKE, AMONG = 0.25, 0.75
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


Signature = tuple[str, bool, bool, str, int]


@dataclass(frozen=True, eq=False)
class Lit:
    """A lamp's point, ready for the shader: its record (rows, 4), and the frusta of its shadow map, if it casts any."""

    sample: Sample
    record: np.ndarray
    frusta: list[Frustum | None]

    @property
    def signature(self) -> Signature:
        """Points of one signature are lit by one program: mode, shaped, focused, beam, shadow maps."""
        light = self.sample.light
        return (
            self.sample.mode,
            is_shaped(light),
            light.focus != 0,
            beam(light),
            len(self.frusta),
        )

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


@dataclass(frozen=True, eq=False)
class Layer:
    """What is lit together: all samples of a pass, or, with ``base``, the 2 x 2 of each mixed pixel: ALIKE or AMONG."""

    buffer: GBuffer
    drawn: Pass
    base: float = 0.0

    @property
    def pick(self) -> bool:
        return self.base > 0

    def depth(self, number: int) -> float:
        """By which the samples of material group ``number`` are told apart: exact in 32 bits."""
        return AMONG if self.base == AMONG else self.base + (number + 1) / 65536


@dataclass(eq=False)
class Samples:
    """Radiance of every sample of one pass. ``depth`` says which group each belongs to: by its stencil, or as a
    depth where ``sorts`` (it is then its own, unless another is given)."""

    color: moderngl.Texture
    depth: moderngl.Texture
    framebuffer: moderngl.Framebuffer
    sorts: bool
    own: bool

    def release(self) -> None:
        self.framebuffer.release()
        self.color.release()
        if self.own:
            self.depth.release()


class LightingStage:
    """``begin`` a pass, ``add`` light to it, ``resolve`` it into an image; the last two as often as wanted."""

    def __init__(
        self, context: moderngl.Context, uploads: Uploads, programs: Programs, bodies: Bodies
    ) -> None:
        self.context, self.uploads, self.programs, self.bodies = context, uploads, programs, bodies
        self.table = bodies.table
        self._arrays: dict[int, moderngl.VertexArray] = {}
        self._by_key: dict[tuple[object, ...], moderngl.Program] = {}
        self._records = context.buffer(reserve=65536)
        self._lens: tuple[Lensmap, moderngl.Texture] | None = None
        self._kept: Samples | None = None
        self._vectors = min(VECTORS, int(context.info["GL_MAX_VARYING_VECTORS"]) - 1)
        self.tiles = Tiles(context, programs)
        self._tiled = False

    def begin(self, buffer: GBuffer, drawn: Pass) -> None:
        """Take up a pass: sort its samples by material group."""
        self._layers = [Layer(buffer, drawn)]
        self._tiled = False
        size = buffer.size
        if drawn.lensmap is not None:
            height, width = drawn.lensmap.d.shape[:2]
            size = ((width - 1) * drawn.grid, (height - 1) * drawn.grid)
            self._lens_texture(drawn.lensmap).use(UNITS["lens"])
        sorts = drawn.lensmap is not None or len(self.table.groups) > stencil.MOST_GROUPS
        self._samples = self._fitting(size, None if sorts else buffer.depth, sorts)
        for unit, texture in enumerate(buffer.textures):
            texture.use(unit)
        if self.bodies.lookup is not None:
            self.bodies.lookup.use(UNITS["bodies"])
        context, samples = self.context, self._samples
        samples.framebuffer.use()
        samples.framebuffer.depth_mask = sorts
        samples.framebuffer.clear(depth=0.0)
        if not sorts:
            return
        context.disable(moderngl.BLEND)
        context.enable(moderngl.DEPTH_TEST)
        context.depth_func = "1"
        head = defines({"LENS": drawn.lensmap is not None})
        program = self.programs.get(
            [text("screen_vertex.glsl")], [head, text("locate.glsl"), text("sort_fragment.glsl")]
        )
        put(program, **UNITS)
        self._draw(program, 0.0, drawn)
        samples.framebuffer.depth_mask = False

    def begin_merged(self, merged: GBuffer, once: Pass, buffer: GBuffer, drawn: Pass) -> None:
        """Take up a pass of which pixels of one smooth surface are lit once: those of ``merged``, sorted by its
        depth. The others are lit at each sample of ``buffer``; samples are whole pixels from here on."""
        self._layers = [Layer(merged, once), Layer(buffer, drawn, ALIKE)]
        if len(self.table.groups) > 1:
            self._layers.append(Layer(buffer, drawn, AMONG))
        self.tiles.find(merged.depth)
        self._tiled = True
        self._samples = self._fitting(merged.size, merged.depth, sorts=True)
        self._samples.framebuffer.use()
        self._samples.framebuffer.depth_mask = False
        self._samples.framebuffer.clear()

    def show(self, lights: list[Light], origin: np.ndarray) -> None:
        """Draw the lamps that the camera sees over what lies behind them; after ``begin``, before ``add``."""
        context, drawn = self.context, self._layers[0].drawn
        seen = visible_lamps.far_to_near(lights, drawn.view.world_from_eye[:3, 3] + origin)
        sorts = self._samples.sorts
        self._samples.framebuffer.depth_mask = sorts
        self._samples.framebuffer.use()
        context.disable(moderngl.BLEND)
        if sorts:
            context.enable(moderngl.DEPTH_TEST)
            context.depth_func = "1"
        else:
            context.disable(moderngl.DEPTH_TEST)
            stencil.write(0)
        for light in seen:
            program = self.programs.get(*visible_lamps.sources(light, drawn.view, drawn.lensmap is not None))
            put(program, **UNITS)
            put(program, world_from_eye=tuple(drawn.view.world_from_eye.T.ravel()))
            visible_lamps.fill(program, light, origin, self.uploads, self._records)
            self._draw(program, 0.0, drawn)
        stencil.off()
        self._samples.framebuffer.depth_mask = False

    def add(self, chunk: list[Lit], maps: list[moderngl.Texture], lit: bool = False) -> None:
        """Add the light of a chunk; of none, what surfaces emit. ``lit``: visibility instead."""
        context = self.context
        self._samples.framebuffer.use()
        context.enable(moderngl.BLEND)
        context.blend_func = moderngl.ONE, moderngl.ONE
        if self._samples.sorts:
            context.enable(moderngl.DEPTH_TEST)
            context.depth_func = "<" if lit else "=="
        else:
            context.disable(moderngl.DEPTH_TEST)
        if self.bodies.lookup is not None:
            self.bodies.lookup.use(UNITS["bodies"])
        if (lensmap := self._layers[0].drawn.lensmap) is not None:
            self._lens_texture(lensmap).use(UNITS["lens"])
        if self.table.texture is not None:
            self.table.texture.use(UNITS["materials"])
        self._bind(chunk, maps)
        for layer in self._layers:
            self._add_layer(layer, chunk, lit)
        stencil.off()
        context.disable(moderngl.DEPTH_TEST | moderngl.BLEND)

    def _add_layer(self, layer: Layer, chunk: list[Lit], lit: bool) -> None:
        for unit, texture in enumerate(layer.buffer.textures):
            texture.use(unit)
        for number, group in enumerate(self.table.groups[:1] if lit else self.table.groups):
            program = self._program(layer, group, chunk, lit)
            world_from_eye = tuple(layer.drawn.view.world_from_eye.T.ravel())
            put(program, world_from_eye=world_from_eye, emitting=float(not chunk), group=float(number))
            if layer.pick:
                put(program, picks=4)
            if not lit:
                if group.alone:
                    materials.put_numbers(program, group, self.table)
                for i, (name, record) in enumerate(sorted(group.textures.items())):
                    bind(program, name, self.uploads, record, MAP_UNIT + i)
            if not self._samples.sorts:
                stencil.only(None if lit else number + 1)
            depth = 0.0 if lit else layer.depth(number)
            self._draw(program, depth, layer.drawn, depth)

    def resolve(self, target: moderngl.Framebuffer, weight: float) -> None:
        """Add the samples' sum over each pixel, times ``weight``, to ``target``, and start afresh."""
        context, samples = self.context, self._samples
        target.use()
        context.disable(moderngl.DEPTH_TEST)
        context.enable(moderngl.BLEND)
        context.blend_func = moderngl.ONE, moderngl.ONE
        samples.color.use(UNITS["samples"])
        grid = self._layers[0].drawn.grid
        head = defines({"GRID": grid})
        program = self.programs.get([text("screen_vertex.glsl")], [head, text("resolve_fragment.glsl")])
        put(program, samples=UNITS["samples"], weight=weight)
        self._draw(program, 0.0, self._layers[0].drawn)
        context.disable(moderngl.BLEND)
        samples.framebuffer.use()
        samples.framebuffer.clear(depth=0.0)  # the depth is masked, and stays

    def read(self) -> np.ndarray:
        """(H, W, 3) float32 radiance of the samples as they are."""
        width, height = self._samples.color.size
        data = self._samples.framebuffer.read(components=3, dtype="f4")
        return np.frombuffer(data, np.float32).reshape(height, width, 3)

    def _draw(self, program: moderngl.Program, depth: float, drawn: Pass, wanted: float = 0.0) -> None:
        """``wanted``: of tiles, those with pixels of this depth; 0 is the whole image."""
        put(
            program,
            screen_depth=depth,
            pinhole=(*drawn.view.focal, *drawn.view.centre),
            jitter=tuple(drawn.jitter),
            aperture=tuple(drawn.aperture),
            grid=float(drawn.grid),
        )
        if program.glo not in self._arrays:
            self._arrays[program.glo] = self.context.vertex_array(program, [])
        if not (self._tiled and wanted):
            self._arrays[program.glo].render(moderngl.TRIANGLES, vertices=3)
            return
        self.tiles.use(UNITS["tiles"])
        put(program, wanted=tile_bits(wanted))
        self.context.enable(moderngl.PROGRAM_POINT_SIZE)
        self._samples.framebuffer.viewport = self.tiles.covered
        self._arrays[program.glo].render(moderngl.POINTS, vertices=self.tiles.count)
        self._samples.framebuffer.viewport = (0, 0, *self._samples.color.size)

    def _fitting(self, size: tuple[int, int], depth: moderngl.Texture | None, sorts: bool) -> Samples:
        """``depth``: the texture that tells the groups apart, None for one of its own."""
        kept = self._kept
        same = kept is not None and kept.color.size == size and kept.sorts == sorts
        if kept is not None and same and (kept.own if depth is None else kept.depth is depth):
            return kept
        if kept is not None:
            kept.release()
        color = self.context.texture(size, 4, dtype="f4")
        color.filter = (moderngl.NEAREST, moderngl.NEAREST)
        found = depth or depth_texture(self.context, size)
        make = self.context.framebuffer if sorts else partial(stencil.framebuffer, self.context)
        self._kept = Samples(color, found, make([color], found), sorts, own=depth is None)
        return self._kept

    def _bind(self, chunk: list[Lit], maps: list[moderngl.Texture]) -> None:
        if not chunk:
            return
        self._records.write(np.concatenate([p.record for p in chunk]).astype(np.float32).tobytes())
        self._records.bind_to_uniform_block(0)
        for i, texture in enumerate(maps):
            texture.use(SHADOW_UNIT + i)
        for i, point in enumerate(chunk):
            if (shown := point.sample.light.beam) is not None:
                self.uploads.beam(shown).texture.use(PROFILE_UNIT + i)

    def _program(self, layer: Layer, group: Group, chunk: list[Lit], lit: bool) -> moderngl.Program:
        buffer, drawn, pick = layer.buffer, layer.drawn, layer.pick
        signature = chunk[0].signature if chunk else ("NONE", False, False, "", 0)
        uv, telecentric = buffer.coordinates is not None, drawn.view.telecentric
        key = (
            lit or group.key,
            signature,
            len(chunk),
            uv,
            telecentric,
            drawn.lensmap is not None,
            pick,
            self._tiled,
        )
        if key not in self._by_key:
            self._by_key[key] = self._compose(group, signature, len(chunk), uv, drawn, lit, pick)
        return self._by_key[key]

    def _compose(
        self,
        group: Group,
        signature: Signature,
        count: int,
        uv: bool,
        drawn: Pass,
        lit: bool,
        pick: bool,
    ) -> moderngl.Program:
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
                "LENS": drawn.lensmap is not None,
                "LIT": lit,
                "PICK": pick,
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
                text("tile_vertex.glsl" if self._tiled else "screen_vertex.glsl"),
            ],
            [
                head,
                text("common.glsl"),
                text("locate.glsl"),
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
        if self._kept is not None:
            self._kept.release()
        self.tiles.release()


def beam_source(beam: str) -> str:
    """The text that reads a lamp's profile or projected image."""
    if not beam:
        return ""
    return "uniform sampler2D profile[LIGHTS];\n" + text(
        "projector.glsl" if beam == "PROJECTED" else "profile.glsl"
    )


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
