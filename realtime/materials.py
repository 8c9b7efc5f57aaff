"""Materials on the GPU: one table of parameters, and groups of rows that one program shades.

A row of the table holds the emission and then ``brdf.flat()``, four numbers a texel. Materials whose formula has the
same text and that have no texture lie in adjacent rows and are shaded together; one with textures of its own, or with
a GLSL fragment, is a group by itself.
"""

from dataclasses import dataclass

import moderngl
import numpy as np

from interchange import shader
from interchange.brdf import Brdf
from interchange.brdf.lobes import is_isotropic
from interchange.material import Material, Texture
from interchange.problems import BrightfieldError
from interchange.table import Table
from realtime.uploads import Uploads


@dataclass(frozen=True, eq=False)
class Group:
    """Rows [first, last) of the table. ``material`` is set for a group of one, which has its own textures or text."""

    first: int
    last: int
    brdf: Brdf
    material: Material | None
    isotropic: bool  # no member changes when the surface turns about its normal

    @property
    def alone(self) -> bool:
        """Whether the group has a single row, whose numbers are then uniforms."""
        return self.last - self.first == 1

    @property
    def textures(self) -> dict[str, Texture | Table]:
        """By the name of the sampler in the group's program."""
        if self.material is None:
            return {}
        named: dict[str, Texture | Table] = {f"map_{n}": t for n, t in self.material.maps.items()}
        named |= {f"table_{k}": table for k, table in enumerate(self.brdf.tables)}
        if self.material.emission_map is not None:
            named["map_of_emission"] = self.material.emission_map
        return named

    @property
    def key(self) -> tuple[object, ...]:
        """What decides the program's text."""
        own = self.material
        common = (self.brdf.structure, *map(len, self.brdf.tables), self.isotropic, self.alone)
        if own is None:
            return common
        maps = tuple((name, t.pixels.shape[2]) for name, t in sorted(own.maps.items()))
        glow = own.emission_map.pixels.shape[2] if own.emission_map is not None else 0
        return (*common, maps, glow, own.glsl)


class MaterialTable:
    def __init__(self, context: moderngl.Context, uploads: Uploads) -> None:
        self.context, self.uploads = context, uploads
        self.materials: tuple[Material, ...] = ()
        self.groups: tuple[Group, ...] = ()
        self.place: dict[int, tuple[int, int]] = {}  # of a material: row and number of its group
        self.numbers = np.zeros((1, 1, 4), np.float32)
        self.texture: moderngl.Texture | None = None

    def update(self, materials: tuple[Material, ...]) -> bool:
        """Bring the table to these materials (each once). True if rows moved."""
        if len(materials) == len(self.materials) and all(
            a is b for a, b in zip(materials, self.materials, strict=True)
        ):
            return False
        for material in materials:
            check(material)

        def order(material: Material) -> tuple[str, int]:
            return material.brdf.structure, _stands_alone(material)

        ordered = sorted(materials, key=order)
        groups: list[Group] = []
        for row, material in enumerate(ordered):
            last = groups[-1] if groups else None
            free = not material.glsl and is_isotropic(material.brdf)
            if _stands_alone(material):
                groups.append(Group(row, row + 1, material.brdf, material, free))
            elif last and last.material is None and last.brdf.structure == material.brdf.structure:
                groups[-1] = Group(last.first, row + 1, last.brdf, None, last.isotropic and free)
            else:
                groups.append(Group(row, row + 1, material.brdf, None, free))
        place = {
            id(material): (row, number)
            for number, group in enumerate(groups)
            for row, material in enumerate(ordered[group.first : group.last], group.first)
        }
        moved = list(place.values()) != [self.place.get(i) for i in place]
        self.materials, self.groups, self.place = materials, tuple(groups), place
        self._write(ordered)
        return moved

    @property
    def emits(self) -> bool:
        return any(any(m.emission) or m.emission_map is not None for m in self.materials)

    @property
    def textured(self) -> bool:
        """Whether any material must know where on the surface a point lies."""
        return any(needs_uv(m) for m in self.materials)

    @property
    def turns(self) -> bool:
        """Whether any material must know its tangent."""
        return not all(g.isotropic for g in self.groups)

    def _write(self, ordered: list[Material]) -> None:
        width = 1 + max((-(-len(m.brdf.flat()) // 4) for m in ordered), default=0)
        table = np.zeros((max(len(ordered), 1), width, 4), np.float32)
        for row, material in enumerate(ordered):
            table[row, 0, :3] = material.emission
            numbers = material.brdf.flat()
            table[row, 1:].reshape(-1)[: len(numbers)] = numbers
        size = (width, len(table))
        if self.texture is None or self.texture.size != size:
            if self.texture is not None:
                self.texture.release()
            self.texture = self.context.texture(size, 4, dtype="f4")
            self.texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self.texture.write(table.tobytes())
        self.numbers = table
        self.uploads.counts["materials"] += 1

    def release(self) -> None:
        if self.texture is not None:
            self.texture.release()
            self.texture = None


def _stands_alone(material: Material) -> bool:
    return needs_uv(material) or bool(material.glsl or material.brdf.tables)


def needs_uv(material: Material) -> bool:
    """Whether a point's reflectance depends on where on the surface it lies."""
    return bool(material.maps or material.emission_map is not None or material.glsl)


def check(material: Material) -> None:
    """BrightfieldError where a texture does not fit the parameter that it replaces."""
    slots = material.brdf.slots()
    model = type(material.brdf).__name__
    for name, texture in material.maps.items():
        if name not in slots:
            raise BrightfieldError(
                f"A texture must replace a parameter of {model} ({', '.join(slots)}); got {name}. "
                f"({str(material.where) or material.name})"
            )
        channels = texture.pixels.shape[2]
        if channels not in (1, 3) or (channels == 3 and len(slots[name]) % 3):
            raise BrightfieldError(
                f"The texture of {model}.{name} must have 1 channel{' or 3' if len(slots[name]) % 3 == 0 else ''}; "
                f"got {channels}. ({str(material.where) or material.name})"
            )


def source(group: Group) -> str:
    """GLSL: ``material(row, uv, p, emission)``, and ``model(wi, wo, p)`` or the material's own ``brdf(wi, wo, uv)``."""
    count = len(group.brdf.flat())

    def row(i: int) -> str:
        return f"numbers[{i}]" if group.alone else f"texelFetch(materials, ivec2({i}, row), 0)"

    lines = [f"void material(int row, vec2 st, out float p[{max(count, 1)}], out vec3 emission)", "{"]
    if group.alone:
        lines.insert(0, f"uniform vec4 numbers[{1 + -(-count // 4)}];")
    lines.append(f"    vec4 q = {row(0)};")
    lines.append("    emission = q.rgb;")
    if count == 0:
        lines.append("    p[0] = 0.0;")
    for i in range(count):
        if i % 4 == 0:
            lines.append(f"    q = {row(1 + i // 4)};")
        lines.append(f"    p[{i}] = q.{'xyzw'[i % 4]};")
    head: list[str] = []
    slots = group.brdf.slots()
    if group.brdf.tables:
        head.append(shader.ROW)
    for sampler, texture in group.textures.items():
        if isinstance(texture, Table):
            head.append(f"uniform sampler2D {sampler};")
            continue
        head.append(
            f"uniform sampler2D {sampler};\nuniform mat3 {sampler}_uv;\nuniform ivec2 {sampler}_wrap;"
        )
        grey = ".xxx" if texture.pixels.shape[2] == 1 else ""
        lookup = f"sampled({sampler}, {sampler}_uv, {sampler}_wrap, st){grey}"
        if sampler == "map_of_emission":
            lines.append(f"    emission = {lookup};")
        else:
            lines.append(f"    vec3 v_{sampler} = {lookup};")
            slot = slots[sampler.removeprefix("map_")]
            lines += [f"    p[{i}] = v_{sampler}.{'xyz'[k % 3]};" for k, i in enumerate(slot)]
    body = (
        group.material.glsl
        if group.material is not None and group.material.glsl
        else f"{shader.GLSL.prelude}\n{shader.function(group.brdf, shader.GLSL, 'model')}"
    )
    return "\n".join([*head, *lines, "}", body])


def put_numbers(program: moderngl.Program, group: Group, table: MaterialTable) -> None:
    """The uniforms of a group of one row."""
    if "numbers" in program:
        uniform = program["numbers"]
        assert isinstance(uniform, moderngl.Uniform)
        uniform.write(table.numbers[group.first, : uniform.array_length].tobytes())
