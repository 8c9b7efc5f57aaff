"""The scene as Blender holds it, brought from frame to frame by touching only what is another record now."""

from pathlib import Path
from typing import Any

import bpy
import numpy as np

from interchange.camera import Camera
from interchange.material import Material, Texture
from interchange.scene import Body, Scene
from interchange.table import Table
from offline import opacity
from offline.blender_camera import BlenderCamera
from offline.blender_matrix import matrix
from offline.blender_mesh import build
from offline.blender_shader import ScriptMaterial
from offline.raw_files import write_tiff
from offline.shading import lamps_of, sockets, surface


class Stage:
    def __init__(self, folder: Path) -> None:
        self.folder = folder
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.scene = bpy.context.scene
        self.camera = BlenderCamera(folder)
        self.meshes: dict[Any, tuple[Any, bpy.types.Mesh]] = {}
        self.files: dict[int, tuple[Texture | Table, str]] = {}
        self.materials: list[ScriptMaterial] = []
        self.objects: list[bpy.types.Object] = []
        self.bodies: list[tuple[Any, int, np.ndarray]] = []
        self.texts: list[tuple[Material, str]] = []
        self.text_key: Any = None
        self.written = 0

    def file_of(self, texture: Texture | Table) -> str:
        if id(texture) not in self.files:
            path = self.folder / f"texture{self.written}.tif"
            self.written += 1
            write_tiff(path, texture.pixels)
            self.files[id(texture)] = (texture, path.as_posix())
        return self.files[id(texture)][1]

    def update(self, scene: Scene, camera: Camera, defocus: bool) -> None:
        self._materials(scene)
        self._bodies(scene)
        self.camera.update(camera, defocus)

    def control(self, **values: int | float) -> None:
        """Set the sockets that all materials share: last, grid, salt."""
        for slot, (material, text) in enumerate(self.texts):
            self.materials[slot].update(text, {**sockets(material), **values})

    def task(self, mode: int, only: int) -> None:
        """What the shaders compute next (osl/surface.osl): told by the objects' colour, which costs no compiling."""
        for k, thing in enumerate(self.objects):
            thing.color = (k + 1, mode + 1, only + 8, 1)

    def _materials(self, scene: Scene) -> None:
        distinct: list[Material] = []
        self.slots: list[int] = []
        for body in scene.bodies:
            slot = next((k for k, m in enumerate(distinct) if m is body.material or m == body.material), None)
            if slot is None:
                slot = len(distinct)
                distinct.append(body.material)
            self.slots.append(slot)
        see_through = any(opacity.is_see_through(m) for m in distinct)
        self.used: set[int] = set()

        def file_of(texture: Texture | Table) -> str:
            self.used.add(id(texture))
            return self.file_of(texture)

        lit_by = lamps_of(scene.lights, file_of)
        self.texts = [(m, surface(m, lit_by, see_through, file_of)) for m in distinct]
        while len(self.materials) < len(distinct):
            self.materials.append(ScriptMaterial(self.folder))
        while len(self.materials) > max(len(distinct), 1):
            self.materials.pop().remove()
        for key in [k for k in self.files if k not in self.used]:
            Path(self.files.pop(key)[1]).unlink(missing_ok=True)

    def _mesh(self, body: Body) -> tuple[Any, "bpy.types.Mesh"]:
        key: Any = (id(body.mesh), opacity.key(body.material))
        if key not in self.meshes:
            mesh, shares = opacity.faces(body.mesh, body.material)
            self.meshes[key] = ((body.mesh, body.material), build(mesh, shares))
        return key, self.meshes[key][1]

    def _bodies(self, scene: Scene) -> None:
        while len(self.objects) > len(scene.bodies):
            bpy.data.objects.remove(self.objects.pop())
            self.bodies.pop()
        used = set()
        for k, (body, slot) in enumerate(zip(scene.bodies, self.slots, strict=True)):
            key, data = self._mesh(body)
            used.add(key)
            if k == len(self.objects):
                thing = bpy.data.objects.new(f"body{k}", data)
                self.scene.collection.objects.link(thing)
                thing.material_slots[0].link = "OBJECT"
                self.objects.append(thing)
                self.bodies.append((key, -1, np.zeros((4, 4))))
            thing = self.objects[k]
            old_key, old_slot, old_pose = self.bodies[k]
            if key != old_key:
                thing.data = data
                thing.material_slots[0].link = "OBJECT"
                old_slot = -1
            if slot != old_slot:
                thing.material_slots[0].material = self.materials[slot].data
            if not np.array_equal(body.world_from_body, old_pose):
                thing.matrix_world = matrix(body.world_from_body)
            self.bodies[k] = (key, slot, body.world_from_body)
        for key in [k for k in self.meshes if k not in used]:
            bpy.data.meshes.remove(self.meshes.pop(key)[1])
