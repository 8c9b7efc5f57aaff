"""pyrender as a second rasteriser of the same scene: an independent check of geometry, depth and ids.

Its pixels are a preview in its own metallic-roughness model, not radiance; nothing is measured on them.
Matl et al.: pyrender 0.1.45, https://github.com/mmatl/pyrender.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from types import TracebackType
from typing import Any

import numpy as np

from interchange.camera import Camera, Projection
from interchange.frames import apply, camera_from_gl
from interchange.image import Image, Quantity
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.problems import BrightfieldError
from interchange.scene import Scene

GIVES = ("depth", "object_id")


def offscreen(width: int, height: int) -> Any:
    """pyrender's OffscreenRenderer, which leaves other contexts alive when it goes: its own way out ends the EGL
    display for the whole process."""
    import pyrender

    renderer = pyrender.OffscreenRenderer(width, height)
    renderer._platform.delete_context = partial(_destroy_context, renderer._platform)
    return renderer


def _destroy_context(platform: Any) -> None:
    from OpenGL import EGL

    if platform._egl_context is not None:
        EGL.eglMakeCurrent(platform._egl_display, EGL.EGL_NO_SURFACE, EGL.EGL_NO_SURFACE, EGL.EGL_NO_CONTEXT)
        EGL.eglDestroyContext(platform._egl_display, platform._egl_context)
        platform._egl_context = None


@contextmanager
def _one_sample_a_pixel(library: Any, renderer: Any) -> Iterator[None]:
    """Draw at pixels' centres. pyrender keeps four samples and turns multisampling off for that, which leaves open
    whether each has the centre's depth (OpenGL 4.1, 3.3.1): in software they have, on GPUs not."""
    module, inner = library.renderer, renderer._renderer
    allocate = module.glRenderbufferStorageMultisample

    def allocate_one(target: Any, samples: int, *rest: Any) -> None:
        allocate(target, 0, *rest)

    inner._delete_main_framebuffer()
    module.glRenderbufferStorageMultisample = allocate_one
    try:
        yield
    finally:
        module.glRenderbufferStorageMultisample = allocate
        inner._delete_main_framebuffer()


class Pyrender:
    """Draws through EGL without a window. BrightfieldError where that cannot be started."""

    def __init__(self) -> None:
        os.environ.setdefault("PYOPENGL_PLATFORM", "egl")  # read when PyOpenGL is first imported
        try:
            import pyrender

            self._library: Any = pyrender
            self._renderer: Any = offscreen(16, 16)
        except Exception as error:  # PyOpenGL raises errors of its own, and bare ones
            raise BrightfieldError(
                f"pyrender needs OpenGL through EGL, and none could be started ({error}). "
                "On Debian or Ubuntu: apt install libegl1 libgl1 libgl1-mesa-dri."
            ) from error

    def render(self, scene: Scene, camera: Camera) -> Image:
        """A preview (H, W, 3) in [0, 1], and the passes depth and object_id of the pixels' centres.

        BrightfieldError for a lens with distortion and a telecentric one off its axis, which pyrender cannot draw.
        """
        library = self._library
        width, height = camera.sensor.resolution
        near, far = _depths(scene, camera)
        drawn = library.Scene(bg_color=np.zeros(4), ambient_light=np.full(3, 0.02))
        nodes: list[Any] = []
        materials: dict[int, Any] = {}
        for body in scene.bodies:
            material = materials.setdefault(id(body.material), _preview(library, body.material))
            primitive = library.Primitive(
                positions=body.mesh.vertices,
                normals=body.mesh.normals,
                indices=body.mesh.faces,
                material=material,
                mode=4,  # triangles
            )
            empty = not len(body.mesh.faces)
            nodes.append(None if empty else drawn.add(library.Mesh([primitive]), pose=body.world_from_body))
        drawn.add(_camera(library, camera, near, far), pose=camera.world_from_camera @ camera_from_gl)
        for light in scene.lights:
            if light.is_on and light.kind is not LightKind.DOME:
                drawn.add(_light(library, light), pose=light.world_from_light)
        self._renderer.viewport_width, self._renderer.viewport_height = width, height
        flags = library.RenderFlags.SKIP_CULL_FACES
        color, _ = self._renderer.render(drawn, flags=flags)
        names = {name: i for i, name in enumerate(scene.object_names)}
        ids = [names[b.name] + 1 for b in scene.bodies]
        marks = {
            n: (i & 255, i >> 8 & 255, i >> 16) for n, i in zip(nodes, ids, strict=True) if n is not None
        }
        with _one_sample_a_pixel(library, self._renderer):
            marked, z = self._renderer.render(
                drawn, flags=flags | library.RenderFlags.SEG, seg_node_map=marks
            )
        depth = np.where(z > 0, z, np.inf)
        if (
            camera.lens.projection is Projection.ORTHOGRAPHIC
        ):  # pyrender takes the buffer for a perspective one
            ndc = (far + near - 2 * near * far / np.where(z > 0, z, 1)) / (far - near)
            depth = np.where(z > 0, near + (ndc + 1) / 2 * (far - near), np.inf)
        return Image(
            (color / 255.0).astype(np.float32),
            Quantity.DN,
            camera,
            {"renderer": "pyrender", "scene": scene.digest, "time": scene.time},
            {"depth": depth.astype(np.float32), "object_id": marked.astype(np.int32) @ [1, 256, 65536] - 1},
            scene.object_names,
            scene.material_names,
        )

    def release(self) -> None:
        self._renderer.delete()

    def __enter__(self) -> "Pyrender":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()


def _camera(library: Any, camera: Camera, near: float, far: float) -> Any:
    (width, height), K = camera.sensor.resolution, camera.K
    if camera.lens.distorts:
        raise BrightfieldError(f"pyrender draws no lens distortion. ({str(camera.where) or camera.name})")
    if camera.lens.projection is Projection.PERSPECTIVE:
        edge = K[:2, 2] + 0.5  # pyrender counts from the image's corner
        return library.IntrinsicsCamera(K[0, 0], K[1, 1], edge[0], edge[1], znear=near, zfar=far)
    if not np.allclose(K[:2, 2], [(width - 1) / 2, (height - 1) / 2]):
        raise BrightfieldError(
            f"pyrender draws telecentric cameras on their axis only. ({str(camera.where) or camera.name})"
        )
    if K[0, 0] != K[1, 1]:
        raise BrightfieldError(
            f"pyrender draws telecentric cameras with square pixels only. ({str(camera.where) or camera.name})"
        )
    return library.OrthographicCamera(width / K[0, 0] / 2, height / K[1, 1] / 2, znear=near, zfar=far)


def _depths(scene: Scene, camera: Camera) -> tuple[float, float]:
    """Clip planes close around the scene: pyrender's depth has 24 bits."""
    low, high = scene.bounds
    corners = np.stack(np.meshgrid(*np.stack([low, high]).T, indexing="ij"), axis=-1).reshape(-1, 3)
    z = apply(camera.camera_from_world, corners)[:, 2]
    near = max(camera.clip[0], z.min() * 0.99)
    return near, max(min(camera.clip[1], z.max() * 1.01), near * 1.001)


def _preview(library: Any, material: Material) -> Any:
    colors = [getattr(material.brdf, name, None) for name in ("diffuse", "diffuseColor")]
    color = next((c for c in colors if c is not None), (0.5, 0.5, 0.5))
    return library.MetallicRoughnessMaterial(
        baseColorFactor=(*color, 1.0), metallicFactor=0.0, roughnessFactor=0.6
    )


def _light(library: Any, light: Light) -> Any:
    brightness = max(light.intensity)
    color = np.asarray(light.intensity) / brightness
    if light.kind is LightKind.DISTANT:
        return library.DirectionalLight(color=color, intensity=brightness)
    if light.cone_angle < np.pi / 2:
        inner = light.cone_angle * (1 - light.cone_softness)
        return library.SpotLight(
            color=color, intensity=brightness, innerConeAngle=inner, outerConeAngle=light.cone_angle
        )
    return library.PointLight(color=color, intensity=brightness)
