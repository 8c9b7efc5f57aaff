"""Pixels lit once: 2 x 2 samples of one smooth surface become one, as multisampling has it.

The others keep their four samples: silhouettes, creases, whatever bends or steps within the pixel. Where the samples'
normals lie within 0.02 rad of their mean, lighting the mean instead is an error of second order; only what changes
within a pixel without a step of the surface is sampled more coarsely: the edge of a shadow, a highlight finer than
a pixel, the horizon of a facet.
"""

from dataclasses import replace

import moderngl

from realtime.bodies import Bodies
from realtime.context import clear_depth
from realtime.gbuffer import GBuffer, Kind, create
from realtime.layers import ALIKE, AMONG, Pass
from realtime.programs import Programs, defines, put, text
from realtime.shading import UNITS


class MergeStage:
    def __init__(self, context: moderngl.Context, programs: Programs, bodies: Bodies) -> None:
        self.context, self.programs, self.bodies = context, programs, bodies
        self._arrays: dict[int, moderngl.VertexArray] = {}
        self._merged: GBuffer | None = None

    def draw(self, buffer: GBuffer, drawn: Pass) -> tuple[GBuffer, Pass]:
        """Half the size of ``buffer``, whose pass ``drawn`` has a grid of 2; its depth is the material group's, as
        the lighting sorts by it, ALIKE more or AMONG where the samples stand for themselves."""
        merged = self._fitting((buffer.size[0] // 2, buffer.size[1] // 2))
        context = self.context
        merged.framebuffer.use()
        clear_depth(0.0)
        context.disable(moderngl.BLEND)
        context.enable(moderngl.DEPTH_TEST)
        context.depth_func = "1"
        head = defines(
            {
                "TANGENT": self.bodies.table.turns,
                "COMPACT": buffer.kind.compact,
                "TELECENTRIC": drawn.view.telecentric,
                "ALIKE": ALIKE,
                "AMONG": AMONG,
            }
        )
        program = self.programs.get(
            [text("screen_vertex.glsl")],
            [head, text("common.glsl"), text("surface.glsl"), text("merge_fragment.glsl")],
        )
        put(program, **UNITS, focal=tuple(drawn.view.focal), turn=buffer.turn)
        for unit, texture in enumerate(buffer.textures):
            texture.use(unit)
        assert self.bodies.lookup is not None
        self.bodies.lookup.use(UNITS["bodies"])
        if program.glo not in self._arrays:
            self._arrays[program.glo] = context.vertex_array(program, [])
        self._arrays[program.glo].render(moderngl.TRIANGLES, vertices=3)
        context.disable(moderngl.DEPTH_TEST)
        seen = drawn.view
        view = replace(seen, focal=seen.focal / 2, centre=seen.centre / 2, size=merged.size)
        return merged, replace(drawn, view=view, grid=1)

    def _fitting(self, size: tuple[int, int]) -> GBuffer:
        kind = Kind(self.bodies.table.turns, uv=False, slopes=False, stencil=False)
        if self._merged is None or (self._merged.size, self._merged.kind) != (size, kind):
            self.release()
            self._merged = create(self.context, size, kind)
        return self._merged

    def release(self) -> None:
        if self._merged is not None:
            self._merged.release()
            self._merged = None
        for array in self._arrays.values():
            array.release()
        self._arrays.clear()
