"""The second stage: the light that leaves each surface towards the eye, lamp by lamp, added up over the passes."""

from dataclasses import dataclass
from functools import partial

import moderngl
import numpy as np

from interchange.light import Light
from realtime import materials, stencil, visible_lamps
from realtime.bodies import Bodies
from realtime.context import depth_texture
from realtime.gbuffer import GBuffer
from realtime.layers import ALIKE, AMONG, Layer, Lit, Pass
from realtime.lens import Lensmap
from realtime.programs import Programs, defines, put, text
from realtime.shading import MAP_UNIT, PROFILE_UNIT, SHADOW_UNIT, UNITS, Shading
from realtime.shadow_maps import bind
from realtime.tiles import Tiles
from realtime.tiles import bits as tile_bits
from realtime.uploads import Uploads


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
        self._records = context.buffer(reserve=65536)
        self._lens: tuple[Lensmap, moderngl.Texture] | None = None
        self._kept: Samples | None = None
        self._shading = Shading(context, programs)
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
        sorts = drawn.looked_up or len(self.table.groups) > stencil.MOST_GROUPS
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
        head = defines(drawn.defines)
        program = self.programs.get(
            [text("screen_vertex.glsl")], [head, text("locate.glsl"), text("sort_fragment.glsl")]
        )
        put(program, **UNITS)
        self._draw(program, 0.0, drawn)
        samples.framebuffer.depth_mask = False

    def begin_merged(self, merged: GBuffer, once: Pass, buffer: GBuffer, drawn: Pass) -> None:
        """Take up a pass of which pixels of one smooth surface are lit once: those of ``merged``, sorted by its
        depth. The others are lit at each sample of ``buffer``; samples are whole pixels from here on."""
        self._layers = [Layer(merged, once), Layer(buffer, drawn, ALIKE), Layer(buffer, drawn, AMONG)]
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
            program = self.programs.get(*visible_lamps.sources(light, drawn.view, drawn.defines))
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
            program = self._shading.program(layer, group, chunk, lit, self._tiled)
            world_from_eye = tuple(layer.drawn.view.world_from_eye.T.ravel())
            put(program, world_from_eye=world_from_eye, emitting=float(not chunk), group=float(number))
            if layer.pick:
                put(program, picks=4)
            put(program, focal=tuple(layer.drawn.view.focal), turn=layer.buffer.turn)
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
