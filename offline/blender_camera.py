"""A camera of ours in Blender: its own pinhole where that is exact, else the OSL camera (osl/camera.osl)."""

from pathlib import Path
from typing import Any

import bpy
import numpy as np

from interchange.camera import Camera, Projection
from interchange.distortion import NAMES, LensModel, tilted
from interchange.frames import camera_from_gl
from offline.blender_matrix import matrix
from offline.blender_shader import compiled
from offline.shading import library
from offline.wide import is_native

SENSOR_WIDTH = 36.0  # mm; only its ratio to the focal length matters


class BlenderCamera:
    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.data = bpy.data.cameras.new("camera")
        self.object = bpy.data.objects.new("camera", self.data)
        bpy.context.scene.collection.objects.link(self.object)
        bpy.context.scene.camera = self.object

    def update(self, camera: Camera, defocus: bool) -> None:
        """``defocus`` False leaves the pinhole, for passes that are true at pixel centres."""
        render = bpy.context.scene.render
        width, height = camera.sensor.resolution
        render.resolution_x, render.resolution_y, render.resolution_percentage = width, height, 100
        self.object.matrix_world = matrix(camera.world_from_camera @ camera_from_gl)
        K, lens = camera.K, camera.lens
        render.pixel_aspect_x = render.pixel_aspect_y = 1.0
        if is_native(camera):
            self._native(camera, K, width, height)
            open_lens = (
                lens.f_stop > 0 and lens.focus_distance > 0 and lens.projection is Projection.PERSPECTIVE
            )
            self.data.dof.use_dof = defocus and open_lens
            if self.data.dof.use_dof:
                self.data.dof.focus_distance = lens.focus_distance
                # the same opening, f / 2N, for the stand-in focal length that Blender is told
                self.data.dof.aperture_fstop = lens.f_stop * self.data.lens * 1e-3 / lens.focal_length
        else:
            self._script(camera, K, width, height)

    def _native(self, camera: Camera, K: np.ndarray, width: int, height: int) -> None:
        data, render = self.data, bpy.context.scene.render
        taller = K[0, 0] / K[1, 1]  # a pixel's height over its width
        render.pixel_aspect_x, render.pixel_aspect_y = max(1 / taller, 1.0), max(taller, 1.0)
        data.sensor_fit = "HORIZONTAL"
        data.clip_start, data.clip_end = camera.clip
        if camera.lens.projection is Projection.PERSPECTIVE:
            data.type = "PERSP"
            data.sensor_width = SENSOR_WIDTH
            data.lens = K[0, 0] * SENSOR_WIDTH / width
        else:
            data.type = "ORTHO"
            data.ortho_scale = width / K[0, 0]
        data.shift_x = ((width - 1) / 2 - K[0, 2]) / width
        data.shift_y = (K[1, 2] - (height - 1) / 2) / width * taller

    def _script(self, camera: Camera, K: np.ndarray, width: int, height: int) -> None:
        """For passes without shadow rays alone: see ``offline.wide``."""
        data, lens = self.data, camera.lens
        if data.type != "CUSTOM":
            data.type = "CUSTOM"
        code, digest = compiled(library("camera.osl").join(['#include "stdcycles.h"\n', ""]), self.folder)
        if data.custom_bytecode_hash != digest:
            data.custom_bytecode, data.custom_bytecode_hash = code, digest
        data.clip_start, data.clip_end = 1e-9, camera.clip[1] * 10
        data.shift_x = data.shift_y = 0.0  # Blender shifts this kind as well
        fisheye = lens.model is LensModel.FISHEYE
        d = lens.distortion + (0.0,) * (14 - len(lens.distortion))
        names = (
            ("fisheye_k1", "fisheye_k2", "fisheye_k3", "fisheye_k4") if fisheye else NAMES[lens.model][:12]
        )
        upright = np.linalg.inv(tilted(*(d[12:] if not fisheye else (0.0, 0.0))))
        none = dict.fromkeys((*NAMES[LensModel.OPENCV][:12], *(f"fisheye_k{i}" for i in range(1, 5))), 0.0)
        values: dict[str, Any] = {
            "width": width, "height": height, "fx": K[0, 0], "fy": K[1, 1], "cx": K[0, 2], "cy": K[1, 2],
            **none, **dict(zip(names, d, strict=False)), "fisheye": fisheye,
            **{f"t{i}{j}": upright[i, j] for i in range(3) for j in range(3)},
            "orthographic": lens.projection is Projection.ORTHOGRAPHIC, "near": camera.clip[0],
        }  # fmt: skip
        for name, value in values.items():
            data.cycles_custom[name] = float(value)
        data.update_tag()
