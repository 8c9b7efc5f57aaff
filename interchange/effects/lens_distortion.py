"""The lens images straight lines bent: Brown's model, on normalised coordinates, r² = x² + y².

x' = x (1 + k1 r² + k2 r⁴ + k3 r⁶) + 2 p1 x y + p2 (r² + 2 x²)
y' = y (1 + k1 r² + k2 r⁴ + k3 r⁶) + p1 (r² + 2 y²) + 2 p2 x y
"""

from dataclasses import dataclass, fields, replace

from interchange.camera import Camera
from interchange.distortion import LensModel
from interchange.effects.base import Effect, Stage
from interchange.effects.parts import with_cameras
from interchange.parameter import parameter
from interchange.problems import BrightfieldError
from interchange.scene import Scene


@dataclass(frozen=True)
class LensDistortion(Effect):
    """``on`` gives a camera this distortion, ``on_scene`` adds it to what the cameras have. A fisheye has none."""

    stage = Stage.OPTICS
    order = 1
    source = "Brown: Decentering distortion of lenses. Photogrammetric Engineering 32(3), 1966."
    identified_by = (
        "Edges shift along the radius, the more the farther from the axis, alike in every capture."
    )
    confused_with = ("camera_pose", "principal_point", "lateral_chromatic_aberration")
    separated_by = "a chessboard that fills the image"

    k1: float = parameter(0.0, "k_1", "1", -1e3, 1e3, "radial, r²")
    k2: float = parameter(0.0, "k_2", "1", -1e5, 1e5, "radial, r⁴")
    p1: float = parameter(0.0, "p_1", "1", -10, 10, "tangential, along rows")
    p2: float = parameter(0.0, "p_2", "1", -10, 10, "tangential, along columns")
    k3: float = parameter(0.0, "k_3", "1", -1e7, 1e7, "radial, r⁶")

    @classmethod
    def of(cls, camera: Camera) -> "LensDistortion":
        return cls(*camera.lens.distortion[:5]) if camera.lens.model is LensModel.OPENCV else cls()

    def on(self, camera: Camera) -> Camera:
        if camera.lens.model is not LensModel.OPENCV:
            if not self.is_there:
                return camera
            raise BrightfieldError(
                f"Brown's distortion needs a lens of that model; {camera.name} has a fisheye."
            )
        own = tuple(float(getattr(self, f.name)) for f in fields(self))
        return replace(camera, lens=replace(camera.lens, distortion=(*own, *camera.lens.distortion[5:])))

    def on_scene(self, scene: Scene, target: str = "") -> Scene:
        if not self.is_there:
            return scene

        def change(camera: Camera) -> Camera:
            own = LensDistortion.of(camera)
            summed = {f.name: getattr(own, f.name) + getattr(self, f.name) for f in fields(self)}
            return LensDistortion(**summed).on(camera)

        return with_cameras(scene, target, change)
