"""The bodies of a scene on the GPU, drawn in as few calls as there are pairs of mesh and material.

World coordinates on the GPU are relative to ``origin``, so that a scene far from the world's origin keeps its
precision in 32 bits.
"""

from dataclasses import dataclass, field

import moderngl
import numpy as np

from interchange.material import Material, Texture
from interchange.scene import Body
from interchange.table import Table
from realtime import polytope
from realtime.lamps import Sample
from realtime.materials import MaterialTable
from realtime.split import Split
from realtime.uploads import VERTEX_FORMAT, VERTEX_NAMES, Geometry, Uploads

INSTANCE_FORMAT = "4f 4f 4f 3f 3f 3f 1f /i"
INSTANCE_NAMES = ("world_x", "world_y", "world_z", "normal_x", "normal_y", "normal_z", "number")
MOST_FLAT = 16  # bodies of which it pays to find out whether they can cast shadows
LOOKUP_WIDTH = 4096  # bodies a row of the lookup


@dataclass(eq=False)
class Group:
    """Bodies that share mesh and material (and whether their transform mirrors)."""

    geometry: Geometry
    material: Material
    mirrored: bool
    members: list[int]
    instances: moderngl.Buffer
    content: bytes = b""
    arrays: dict[tuple[int, int], moderngl.VertexArray] = field(default_factory=dict)  # by program, indices

    @property
    def lets_light_through(self) -> bool:
        m = self.material
        return m.opacity < 1 or m.opacity_map is not None

    def render(
        self,
        context: moderngl.Context,
        program: moderngl.Program,
        split: Split | None = None,
        patches: bool = False,
    ) -> None:
        """``split``: only its faces that stay whole, or those to be split, as ``patches``."""
        geometry = self.geometry
        vertices, indices = geometry.vertices, geometry.indices
        if split is not None:
            chosen = split.patches if patches else split.whole
            if chosen is None:
                return
            vertices, indices = (split.vertices or vertices) if patches else vertices, chosen
        key = (program.glo, indices.glo)
        if key not in self.arrays:
            content = [
                (vertices, VERTEX_FORMAT, *VERTEX_NAMES),
                (self.instances, INSTANCE_FORMAT, *INSTANCE_NAMES),
            ]
            self.arrays[key] = context.vertex_array(program, content, index_buffer=indices, skip_errors=True)
        if patches:
            context.patch_vertices = 3
        mode = moderngl.PATCHES if patches else moderngl.TRIANGLES
        self.arrays[key].render(mode, instances=len(self.members))

    def release(self) -> None:
        for array in self.arrays.values():
            array.release()
        self.instances.release()


class Bodies:
    def __init__(self, context: moderngl.Context, uploads: Uploads, table: MaterialTable) -> None:
        self.context, self.uploads, self.table = context, uploads, table
        self.bodies: tuple[Body, ...] = ()
        self.groups: list[Group] = []
        self.origin = np.zeros(3)
        self.bounds = np.zeros((2, 3))  # world, of all bodies
        self.centres = np.zeros((0, 3))  # world, of each body's bounding sphere
        self.radii = np.zeros(0)
        self.corners = np.zeros((0, 8, 3))  # world, of each body's own box
        self.boxes = np.zeros((0, 2, 3))  # world, along its axes; NaN without a surface
        self.scales = np.zeros(
            (0, 2)
        )  # by how much each body's transform stretches lengths at least and at most
        # bodies that lie in a plane: a point of it, its normal, and between which heights over it all bodies lie
        self.planes: list[tuple[int, np.ndarray, np.ndarray, float, float]] = []
        self.shape = 0  # counts changes of what casts shadows
        self.lookup: moderngl.Texture | None = None  # by body: row and group of its material

    def update(self, bodies: tuple[Body, ...]) -> None:
        """Bring the GPU to these bodies; what is the same object as before is not uploaded again."""
        geometries = [self.uploads.geometry(b.mesh) for b in bodies]
        for body in bodies:
            for texture in _textures(body.material):
                self.uploads.picture(texture)
        moved = self.table.update(tuple({id(b.material): b.material for b in bodies}.values()))
        same = len(bodies) == len(self.bodies) and all(
            a is b for a, b in zip(bodies, self.bodies, strict=True)
        )
        if same and not moved:
            return
        if not _cast_alike(bodies, self.bodies):
            self.shape += 1
        self.bodies = bodies
        self._measure(bodies)
        self._regroup(bodies, geometries)

    def _measure(self, bodies: tuple[Body, ...]) -> None:
        boxes = np.zeros((len(bodies), 2, 3))
        self.corners = np.full((len(bodies), 8, 3), np.nan)
        for i, body in enumerate(bodies):
            if not len(body.mesh.vertices):
                boxes[i] = np.nan
                continue
            low, high = self.uploads.bounds(body.mesh)
            M = body.world_from_body
            middle = M[:3, :3] @ ((low + high) / 2) + M[:3, 3]
            half = np.abs(M[:3, :3]) @ ((high - low) / 2)
            boxes[i] = middle - half, middle + half
            self.corners[i] = np.concatenate(polytope.box(np.stack([low, high]))[:2]) @ M[:3, :3].T + M[:3, 3]
        self.centres, self.radii = boxes.mean(axis=1), np.linalg.norm(boxes[:, 1] - boxes[:, 0], axis=1) / 2
        self.boxes = boxes
        linear = np.array([b.world_from_body[:3, :3] for b in bodies]).reshape(-1, 3, 3)
        self.scales = np.linalg.svd(linear, compute_uv=False)[:, [2, 0]]
        full = boxes[np.isfinite(boxes).all(axis=(1, 2))]
        thin = [
            i
            for i, b in enumerate(bodies)
            if len(b.mesh.vertices) and np.ptp(self.uploads.bounds(b.mesh), axis=0).min() == 0
        ]
        self.bounds = np.stack([full[:, 0].min(0), full[:, 1].max(0)]) if len(full) else np.zeros((2, 3))
        # a coarse grid, so that the origin, and with it every rounding, stays when a body moves
        extent = np.linalg.norm(self.bounds[1] - self.bounds[0])
        pitch = 2.0 ** (np.ceil(np.log2(extent)) + 3) if extent > 0 else 1.0
        self.origin = np.round(self.bounds.mean(axis=0) / pitch) * pitch
        corners = self.corners[np.isfinite(self.corners).all(axis=(1, 2))] - self.origin
        self.planes = []
        for i in thin if len(thin) <= MOST_FLAT else []:
            own = self.corners[i] - self.origin
            normal = np.linalg.svd(own - own.mean(axis=0))[2][2]
            heights = (corners - own[0]) @ normal
            self.planes.append((i, own[0], normal, float(heights.min()), float(heights.max())))

    def _regroup(self, bodies: tuple[Body, ...], geometries: list[Geometry]) -> None:
        members: dict[tuple[int, int, bool], list[int]] = {}
        rows = np.zeros((len(bodies), 22), np.float32)
        for i, body in enumerate(bodies):
            M = body.world_from_body
            linear = M[:3, :3]
            det = np.linalg.det(linear)
            affine = M[:3].copy()
            affine[:, 3] -= self.origin
            # the cofactors: the inverse transpose times the determinant, which exists for a flat transform too
            cofactors = np.stack(
                [
                    polytope.cross(linear[1], linear[2]),
                    polytope.cross(linear[2], linear[0]),
                    polytope.cross(linear[0], linear[1]),
                ]
            )
            scale = np.sign(det or 1.0) / max(float(np.abs(cofactors).max()), 1e-300)
            rows[i, :12], rows[i, 12:21] = affine.ravel(), (cofactors * scale).ravel()
            rows[i, 21] = i
            if len(body.mesh.faces):
                members.setdefault((id(body.mesh), id(body.material), bool(det < 0)), []).append(i)
        before = {(id(g.geometry.mesh), id(g.material), g.mirrored): g for g in self.groups}
        self.groups = []
        self._write_lookup(bodies)
        for key, indices in members.items():
            content = rows[indices].tobytes()
            group = before.pop(key, None)
            if group is not None and len(group.content) != len(content):
                group.release()
                group = None
            if group is None:
                group = Group(
                    geometries[indices[0]],
                    bodies[indices[0]].material,
                    key[2],
                    indices,
                    self.context.buffer(reserve=len(content)),
                )
            if group.content != content:
                group.instances.write(content)
                group.content = content
                self.uploads.counts["transforms"] += 1
            group.members = indices
            self.groups.append(group)
        for group in before.values():
            group.release()

    def _write_lookup(self, bodies: tuple[Body, ...]) -> None:
        height = max(-(-len(bodies) // LOOKUP_WIDTH), 1)
        numbers = np.zeros((height * LOOKUP_WIDTH, 2), np.float32)
        for i, body in enumerate(bodies):
            numbers[i] = self.table.place[id(body.material)]
        if self.lookup is None or self.lookup.height != height:
            if self.lookup is not None:
                self.lookup.release()
            self.lookup = self.context.texture((LOOKUP_WIDTH, height), 2, dtype="f4")
            self.lookup.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self.lookup.write(numbers.tobytes())

    def visible(self, clip_from_world: np.ndarray) -> list[bool]:
        """For each group, whether any of its bodies' spheres reaches into the frustum (relative to ``origin``)."""
        m = clip_from_world
        planes = np.stack([m[3] + m[0], m[3] - m[0], m[3] + m[1], m[3] - m[1], m[3] - m[2], m[2]])
        length = np.linalg.norm(planes[:, :3], axis=1)
        planes = planes[length > 1e-300] / length[length > 1e-300, None]
        distance = (self.centres - self.origin) @ planes[:, :3].T + planes[:, 3]
        inside = (distance >= -self.radii[:, None] * 1.0001).all(axis=1)
        return [bool(inside[g.members].any()) for g in self.groups]

    def nearest(self, eye: np.ndarray) -> np.ndarray:
        """(B,) m: how near each body's surface is to the eye (relative to ``origin``) at least; NaN without one."""
        found = polytope.distance(self.boxes - self.origin, eye)
        for group in self.groups:
            for i in group.members:
                if found[i] < self.radii[i]:
                    M = self.bodies[i].world_from_body
                    if self.scales[i, 0] > 0:
                        own = np.linalg.solve(M[:3, :3], eye + self.origin - M[:3, 3])
                        least = polytope.distance(group.geometry.boxes, own).min()
                        found[i] = max(found[i], self.scales[i, 0] * least)
        return found

    def casting(self, sample: Sample) -> np.ndarray:
        """(B,) whether a body may cast a shadow of this lamp on another, or on itself: all but those that lie in a
        plane which has every other body on the lamp's side, as a floor does."""
        found = np.isfinite(self.corners).all(axis=(1, 2))
        slack = 1e-9 * np.linalg.norm(self.bounds[1] - self.bounds[0])
        for i, point, normal, low, high in self.planes:
            if sample.place is None:
                side = -float(normal @ sample.direction)
            else:
                side = float(normal @ (sample.place - point))
                side = 0.0 if abs(side) <= sample.light.radius + slack else side
            found[i] = side == 0 or (low < -slack if side > 0 else high > slack)
        return found

    def outside(self, group: Group, eye: np.ndarray | None, margin: float) -> bool:
        """Whether the eye (relative to ``origin``; None is infinitely far) is certainly outside every body of the
        group, so that the back faces of closed meshes are hidden."""
        if not group.geometry.closed or group.lets_light_through:
            return False
        if eye is None:
            return True
        distance = np.linalg.norm(self.centres[group.members] - self.origin - eye, axis=1)
        return bool((distance > self.radii[group.members] + margin).all())

    def release(self) -> None:
        for group in self.groups:
            group.release()
        self.groups, self.bodies = [], ()
        if self.lookup is not None:
            self.lookup.release()
            self.lookup = None


def _textures(material: Material) -> list[Texture | Table]:
    maps = [*material.maps.values(), material.normal_map, material.emission_map, material.opacity_map]
    return [*(t for t in maps if t is not None), *material.brdf.tables]


def _cast_alike(a: tuple[Body, ...], b: tuple[Body, ...]) -> bool:
    def casts(x: Body, y: Body) -> bool:
        m, n = x.material, y.material
        return (
            x.mesh is y.mesh
            and (
                x.world_from_body is y.world_from_body or np.array_equal(x.world_from_body, y.world_from_body)
            )
            and (
                m is n
                or (
                    (m.opacity == n.opacity and m.opacity_threshold == n.opacity_threshold)
                    and m.opacity_map is n.opacity_map
                )
            )
        )

    return len(a) == len(b) and all(casts(x, y) for x, y in zip(a, b, strict=True))
