"""Which material groups each tile of an image shows, so that a group's program is started on its own tiles only.

A draw over the whole image costs a software rasteriser some 2 ms even where the depth test turns every pixel away;
a tile is one point, as large as the tile, that the vertex shader drops where nothing of the group is.
"""

import moderngl

from realtime.programs import Programs, put, text

SIDE = 32  # px


class Tiles:
    """Two bit fields a tile of the depths by which an image is sorted (see realtime.lighting): pixels lit once, and
    those whose samples stand for themselves. Groups that are 32 apart share a bit."""

    def __init__(self, context: moderngl.Context, programs: Programs) -> None:
        self.context, self.programs = context, programs
        self._bits: moderngl.Texture | None = None
        self._framebuffer: moderngl.Framebuffer | None = None
        self._array: moderngl.VertexArray | None = None
        self._of = (0, 0)

    @property
    def count(self) -> int:
        assert self._bits is not None
        return self._bits.width * self._bits.height

    @property
    def covered(self) -> tuple[int, int, int, int]:
        """The viewport of whole tiles, px."""
        assert self._bits is not None
        return 0, 0, self._bits.width * SIDE, self._bits.height * SIDE

    def find(self, depth: moderngl.Texture) -> None:
        """Write the bits down."""
        framebuffer = self._fitting(depth.size)
        framebuffer.use()
        self.context.disable(moderngl.BLEND | moderngl.DEPTH_TEST)
        program = self.programs.get([text("screen_vertex.glsl")], [text("tiles_fragment.glsl")])
        depth.use(0)
        put(program, sorted_by=0, screen_depth=0.0)
        if self._array is None:
            self._array = self.context.vertex_array(program, [])
        self._array.render(moderngl.TRIANGLES, vertices=3)

    def use(self, unit: int) -> None:
        assert self._bits is not None
        self._bits.use(unit)

    def _fitting(self, size: tuple[int, int]) -> moderngl.Framebuffer:
        if self._framebuffer is None or self._of != size:
            self._release_bits()
            self._of = size
            self._bits = self.context.texture((-(-size[0] // SIDE), -(-size[1] // SIDE)), 2, dtype="u4")
            self._bits.filter = (moderngl.NEAREST, moderngl.NEAREST)
            self._framebuffer = self.context.framebuffer([self._bits])
        return self._framebuffer

    def _release_bits(self) -> None:
        if self._framebuffer is not None and self._bits is not None:
            self._framebuffer.release()
            self._bits.release()
            self._framebuffer = self._bits = None

    def release(self) -> None:
        self._release_bits()
        if self._array is not None:
            self._array.release()
            self._array = None


def bits(depth: float) -> tuple[int, int]:
    """The mask of the tiles with pixels of this depth, as shaders/tiles_fragment.glsl writes it."""
    number = round(depth * 65536)
    bit = 1 << (number & 31)
    return (bit, 0) if number < 16384 else (0, bit)
