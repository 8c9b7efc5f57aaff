"""Brightfield's own rasteriser: a scene and a camera to linear radiance, by OpenGL.

Each pass draws the bodies once, through one spot of every pixel (and of the lens), and lights what is seen from one
point of every lamp, with a shadow map from that point; the mean over the passes is the image. Haeberli, Akeley: The
accumulation buffer: hardware support for high-quality rendering. SIGGRAPH 1990.

Light that met another surface first is not drawn.
"""

from collections import Counter
from collections.abc import Generator, Sequence
from types import TracebackType

import moderngl

from interchange.camera import Camera
from interchange.image import PASSES, Image, Quantity, check_passes
from interchange.lamps.exposed import banded, exposed, shutter_of
from interchange.problems import BrightfieldError
from interchange.scene import Scene
from realtime.context import headless_context, reversed_depth
from realtime.frame import Frame
from realtime.stages import Stages
from realtime.view import has_depth_of_field

GIVES = tuple(p for p in PASSES if p != "indirect")  # the passes that this renderer can give


class Rasterizer:
    """Keeps what it uploaded from one image to the next; records that are the same objects are not uploaded again.

    ``context``: a window's moderngl context, or None for one without a window (EGL). ``shadow_resolution``: texels
    along a side of a shadow map; 0 fits it to the image. BrightfieldError where OpenGL cannot be started.
    """

    def __init__(self, context: moderngl.Context | None = None, shadow_resolution: int = 0) -> None:
        self._own = context is None
        self.context = context if context is not None else headless_context()
        self.shadow_resolution = shadow_resolution
        self._begun = 0  # images
        with reversed_depth(self.context):
            self.gl = str(self.context.info["GL_RENDERER"])
            self._stages = Stages.create(self.context)

    @property
    def uploads(self) -> Counter[str]:
        """How often each kind of record was uploaded or drawn so far: mesh, texture, profile, materials, transforms,
        shadow map."""
        return self._stages.uploads.counts

    def render(
        self,
        scene: Scene,
        camera: Camera,
        passes: Sequence[str] = (),
        per_light: bool = False,
        samples: int = 16,
        shading: str = "sample",
        next_scene: Scene | None = None,
        shadow_offset: float = 0.0,
    ) -> Image:
        """Linear radiance (H, W, 3) float32 and the passes asked for, as interchange.image defines them.

        ``samples``: spots of a pixel, of each lamp and of the lens that the mean is taken over; 1 is the pixel's
        centre, lit from the lamps' middles: fast, with hard shadows and edges. ``per_light`` is the pass ``light``.
        ``shading``: ``"sample"`` lights each sample, the exact mean; ``"pixel"`` lights pixels once whose four
        samples of a pass lie on one smooth surface (realtime.merge), as multisampling does: for live views with
        ``samples`` 4, 8, ...; scenes with textures and with lamps that are seen themselves are lit sample by sample
        all the same.
        ``shadow_offset``: m above each surface, along its normal, where it is asked what hides the lamps: as where a
        part stands off what it lies on, or where another engine lets its rays begin.
        ``next_scene``: where the bodies and the camera go, for the pass ``motion``. BrightfieldError for a pass that
        a rasteriser cannot give, for a material whose shader does not compile, and for a lens that it cannot draw.
        """
        pieces = self.pieces(scene, camera, passes, per_light, samples, shading, next_scene, shadow_offset)
        while True:
            try:
                next(pieces)
            except StopIteration as end:
                return end.value

    def pieces(
        self,
        scene: Scene,
        camera: Camera,
        passes: Sequence[str] = (),
        per_light: bool = False,
        samples: int = 16,
        shading: str = "sample",
        next_scene: Scene | None = None,
        shadow_offset: float = 0.0,
    ) -> Generator[None, None, Image]:
        """``render`` in pieces, for a window that answers in between: the generator's value is the image, to the bit.

        Other renderers may draw between two pieces; this one may begin another image, which ends this one with a
        BrightfieldError.
        """
        asked = wanted_passes(passes, per_light, next_scene)
        made_for = shutter_of(scene, camera)
        scene, rows = exposed(scene, camera)
        wanted = tuple(dict.fromkeys([*asked, "light"])) if rows else asked
        if samples < 1:
            raise BrightfieldError(f"A pixel must have at least one sample; got {samples}.")
        if shading not in ("sample", "pixel"):
            raise BrightfieldError(f'A rasteriser\'s shading must be "sample" or "pixel"; got "{shading}".')
        if samples == 1 and has_depth_of_field(camera):
            raise BrightfieldError(
                f"A thin lens (f_stop {camera.lens.f_stop:g}) needs more than 1 sample a pixel; take more, or "
                f"f_stop 0 for an image that is sharp everywhere. ({str(camera.where) or camera.name})"
            )
        self._begun += 1
        begun = self._begun
        with reversed_depth(self.context):
            stages = self._stages
            stages.uploads.begin()
            stages.bodies.update(scene.bodies)
            for light in scene.lights:
                if light.beam is not None:
                    stages.uploads.beam(light.beam)
                if light.texture is not None and light.visible:
                    stages.uploads.picture(light.texture)
            stages.shadows.expire()
            stages.shadows.offset = shadow_offset
            stages.uploads.end()
            frame = Frame(stages, scene, camera, samples, self.shadow_resolution, shading == "pixel")
        radiance = frame.radiance("light" in wanted)
        while True:
            with reversed_depth(self.context):
                try:
                    next(radiance)
                except StopIteration as end:
                    pixels, alone = end.value
                    break
            yield
            if begun != self._begun:
                raise BrightfieldError("A rasteriser makes one image at a time; it has begun another one.")
        with reversed_depth(self.context):
            found = {f"light:{name}": image for name, image in alone.items()}
            if "direct" in wanted:
                found["direct"] = pixels
            if set(wanted) - {"direct", "light"}:
                found |= frame.centre_passes(wanted, next_scene)
        made_by = {
            "renderer": "rasterizer",
            "samples": samples,
            "shading": shading,
            "seed": 0,
            "shadow_resolution": frame.side,
            "scene": scene.digest,
            "time": scene.time,
            "gl": self.gl,
            **made_for,
        }
        image = Image(
            pixels, Quantity.RADIANCE, camera, made_by, found, scene.object_names, scene.material_names
        )
        return banded(image, rows, asked)

    def release(self) -> None:
        """Give all memory of the GPU back; the object is of no use afterwards."""
        with reversed_depth(self.context):
            self._stages.release()
        if self._own:
            self.context.release()

    def __enter__(self) -> "Rasterizer":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()


def wanted_passes(passes: Sequence[str], per_light: bool, next_scene: Scene | None) -> tuple[str, ...]:
    """The passes to make; BrightfieldError where one is unknown or cannot be given. ``all`` leaves out ``light``, and
    ``motion`` where no next frame is given."""
    if "indirect" in passes:
        raise BrightfieldError(
            f"The rasteriser draws direct light only and has no pass indirect; it gives {', '.join(GIVES)}."
        )
    if "motion" in passes and next_scene is None:
        raise BrightfieldError("The pass motion needs the next frame's scene, and none was given.")
    wanted = [p for p in check_passes(tuple(passes)) if p in GIVES]
    if next_scene is None and "motion" in wanted:
        wanted.remove("motion")
    return tuple(dict.fromkeys([*wanted, *(["light"] if per_light else [])]))
