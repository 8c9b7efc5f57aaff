"""The first stage: what every texel of a view shows. Lamps play no part in it."""

from dataclasses import dataclass

import moderngl
import numpy as np

from realtime import stencil
from realtime.bend import RINGS
from realtime.bodies import Bodies, Group
from realtime.context import clear_color, clear_depth, clear_depth_and_stencil, clear_whole, depth_texture
from realtime.programs import Programs, defines, put, text, texture_uniforms
from realtime.shadow_maps import bind, set_opacity
from realtime.through import LEVELS, Through
from realtime.uploads import Uploads
from realtime.view import View

SPLITTING = {"RINGS": RINGS, "LEVELS": f"{LEVELS:.1f}"}
MOST_COMPACT, TURNS = 4096, 15  # bodies and turns that a compact buffer tells apart
NOTHING = -1.0  # the body's number where no surface is


@dataclass(frozen=True)
class Kind:
    """What a G-buffer holds: tangents that ``turns``, texture coordinates and their ``slopes``, a stencil. ``compact``:
    what is needed of samples that are merged, in sixteen bytes (shaders/surface.glsl)."""

    turns: bool
    uv: bool
    slopes: bool
    stencil: bool
    compact: bool = False


@dataclass(eq=False)
class GBuffer:
    """Float textures of one size. ``surface``: 1/Z (Z if telecentric), shading normal, body; ``facet``: slopes of
    1/Z along the window, the tangent's direction where a material turns; ``coordinates``: u, v; ``slopes``: of u/Z
    and v/Z. Where no body is, all but ``surface`` and ``depth`` are left as they were. A compact one has no
    ``facet``, and tells by the number of its ``turn`` what is left over."""

    size: tuple[int, int]
    kind: Kind
    surface: moderngl.Texture
    facet: moderngl.Texture | None
    coordinates: moderngl.Texture | None
    slopes: moderngl.Texture | None
    depth: moderngl.Texture
    framebuffer: moderngl.Framebuffer
    turn: int = 0

    @property
    def textures(self) -> list[moderngl.Texture]:
        return [t for t in (self.surface, self.facet, self.coordinates, self.slopes) if t is not None]

    def release(self) -> None:
        self.framebuffer.release()
        self.depth.release()
        for texture in self.textures:
            texture.release()

    def clear(self) -> None:
        """What is read where no body is drawn; the framebuffer is bound from here on."""
        self.framebuffer.use()
        if not self.kind.compact:
            clear_color(0, (0.0, 0.0, 0.0, NOTHING))
        else:
            self.turn = self.turn % TURNS + 1
            if self.turn == 1:
                clear_whole(0, (0, 0, 0, 0))
        if self.kind.stencil:
            clear_depth_and_stencil(0.0, 0)
        else:
            clear_depth(0.0)


def create(context: moderngl.Context, size: tuple[int, int], kind: Kind) -> GBuffer:
    def target(components: int = 4, dtype: str = "f4") -> moderngl.Texture:
        texture = context.texture(size, components, dtype=dtype)
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        return texture

    surface = target(4, "u4") if kind.compact else target()
    facet = None if kind.compact else target(4 if kind.turns else 2)
    coordinates, along = target() if kind.uv else None, target() if kind.uv and kind.slopes else None
    depth = depth_texture(context, size, kind.stencil)
    attachments = [t for t in (surface, facet, coordinates, along) if t is not None]
    attach = stencil.framebuffer if kind.stencil else moderngl.Context.framebuffer
    return GBuffer(size, kind, surface, facet, coordinates, along, depth, attach(context, attachments, depth))


class GBufferStage:
    def __init__(
        self, context: moderngl.Context, uploads: Uploads, programs: Programs, bodies: Bodies
    ) -> None:
        self.context, self.uploads, self.programs, self.bodies = context, uploads, programs, bodies
        self._buffer: GBuffer | None = None

    def draw(
        self,
        view: View,
        slopes: bool,
        index: int,
        threshold: float = 0.0,
        marked: bool = True,
        through: Through | None = None,
    ) -> GBuffer:
        """Draw the bodies. ``index``: the sample's number, by which surfaces let rays through; ``threshold`` > 0
        makes that a cut-out instead. ``marked``: with the material groups in a stencil. ``through``: the lens."""
        uv, turns = self.bodies.table.textured, self.bodies.table.turns
        compact = not (marked or uv or turns or len(self.bodies.bodies) > MOST_COMPACT)
        buffer = self._fitting(view.size, Kind(turns, uv, slopes, marked, compact))
        context = self.context
        context.disable(moderngl.BLEND)
        context.enable(moderngl.DEPTH_TEST)
        context.depth_func = ">"
        buffer.clear()
        matrix = view.clip_from_world if through is None else through.wide
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
            if marked:
                stencil.write(min(self.bodies.table.place[id(group.material)][1] + 1, 255))
            split = None if through is None else through.split(group)
            for patches in (False, True) if split is not None else (False,):
                program = self._program(group, view.telecentric, buffer.kind, through, patches)
                put(program, focal=tuple(view.focal), turn=buffer.turn)
                if through is None:
                    put(program, clip_from_world=tuple(matrix.T.ravel()), eye_z=tuple(eye_z))
                else:
                    put(program, **through.uniforms)
                if patches and through is not None:
                    put(program, **through.split_uniforms(group))
                if group.material.normal_map is not None:
                    bind(program, "normal_map", self.uploads, group.material.normal_map, 14)
                if group.lets_light_through:
                    set_opacity(program, group, self.uploads, index, threshold)
                group.render(context, program, split, patches)
        stencil.off()
        context.disable(moderngl.CULL_FACE)
        return buffer

    def _cut_by_near(self, group: Group, view: View) -> bool:
        """Whether the near plane may open one of the group's bodies."""
        z = (self.bodies.centres[group.members] - self.bodies.origin - view.world_from_eye[:3, 3]) @ (
            view.world_from_eye[:3, 2]
        )
        return bool((np.abs(z - view.near) < self.bodies.radii[group.members]).any())

    def _program(
        self,
        group: Group,
        telecentric: bool,
        kind: Kind,
        through: Through | None,
        patches: bool,
    ) -> moderngl.Program:
        material = group.material
        holes = group.lets_light_through
        turns = kind.turns or material.normal_map is not None
        head = defines(
            {
                "TELECENTRIC": telecentric,
                "TANGENT": turns,
                "ST": kind.uv or holes or material.normal_map is not None,
                "UV": kind.uv,
                "SLOPES": kind.slopes,
                "COMPACT": kind.compact,
                "NORMAL_MAP": material.normal_map is not None,
                "OPACITY": holes,
                "OPACITY_MAP": holes and material.opacity_map is not None,
                "SPLIT": patches,
                **(SPLITTING | through.bend.defines if through is not None else {}),
            }
        )
        last = [text("distort.glsl")] if through is not None else []
        last.append(text("gbuffer_project.glsl"))
        first = text("gbuffer_corners.glsl") if patches else "\n".join(last)
        tessellation = [
            "\n".join([head, text("gbuffer_tess_control.glsl")]),
            "\n".join([head, *last, text("gbuffer_tess_evaluation.glsl")]),
        ]
        maps = "".join(
            texture_uniforms(name)
            for name, there in (("normal_map", material.normal_map), ("opacity_map", material.opacity_map))
            if there is not None
        )
        return self.programs.get(
            [head, first, text("gbuffer_vertex.glsl")],
            [head, text("common.glsl"), maps, text("gbuffer_fragment.glsl")],
            tessellation=tessellation if patches else (),
        )

    def _fitting(self, size: tuple[int, int], kind: Kind) -> GBuffer:
        buffer = self._buffer
        if buffer is not None and (buffer.size, buffer.kind) == (size, kind):
            return buffer
        if buffer is not None:
            buffer.release()
        self._buffer = create(self.context, size, kind)
        return self._buffer

    def release(self) -> None:
        if self._buffer is not None:
            self._buffer.release()
            self._buffer = None
