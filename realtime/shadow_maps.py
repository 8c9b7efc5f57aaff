"""Shadow maps: drawn when a lamp's frustum or the bodies changed, kept otherwise, within a budget of memory."""

from collections import OrderedDict
from dataclasses import dataclass

import moderngl
import numpy as np

from interchange.material import Texture
from interchange.table import Table
from realtime.bodies import Bodies, Group
from realtime.context import depth_texture
from realtime.lamps import CONE, MAPS, POWER, REFERENCE, SHADOW, Sample, shadow_place
from realtime.programs import Programs, defines, put, text, texture_uniforms
from realtime.shadow_fit import (
    FACES,
    MARGIN,
    WIDEST,
    Frustum,
    Visible,
    around,
    cone_to,
    cropped,
    parallel_frustum,
    place_frustum,
)
from realtime.uploads import Uploads

BUDGET = 512 * 2**20  # bytes of maps that are kept
OFFSET = 2e-6  # of the scene's extent: the least that a receiver is moved, against rounding


@dataclass(eq=False)
class _Map:
    texture: moderngl.Texture
    framebuffer: moderngl.Framebuffer

    @property
    def bytes(self) -> int:
        return self.texture.width * self.texture.height * 4

    def release(self) -> None:
        self.framebuffer.release()
        self.texture.release()


class ShadowMaps:
    def __init__(
        self, context: moderngl.Context, uploads: Uploads, programs: Programs, bodies: Bodies
    ) -> None:
        self.context, self.uploads, self.programs, self.bodies = context, uploads, programs, bodies
        self._kept: OrderedDict[tuple[object, ...], _Map] = OrderedDict()
        self._spare: list[_Map] = []
        self._bytes = 0  # of the kept ones
        self.offset = 0.0  # m, see Rasterizer.render

    def frusta(self, sample: Sample, visible: Visible, whole: bool, side: int) -> list[Frustum | None]:
        """One or six frusta (None where nothing that is seen lies in a face), relative to the bodies' origin.
        ``whole``: also where the lamp's own cone lets no light through; ``side``: of a map, texels."""
        found = self._whole_frusta(sample, visible, whole)
        if len(found) == 1 and found[0] is not None:
            casting = self.bodies.corners[self.bodies.casting(sample)]
            found = [cropped(found[0], casting - self.bodies.origin, side)]
        return found

    def _whole_frusta(self, sample: Sample, visible: Visible, whole: bool) -> list[Frustum | None]:
        if sample.place is None:
            return [parallel_frustum(sample.direction, visible)]
        axis, cosine = cone_to(sample.place, visible.bounds)
        beam = np.cos(min(sample.light.cone_angle, np.pi))
        if beam > max(cosine, WIDEST) and not whole:
            axis, cosine = -sample.light.world_from_light[:3, 2], beam
        if cosine > WIDEST:
            tangent = 1.02 * np.sqrt(1 - cosine**2) / cosine + 2 * self._parallax(sample, visible)
            return [place_frustum(shadow_place(sample, axis), around(axis), tangent, visible)]
        return [place_frustum(shadow_place(sample, r[2]), r, MARGIN, visible) for r in FACES]

    @staticmethod
    def _parallax(sample: Sample, visible: Visible) -> float:
        """How far the frustum must open for a point that lies off the lamp's middle."""
        if sample.mode not in ("SPHERE", "CYLINDER"):
            return 0.0
        assert sample.place is not None
        nearest = np.clip(sample.place, visible.bounds[0], visible.bounds[1])
        distance = float(np.linalg.norm(nearest - sample.place))
        return sample.light.radius / max(distance, sample.light.radius)

    def record(self, sample: Sample, frusta: list[Frustum | None], side: int, extent: float) -> np.ndarray:
        """The lamp's record with its maps' matrices: (MAPS + 8 a frustum, 4) float32. ``side``: texels."""
        if len(frusta) == 6:
            side //= 2
        record = np.zeros((MAPS + 8 * len(frusta), 4))
        record[:MAPS] = sample.record
        tangent = max((f.tangent for f in frusta if f is not None), default=0.0)
        record[SHADOW] = (
            side,
            1 / side,
            2 * tangent / side,
            -self.offset if self.offset > OFFSET * extent else OFFSET * extent,
        )
        for i, frustum in enumerate(frusta):
            if frustum is not None:
                record[REFERENCE, :3] = frustum.axis
                m = MAPS + 8 * i
                record[m : m + 4] = frustum.clip_from_world
                record[m + 4 : m + 7] = frustum.slopes
                record[m + 4 : m + 6, :3] *= 2 / side
                record[POWER, 3], record[m + 5, 3] = sample.record[CONE, :2]
        if len(frusta) == 1:
            column, row, kept = crop_of(frusta[0], side)
            record[SHADOW, 1] = 1 / kept
            record[MAPS + 6 if sample.mode in ("SPHERE", "CYLINDER") else 0, 3] = 4096 * column + row
        return record.astype(np.float32)

    def draw(self, frusta: list[Frustum | None], side: int, sample: Sample, index: int) -> moderngl.Texture:
        """The map of these frusta, ``index`` choosing the chances of surfaces that let light through."""
        if len(frusta) == 6:
            side //= 2
        size = (side * 3, side * 2) if len(frusta) == 6 else 2 * crop_of(frusta[0], side)[2:]
        chancy = any(g.lets_light_through for g in self.bodies.groups)
        matrices = tuple(None if f is None else (f.clip_from_world.tobytes(), f.crop) for f in frusta)
        key = (matrices, size, self.bodies.shape, self.bodies.origin.tobytes(), index if chancy else 0)
        if key in self._kept:
            self._kept.move_to_end(key)
            return self._kept[key].texture
        shadow = self._take(size)
        self._kept[key] = shadow
        self.uploads.counts["shadow map"] += 1
        shadow.framebuffer.use()
        self.context.disable(moderngl.BLEND)
        self.context.enable(moderngl.DEPTH_TEST)
        self.context.depth_func = ">"
        shadow.framebuffer.clear(depth=0.0)  # llvmpipe takes longer for a part than for the whole
        for i, frustum in enumerate(frusta):
            if frustum is not None:
                column, row, _ = crop_of(frustum, side)
                tile = (i % 3 * side, i // 3 * side)
                shadow.framebuffer.viewport = (tile[0] - column, tile[1] - row, side, side)
                self._draw_face(frustum, sample, index)
        return shadow.texture

    def _draw_face(self, frustum: Frustum, sample: Sample, index: int) -> None:
        context = self.context
        casting = self.bodies.casting(sample)
        for group, seen in zip(self.bodies.groups, self.bodies.visible(frustum.clip_from_world), strict=True):
            if not seen or not casting[group.members].any():
                continue
            if self.bodies.outside(group, sample.place, sample.light.radius):
                context.enable(moderngl.CULL_FACE)
                context.front_face = "ccw" if group.mirrored else "cw"
            else:
                context.disable(moderngl.CULL_FACE)
            program = depth_program(self.programs, group, self.uploads, index)
            first = crop_of(frustum, 0)[:2]
            put(program, clip_from_world=tuple(frustum.clip_from_world.T.ravel()), first=first)
            group.render(context, program)
        context.disable(moderngl.CULL_FACE)

    def _take(self, size: tuple[int, int]) -> _Map:
        self._bytes += 4 * size[0] * size[1]
        while self._kept and self._bytes > BUDGET:
            self._set_aside(next(iter(self._kept)))
        for i, spare in enumerate(self._spare):
            if spare.texture.size == size:
                return self._spare.pop(i)
        unused = sum(spare.bytes for spare in self._spare)
        while self._spare and self._bytes + unused > BUDGET:
            oldest = self._spare.pop(0)
            unused -= oldest.bytes
            oldest.release()
        texture = depth_texture(self.context, size)
        return _Map(texture, self.context.framebuffer(depth_attachment=texture))

    def expire(self) -> None:
        """Give the maps of an earlier shape of the scene free for others."""
        for key in [k for k in self._kept if k[2] != self.bodies.shape]:
            self._set_aside(key)

    def _set_aside(self, key: tuple[object, ...]) -> None:
        shadow = self._kept.pop(key)
        self._bytes -= shadow.bytes
        self._spare.append(shadow)

    def forget_spares(self) -> None:
        for spare in self._spare:
            spare.release()
        self._spare.clear()

    def release(self) -> None:
        self.forget_spares()
        for shadow in self._kept.values():
            shadow.release()
        self._kept.clear()
        self._bytes = 0


def crop_of(frustum: Frustum | None, side: int) -> tuple[int, int, int]:
    """First column, first row and side of what is kept of a map of ``side``² texels."""
    return (0, 0, side) if frustum is None or frustum.crop is None else frustum.crop


def depth_program(programs: Programs, group: Group, uploads: Uploads, index: int) -> moderngl.Program:
    """The program that draws a group's depth, its uniforms set."""
    material = group.material
    holes = group.lets_light_through
    head = defines({"OPACITY": holes, "OPACITY_MAP": holes and material.opacity_map is not None})
    fragment = [head]
    if holes:
        fragment += [text("common.glsl"), texture_uniforms("opacity_map")]
    program = programs.get([head, text("shadow_vertex.glsl")], [*fragment, text("shadow_fragment.glsl")])
    if holes:
        set_opacity(program, group, uploads, index, 0.0)
    return program


def set_opacity(
    program: moderngl.Program, group: Group, uploads: Uploads, index: int, threshold: float
) -> None:
    """The uniforms by which a surface lets rays through; ``threshold`` > 0 cuts out what has none of its own."""
    material = group.material
    put(
        program,
        opacity=material.opacity,
        threshold=material.opacity_threshold or threshold,
        sample_index=index,
    )
    if material.opacity_map is not None:
        bind(program, "opacity_map", uploads, material.opacity_map, 15)


def bind(program: moderngl.Program, name: str, uploads: Uploads, texture: Texture | Table, unit: int) -> None:
    """A texture on a unit, with the uniforms that ``sampled`` takes, or a table."""
    picture = uploads.picture(texture)
    picture.texture.use(unit)
    put(program, **{name: unit, f"{name}_uv": picture.uv_from_st, f"{name}_wrap": picture.wrap})
