"""What a prim has that can be set: groups of declared numbers, each set at once.

| prim     | groups                                                                                           |
|----------|--------------------------------------------------------------------------------------------------|
| camera   | ``pose``, ``own``, ``lens``, ``sensor`` (with ``t_exp``), every effect that a camera carries      |
| lamp     | its own (``intensity``, sizes, beam), ``pose``, ``own``, ``strobe``, every effect on lamps        |
| object   | ``pose`` (about the middle of its box), ``own``                                                  |
| material | its own (its BRDF's parameters, ``emission``, ``opacity``), every effect on materials             |

Nothing is listed here that a class declares itself (interchange.parameter).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from analysis.sweep.pose import Pose
from interchange.camera import Camera, Lens, Sensor
from interchange.effects import MODELS
from interchange.effects.base import Effect, Stage
from interchange.effects.parts import bounds, with_bodies, with_cameras, with_lights, with_materials
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.parameter import Kind, Parameter, freeze, parameter, parameters
from interchange.problems import BrightfieldError
from interchange.scene import Scene
from interchange.strobe import Strobe

Changes = Mapping[str, Any]


@dataclass(frozen=True)
class Group:
    """``values``: what the scene has now; ``put``: the scene with other values of some of them."""

    values: Mapping[str, Any]
    declared: Mapping[str, Parameter]
    put: Callable[[Scene, Changes], Scene]


@dataclass(frozen=True)
class Exposure:
    """What a camera is told to do."""

    t_exp: float = parameter(1.0, "t_exp", "s", 1e-7, 1e3, "the shutter is open that long")

    def __post_init__(self) -> None:
        freeze(self)


@dataclass(frozen=True)
class Lamp:
    """A lamp's numbers, those of all kinds (interchange.light)."""

    intensity: float = parameter(1.0, "I", "W/sr", 0, 1e9, "intensity of the brightest channel")
    radius: float = parameter(0.0, "r", "m", 0, 1e3, "of a sphere, disk or cylinder; 0 is a point")
    width: float = parameter(0.0, "w", "m", 0, 1e3, "of a rect, along its x")
    height: float = parameter(0.0, "h", "m", 0, 1e3, "of a rect, along its y")
    length: float = parameter(0.0, "l", "m", 0, 1e3, "of a cylinder, along its x")
    angle: float = parameter(0.0, "α", "rad", 0, np.pi, "full angle that a distant source fills")
    cone_angle: float = parameter(np.pi, "θ", "rad", 0, np.pi, "from the axis to the edge of the beam")
    cone_softness: float = parameter(0.0, "s", "1", 0, 1, "share of the cone over which it fades")
    focus: float = parameter(0.0, "k", "1", 0, 1e3, "cos^k fall-off from the axis")

    def __post_init__(self) -> None:
        freeze(self)


UNITS = {LightKind.DISTANT: "W/m²", LightKind.DOME: "W/(m² sr)"}  # of an intensity, else W/sr
BEAM = ("cone_angle", "cone_softness", "focus")
OF_KIND: dict[LightKind, tuple[str, ...]] = {
    LightKind.SPHERE: ("intensity", "radius", *BEAM),
    LightKind.DISK: ("intensity", "radius", *BEAM),
    LightKind.RECT: ("intensity", "width", "height", *BEAM),
    LightKind.CYLINDER: ("intensity", "radius", "length", *BEAM),
    LightKind.DISTANT: ("intensity", "angle"),
    LightKind.DOME: ("intensity",),
}


@dataclass(frozen=True)
class Matter:
    """What a material has beside its BRDF."""

    emission: tuple[float, float, float] = parameter(
        (0, 0, 0), "L_e", "W/(m² sr)", 0, 1e6, "radiance that the surface itself sends out", Kind.COLOR
    )
    opacity: float = parameter(1.0, "o", "1", 0, 1, "share of rays that meet the surface")

    def __post_init__(self) -> None:
        freeze(self)


def _values(model: Any) -> dict[str, Any]:
    return {name: getattr(model, name) for name in parameters(model)}


def _posed(put: Callable[[Scene, Pose], Scene]) -> Group:
    return Group(_values(Pose()), parameters(Pose), lambda scene, new: put(scene, Pose(**new)))


def of_camera(camera: Camera) -> dict[str, Group]:
    def change(scene: Scene, new: Callable[[Camera], Camera]) -> Scene:
        return with_cameras(scene, camera.name, new)

    def pose(scene: Scene, p: Pose) -> Scene:
        def moved(c: Camera) -> Camera:
            return replace(c, world_from_camera=p.in_world(c.world_from_camera, c.world_from_camera[:3, 3]))

        return change(scene, moved)

    def own(scene: Scene, p: Pose) -> Scene:
        return change(scene, lambda c: replace(c, world_from_camera=p.in_own(c.world_from_camera)))

    def lens(scene: Scene, new: Changes) -> Scene:
        return change(scene, lambda c: replace(c, lens=replace(c.lens, **new)))

    def sensor(scene: Scene, new: Changes) -> Scene:
        rest = {k: v for k, v in new.items() if k != "t_exp"}
        t_exp = Exposure(**{k: new[k] for k in new if k == "t_exp"}).t_exp if "t_exp" in new else None
        return change(
            scene,
            lambda c: replace(c, t_exp=c.t_exp if t_exp is None else t_exp, sensor=replace(c.sensor, **rest)),
        )

    groups = {
        "pose": _posed(pose),
        "own": _posed(own),
        "lens": Group(_values(camera.lens), parameters(Lens), lens),
        "sensor": Group(
            {"t_exp": camera.t_exp, **_values(camera.sensor)},
            {**parameters(Exposure), **parameters(Sensor)},
            sensor,
        ),
    }
    for word, kind in MODELS.items():
        there = {n: p for n, p in parameters(kind).items() if n in kind.carried_by}
        if there:
            groups[word] = Group(_values(kind.of(camera)), there, _carried(camera.name, kind))
    return groups


def _carried(name: str, kind: type[Effect]) -> Callable[[Scene, Changes], Scene]:
    def put(scene: Scene, new: Changes) -> Scene:
        return with_cameras(scene, name, lambda c: replace(kind.of(c), **new).on(c))  # type: ignore[type-var]

    return put


def of_light(light: Light) -> dict[str, Group]:
    own_names = OF_KIND[light.kind]
    declared = {n: p for n, p in parameters(Lamp).items() if n in own_names}
    declared["intensity"] = replace(declared["intensity"], unit=UNITS.get(light.kind, "W/sr"))
    values = {n: getattr(light, n) for n in own_names} | {"intensity": max(light.intensity)}

    def change(scene: Scene, new: Callable[[Light], Light]) -> Scene:
        return with_lights(scene, light.name, new)

    def numbers(scene: Scene, new: Changes) -> Scene:
        Lamp(**new)  # checks the bounds
        rest = {k: v for k, v in new.items() if k != "intensity"}

        def changed(x: Light) -> Light:
            if "intensity" not in new:
                return replace(x, **rest)
            peak = max(x.intensity)
            r, g, b = (c / peak if peak > 0 else 1.0 for c in x.intensity)
            i = new["intensity"]
            return replace(x, intensity=(i * r, i * g, i * b), **rest)

        return change(scene, changed)

    def pose(scene: Scene, p: Pose) -> Scene:
        def moved(x: Light) -> Light:
            return replace(x, world_from_light=p.in_world(x.world_from_light, x.world_from_light[:3, 3]))

        return change(scene, moved)

    def own(scene: Scene, p: Pose) -> Scene:
        return change(scene, lambda x: replace(x, world_from_light=p.in_own(x.world_from_light)))

    def strobe(scene: Scene, new: Changes) -> Scene:
        return change(scene, lambda x: replace(x, strobe=replace(x.strobe, **new)))

    groups = {"": Group(values, declared, numbers)}
    groups["strobe"] = Group(_values(light.strobe), parameters(Strobe), strobe)
    if light.kind is not LightKind.DOME:
        groups |= {"pose": _posed(pose), "own": _posed(own)}
    words = ("light_intensity", "light_size", "light_beam", "light_spectrum")
    return groups | {w: _on_scene(MODELS[w], light.name) for w in words if w in MODELS}


def of_object(name: str) -> dict[str, Group]:
    def pose(scene: Scene, p: Pose) -> Scene:
        middle = bounds(scene, name).mean(axis=0)
        return with_bodies(
            scene, name, lambda b: replace(b, world_from_body=p.in_world(b.world_from_body, middle))
        )

    def own(scene: Scene, p: Pose) -> Scene:
        return with_bodies(scene, name, lambda b: replace(b, world_from_body=p.in_own(b.world_from_body)))

    return {"pose": _posed(pose), "own": _posed(own)}


def of_material(material: Material) -> dict[str, Group]:
    brdf = material.brdf
    mapped = set(material.maps)

    def change(scene: Scene, new: Changes) -> Scene:
        beside = {k: v for k, v in new.items() if k in parameters(Matter)}
        inside = {k: v for k, v in new.items() if k not in beside}
        if textured := mapped & set(inside):
            raise BrightfieldError(
                f"A number can be set only where no texture stands for it; {', '.join(sorted(textured))} has one."
            )
        Matter(**beside)  # checks the bounds

        def changed(m: Material) -> Material:
            return replace(m, brdf=replace(m.brdf, **inside) if inside else m.brdf, **beside)  # type: ignore[type-var]

        return with_materials(scene, material.name, changed)

    values = {**_values(brdf), "emission": material.emission, "opacity": material.opacity}
    groups = {"": Group(values, {**parameters(brdf), **parameters(Matter)}, change)}
    words = [
        w
        for w, kind in MODELS.items()
        if kind.stage is Stage.MATERIAL and kind.on_scene is not Effect.on_scene
    ]
    return groups | {w: _on_scene(MODELS[w], material.name) for w in words}


def _on_scene(kind: type[Effect], name: str) -> Group:
    """An effect of the catalogue that changes what is rendered, on one prim."""
    nothing = kind()

    def put(scene: Scene, new: Changes) -> Scene:
        return kind(**new).on_scene(scene, name)

    return Group(_values(nothing), parameters(kind), put)
