"""Every edit of a scene as data: what the window does, a script and Python can do with the same words.

    Place(path="/World/Lamp", position=(0, 0, 0.3))          in Python
    place path=/World/Lamp position=[0,0,0.3]                as text, for `brightfield edit --do` and in the log

Lengths are in metres, angles in degrees as a person types them, or rad where the program's own number is set.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from composer.editor.numbers import with_number
from composer.editor.poses import from_position, pose_of
from interchange.problems import BrightfieldError, did_you_mean

if TYPE_CHECKING:
    from composer.editor.workspace import Workspace

Triple = tuple[float, float, float]
Selection = tuple[str, ...] | None


class Command:
    """``apply`` edits the workspace's stage and returns what is selected afterwards (None: as before). It raises
    BrightfieldError where the edit cannot be; the workspace then takes back what was done of it."""

    title: ClassVar[str]

    def apply(self, on: "Workspace") -> Selection:
        raise NotImplementedError

    @property
    def target(self) -> Any:
        """Commands of one kind that follow each other on one target, while a slider is held, are one step."""
        return None


@dataclass(frozen=True)
class Import(Command):
    """Bring a part or a scene in: STEP, IGES, STL, OBJ, glTF, COLLADA, USD, as `brightfield convert` reads them."""

    title = "Import"
    file: str
    unit: str = ""  # of files that name none
    chord_mm: float = 0.1
    angle_deg: float = 20.0

    def apply(self, on: "Workspace") -> Selection:
        from interchange.formats.base import Options
        from interchange.formats.document import open_scene
        from interchange.formats.usd_edit_prims import insert, valid_name

        options = Options(unit=self.unit or None, chord_mm=self.chord_mm, angle_deg=self.angle_deg)
        document = open_scene(self.file, options)
        document.scene()  # what cannot be read is not brought in
        on.notes += [str(p) for p in document.problems]
        return (insert(on.stage, document, valid_name(Path(self.file).stem)),)


@dataclass(frozen=True)
class AddLamp(Command):
    """``kind``: sphere, disk, rect, cylinder, distant, dome. ``intensity``: W/sr (distant W/m², dome W m⁻² sr⁻¹)."""

    title = "Add lamp"
    kind: str = "sphere"
    name: str = "Lamp"
    position: Triple = (0.0, 0.0, 0.3)
    target: Triple = (0.0, 0.0, 0.0)  # it shines there
    intensity: float = 1.0
    size: float = 0.01  # m, of its face; a sphere's radius is half of it

    def apply(self, on: "Workspace") -> Selection:
        from interchange.formats.usd_edit_prims import add_light
        from interchange.frames import camera_from_gl
        from interchange.light import Light, LightKind

        if self.kind not in list(LightKind):
            raise BrightfieldError(
                f'A lamp must be one of {", ".join(LightKind)}; got "{self.kind}".'
                f"{did_you_mean(self.kind, LightKind)}"
            )
        kind = LightKind(self.kind)
        sizes: dict[str, float] = {
            LightKind.SPHERE: {"radius": self.size / 2},
            LightKind.DISK: {"radius": self.size / 2},
            LightKind.RECT: {"width": self.size, "height": self.size},
            LightKind.CYLINDER: {"radius": self.size / 20, "length": self.size},
        }.get(kind, {})
        pose = from_position(self.position, self.target) @ camera_from_gl
        light = Light(self.name, kind, (self.intensity,) * 3, pose, **sizes)  # type: ignore[arg-type]
        return (add_light(on.stage, light),)


@dataclass(frozen=True)
class AddCamera(Command):
    """A perspective camera that looks at ``target``, with an EMVA sensor of some 1.6 MP, exposed for daylight."""

    title = "Add camera"
    name: str = "Camera"
    position: Triple = (0.0, -0.3, 0.3)
    target: Triple = (0.0, 0.0, 0.0)
    focal_length: float = 0.025
    resolution: tuple[int, int] = (1440, 1080)
    pixel_pitch: float = 3.45e-6
    exposure: float = 0.01

    def apply(self, on: "Workspace") -> Selection:
        from interchange.camera import Camera, Lens, Sensor
        from interchange.formats.usd_edit_prims import add_camera

        if len(self.resolution) != 2 or not all(1 <= n <= 65536 for n in self.resolution):
            raise BrightfieldError(f"A resolution must lie in [1, 65536] px; got {self.resolution}.")
        width, height = self.resolution
        sensor = Sensor(
            resolution=(int(width), int(height)),
            pixel_pitch=(self.pixel_pitch, self.pixel_pitch),
            responsivity=1e6,
            full_well=10500.0,
            black_level=64.0,
            read_noise=3.0,
        )
        pose = from_position(self.position, self.target)
        camera = Camera(
            self.name, pose, Lens(self.focal_length), sensor, clip=(0.001, 1000), t_exp=self.exposure
        )
        return (add_camera(on.stage, camera),)


@dataclass(frozen=True)
class AddSolid(Command):
    """``kind``: box, sphere, cylinder or plane, of ``size`` m along x, y, z, centred at ``position``."""

    title = "Add solid"
    kind: str = "box"
    name: str = "Solid"
    size: Triple = (0.1, 0.1, 0.1)
    position: Triple = (0.0, 0.0, 0.0)

    def apply(self, on: "Workspace") -> Selection:
        from composer.editor.solids import solid
        from interchange.formats.usd_edit_prims import add_mesh

        return (add_mesh(on.stage, self.name, solid(self.kind, self.size), self.position),)


@dataclass(frozen=True)
class AddMaterial(Command):
    """``model``: a BRDF of the catalogue; ``values``: its parameters, the others as its ``example`` has them."""

    title = "Add material"
    model: str = "Lambert"
    name: str = "Material"
    values: Mapping[str, Any] = field(default_factory=dict)

    def apply(self, on: "Workspace") -> Selection:
        from interchange.formats.usd_edit_prims import add_material
        from interchange.material import Material

        return (add_material(on.stage, Material(self.name, brdf_of(self.model, self.values))),)


@dataclass(frozen=True)
class SetBrdf(Command):
    """Another model for a material."""

    title = "Change BRDF"
    material: str
    model: str
    values: Mapping[str, Any] = field(default_factory=dict)

    def apply(self, on: "Workspace") -> Selection:
        from interchange.formats.usd_edit_values import set_brdf

        set_brdf(on.stage, self.material, brdf_of(self.model, self.values))
        return None


@dataclass(frozen=True)
class AssignMaterial(Command):
    title = "Assign material"
    paths: tuple[str, ...]
    material: str

    def apply(self, on: "Workspace") -> Selection:
        from interchange.formats.usd_edit_prims import bind_material

        for path in _some(self.paths):
            bind_material(on.stage, path, self.material)
        return None


@dataclass(frozen=True)
class SetParameter(Command):
    """One number of a lamp (``intensity``), a camera (``lens.f_stop``, ``sensor.gain_dB``) or a material (``n``)."""

    title = "Set"
    path: str
    name: str
    value: Any

    def apply(self, on: "Workspace") -> Selection:
        from interchange.formats.usd_edit_values import set_camera, set_light, set_material

        light = next((x for x in on.scene.lights if x.name == self.path), None)
        camera = next((x for x in on.scene.cameras if x.name == self.path), None)
        if light is not None:
            set_light(on.stage, light, self.name, self.value, on.time)
        elif camera is not None:
            set_camera(on.stage, camera, with_number(camera, self.name, self.value), on.time)
        elif on.kind(self.path) == "material":
            set_material(on.stage, self.path, self.name, self.value, on.time)
        else:
            raise BrightfieldError(f'"{self.path}" must be a lamp, a camera or a material that is shown.')
        return None

    @property
    def target(self) -> Any:
        return self.path, self.name


@dataclass(frozen=True)
class Place(Command):
    """Where a prim stands in the world: ``position`` m, ``rotation`` about x, then y, then z, degrees, ``scale``.

    None leaves one as it is.
    """

    title = "Place"
    path: str
    position: Triple | None = None
    rotation: Triple | None = None
    scale: Triple | None = None

    def apply(self, on: "Workspace") -> Selection:
        from interchange.formats.usd_edit_prims import place, world_pose

        now = world_pose(on.stage, self.path, on.time)
        place(on.stage, self.path, pose_of(now, self.position, self.rotation, self.scale), on.time)
        return None

    @property
    def target(self) -> Any:
        return self.path


@dataclass(frozen=True)
class Transform(Command):
    """Move prims by one motion of the world, ``by`` (4, 4) row by row, m."""

    title = "Move"
    paths: tuple[str, ...]
    by: tuple[tuple[float, ...], ...]

    def apply(self, on: "Workspace") -> Selection:
        from interchange.formats.usd_edit_prims import transform

        by = np.asarray(self.by, np.float64)
        if by.shape != (4, 4):
            raise BrightfieldError(f"A motion must be four rows of four numbers; got {by.shape}.")
        for path in topmost(_some(self.paths)):
            transform(on.stage, path, by, on.time)
        return None


@dataclass(frozen=True)
class Show(Command):
    title = "Show or hide"
    path: str
    visible: bool = True

    def apply(self, on: "Workspace") -> Selection:
        from interchange.formats.usd_edit_prims import set_visible

        set_visible(on.stage, self.path, self.visible)
        return None


@dataclass(frozen=True)
class Delete(Command):
    title = "Delete"
    paths: tuple[str, ...]

    def apply(self, on: "Workspace") -> Selection:
        from interchange.formats.usd_edit_prims import delete

        for path in topmost(_some(self.paths)):
            delete(on.stage, path)
        return ()


@dataclass(frozen=True)
class Duplicate(Command):
    """Copies, ``offset`` m away, that are then selected."""

    title = "Duplicate"
    paths: tuple[str, ...]
    offset: Triple = (0.0, 0.0, 0.0)

    def apply(self, on: "Workspace") -> Selection:
        from interchange.formats.usd_edit_prims import duplicate, transform

        copies = tuple(duplicate(on.stage, path) for path in topmost(_some(self.paths)))
        if any(self.offset):
            by = np.eye(4)
            by[:3, 3] = self.offset
            for copy in copies:
                transform(on.stage, copy, by, on.time)
        return copies


@dataclass(frozen=True)
class Rename(Command):
    title = "Rename"
    path: str
    name: str

    def apply(self, on: "Workspace") -> Selection:
        from interchange.formats.usd_edit_prims import rename

        new = rename(on.stage, self.path, self.name)
        return tuple(new + p[len(self.path) :] if _is_below(p, self.path) else p for p in on.selection)


def brdf_of(model: str, values: Mapping[str, Any]) -> Any:
    """A BRDF by its name in a scene file; BrightfieldError where there is none, or a value cannot be."""
    from interchange.brdf import BY_NAME

    if model not in BY_NAME:
        raise BrightfieldError(f'No BRDF is called "{model}".{did_you_mean(model, BY_NAME)}')
    kind = BY_NAME[model]
    try:
        given = {k: tuples(v) for k, v in values.items()}
        return replace(kind(**dict(kind.example)), **given)  # type: ignore[type-var]
    except TypeError:
        known = [f.name for f in fields(kind)]  # type: ignore[arg-type]
        wrong = next(k for k in values if k not in known)
        raise BrightfieldError(f'{model} has no parameter "{wrong}".{did_you_mean(wrong, known)}') from None


def tuples(value: Any) -> Any:
    return tuple(map(tuples, value)) if isinstance(value, list) else value


def topmost(paths: Sequence[str]) -> list[str]:
    """Without what lies below another of them."""
    return [p for p in dict.fromkeys(paths) if not any(_is_below(p, q) and p != q for q in paths)]


def _is_below(path: str, above: str) -> bool:
    return path == above or path.startswith(above + "/")


def _some(paths: Sequence[str]) -> Sequence[str]:
    if not paths:
        raise BrightfieldError("Nothing is selected.")
    return paths
