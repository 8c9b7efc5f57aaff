"""The first stage: what every texel of a view shows. Lamps play no part in it."""

from dataclasses import dataclass

import moderngl
import numpy as np

from realtime import stencil
from realtime.bodies import Bodies, Group
from realtime.context import depth_texture
from realtime.programs import Programs, defines, put, text, texture_uniforms
from realtime.shadow_maps import bind, set_opacity
from realtime.uploads import Uploads
from realtime.view import View

NOTHING = -1.0  # the body's number where no surface is


@dataclass(eq=False)
class GBuffer:
    """Float textures of one size. ``plane``: 1/Z (Z if telecentric), its slopes, body; ``frame``: shading normal,
    the tangent's direction; ``coordinates``: u, v; ``slopes``: of u/Z and v/Z along the window."""

    size: tuple[int, int]
    plane: moderngl.Texture
    frame: moderngl.Texture
    coordinates: moderngl.Texture | None
    slopes: moderngl.Texture | None
    depth: moderngl.Texture
    framebuffer: moderngl.Framebuffer

    @property
    def textures(self) -> list[moderngl.Texture]:
        return [t for t in (self.plane, self.frame, self.coordinates, self.slopes) if t is not None]

    def release(self) -> None:
        self.framebuffer.release()
        self.depth.release()
        for texture in self.textures:
            texture.release()


def create(context: moderngl.Context, size: tuple[int, int], uv: bool, slopes: bool) -> GBuffer:
    def target() -> moderngl.Texture:
        texture = context.texture(size, 4, dtype="f4")
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        return texture

    plane, frame = target(), target()
    coordinates, along = target() if uv else None, target() if uv and slopes else None
    depth = depth_texture(context, size, stencil=True)
    attachments = [t for t in (plane, frame, coordinates, along) if t is not None]
    return GBuffer(
        size, plane, frame, coordinates, along, depth, stencil.framebuffer(context, attachments, depth)
    )


class GBufferStage:
    def __init__(
        self, context: moderngl.Context, uploads: Uploads, programs: Programs, bodies: Bodies
    ) -> None:
        self.context, self.uploads, self.programs, self.bodies = context, uploads, programs, bodies
        self._buffer: GBuffer | None = None

    def draw(self, view: View, slopes: bool, index: int, threshold: float = 0.0) -> GBuffer:
        """Draw the bodies. ``index``: the sample's number, by which surfaces let rays through; ``threshold`` > 0
        makes that a cut-out instead."""
        uv = self.bodies.table.textured
        buffer = self._fitting(view.size, uv, slopes)
        context = self.context
        context.disable(moderngl.BLEND)
        context.enable(moderngl.DEPTH_TEST)
        context.depth_func = ">"
        buffer.framebuffer.use()
        buffer.framebuffer.clear(0.0, 0.0, 0.0, NOTHING, depth=0.0)
        stencil.clear()
        matrix = view.clip_from_world
        eye_z = view.eye_from_world[2]
        for group, seen in zip(self.bodies.groups, self.bodies.visible(matrix), strict=True):
            if not seen:
                continue
            eye = None if view.telecentric else view.world_from_eye[:3, 3]
            if self.bodies.outside(group, eye, view.near) and not self._cut_by_near(group, view):
                context.enable(moderngl.CULL_FACE)
                context.front_face = "ccw" if group.mirrored else "cw"
            else:
                context.disable(moderngl.CULL_FACE)
            program = self._program(group, view.telecentric, uv, slopes)
            put(
                program,
                clip_from_world=tuple(matrix.T.ravel()),
                eye_z=tuple(eye_z),
            )
            if group.material.normal_map is not None:
                bind(program, "normal_map", self.uploads, group.material.normal_map, 14)
            if group.lets_light_through:
                set_opacity(program, group, self.uploads, index, threshold)
            stencil.write(min(self.bodies.table.place[id(group.material)][1] + 1, 255))
            group.render(context, program)
        stencil.off()
        context.disable(moderngl.CULL_FACE)
        return buffer

    def _cut_by_near(self, group: Group, view: View) -> bool:
        """Whether the near plane may open one of the group's bodies."""
        z = (self.bodies.centres[group.members] - self.bodies.origin - view.world_from_eye[:3, 3]) @ (
            view.world_from_eye[:3, 2]
        )
        return bool((np.abs(z - view.near) < self.bodies.radii[group.members]).any())

    def _program(self, group: Group, telecentric: bool, uv: bool, slopes: bool) -> moderngl.Program:
        material = group.material
        holes = group.lets_light_through
        turns = self.bodies.table.turns or material.normal_map is not None
        head = defines(
            {
                "TELECENTRIC": telecentric,
                "TANGENT": turns,
                "ST": uv or holes or material.normal_map is not None,
                "UV": uv,
                "SLOPES": slopes,
                "NORMAL_MAP": material.normal_map is not None,
                "OPACITY": holes,
                "OPACITY_MAP": holes and material.opacity_map is not None,
            }
        )
        maps = "".join(
            texture_uniforms(name)
            for name, there in (("normal_map", material.normal_map), ("opacity_map", material.opacity_map))
            if there is not None
        )
        return self.programs.get(
            [head, text("gbuffer_vertex.glsl")],
            [head, text("common.glsl"), maps, text("gbuffer_fragment.glsl")],
        )

    def _fitting(self, size: tuple[int, int], uv: bool, slopes: bool) -> GBuffer:
        buffer = self._buffer
        fits = buffer is not None and buffer.size == size and (buffer.coordinates is not None) == uv
        if buffer is not None and fits and (buffer.slopes is not None) == (uv and slopes):
            return buffer
        if buffer is not None:
            buffer.release()
        self._buffer = create(self.context, size, uv, slopes)
        return self._buffer

    def release(self) -> None:
        if self._buffer is not None:
            self._buffer.release()
            self._buffer = None
