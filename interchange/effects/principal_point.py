"""The lens's axis meets the sensor elsewhere than the scene says: the image shifts as a whole."""

from dataclasses import dataclass, replace

from interchange.camera import Camera
from interchange.effects.base import Effect, Stage
from interchange.effects.parts import with_cameras
from interchange.parameter import parameter
from interchange.scene import Scene


@dataclass(frozen=True)
class PrincipalPoint(Effect):
    """``of`` and ``on`` count from the image's centre; ``on_scene`` from where the cameras have it."""

    stage = Stage.OPTICS
    order = 2
    source = "Hartley, Zisserman: Multiple View Geometry, 2nd ed., 2004, section 6.1."
    identified_by = (
        "The image shifts as a whole, alike at every depth and in every pose; so does the lens's fall-off."
    )
    confused_with = ("camera_pose", "lens_distortion")
    separated_by = "the same scene with the camera turned by 180 degrees about its axis"

    cx: float = parameter(0.0, "c_x", "px", -1e5, 1e5, "columns that the image shifts to the right")
    cy: float = parameter(0.0, "c_y", "px", -1e5, 1e5, "rows that the image shifts down")

    @classmethod
    def of(cls, camera: Camera) -> "PrincipalPoint":
        if camera.principal_point is None:
            return cls()
        w, h = camera.sensor.resolution
        return cls(camera.principal_point[0] - (w - 1) / 2, camera.principal_point[1] - (h - 1) / 2)

    def on(self, camera: Camera) -> Camera:
        w, h = camera.sensor.resolution
        return replace(camera, principal_point=((w - 1) / 2 + self.cx, (h - 1) / 2 + self.cy))

    def on_scene(self, scene: Scene, target: str = "") -> Scene:
        if not self.is_there:
            return scene

        def change(camera: Camera) -> Camera:
            own = PrincipalPoint.of(camera)
            return PrincipalPoint(own.cx + self.cx, own.cy + self.cy).on(camera)

        return with_cameras(scene, target, change)
