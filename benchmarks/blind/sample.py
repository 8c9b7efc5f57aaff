"""The fifth scene: the bench of the sample captures, read from the scene file that came with them."""

from pathlib import Path

import numpy as np
from pxr import Usd, UsdGeom, UsdLux, UsdShade

from benchmarks.blind.bench import Bench, Eye, Lamp, Matter, Part, Sensor, Shot
from benchmarks.blind.solids import Solid

FILE = Path(__file__).resolve().parents[2] / "assets/bench_sample/scene.usda"


def sample() -> Bench:
    """A plate with a checkerboard, a bracket, a pin, a ball and walls, under six lamps; two cameras."""
    stage = Usd.Stage.Open(str(FILE))
    matters, parts, lamps, eyes = [], [], [], []
    for prim in stage.Traverse():
        match prim.GetTypeName():
            case "Material":
                matters.append(_matter(stage, prim))
            case "Mesh":
                parts.append(_part(prim))
            case "SphereLight":
                lamps.append(_lamp(prim))
            case "Camera":
                M = np.array(UsdGeom.Xformable(prim).GetLocalTransformation())
                camera = UsdGeom.Camera(prim)
                focal = camera.GetFocalLengthAttr().Get() / camera.GetHorizontalApertureAttr().Get()
                rotation = tuple(tuple(float(x) for x in row) for row in M[:3, :3])
                eyes.append(Eye(prim.GetName(), tuple(M[3, :3]), rotation, float(focal)))
    responsivity = float(stage.GetPrimAtPath("/World/Camera0").GetAttribute("sensor:responsivity").Get())
    return Bench(
        "sample",
        tuple(matters),
        tuple(parts),
        tuple(lamps),
        tuple(eyes),
        Sensor(responsivity),
        _shots(len(lamps)),
        size=(480, 360),
    )


def _shots(lamps: int) -> tuple[Shot, ...]:
    """As the sample's own captures."""
    every = tuple(range(lamps))
    return (
        *(Shot(0, 0, (k,), 1.0) for k in every),
        Shot(0, 0, every, 0.5, 4),
        Shot(0, 0, every, 0.25),
        Shot(0, 0, every, 1.0),
        Shot(0, 0, (), 1.0),
        Shot(1, 0, every, 0.5, 2),
        *(Shot(1, 0, (k,), 1.0) for k in (0, 2, 5)),
    )


def _matter(stage: Usd.Stage, prim: Usd.Prim) -> Matter:
    brdf = UsdShade.Shader(stage.GetPrimAtPath(f"{prim.GetPath()}/Brdf"))
    weight, C, n, diffuse = (brdf.GetInput(name).Get() for name in ("weight", "C", "n", "diffuse"))
    lobes = tuple(
        (tuple(map(float, w)), tuple(map(float, c)), float(power))
        for w, c, power in zip(weight or [], C or [], n or [], strict=True)
    )
    model = "Lafortune" if lobes else "Lambert"
    return Matter(prim.GetName(), model, tuple(map(float, diffuse)), lobes)


def _part(prim: Usd.Prim) -> Part:
    mesh = UsdGeom.Mesh(prim)
    normals = mesh.GetNormalsAttr().Get()
    solid = Solid(
        np.array(mesh.GetPointsAttr().Get(), float),
        np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3),
        np.array(normals, float) if normals else None,
    )
    return Part(prim.GetName(), solid, prim.GetRelationship("material:binding").GetTargets()[0].name)


def _lamp(prim: Usd.Prim) -> Lamp:
    light = UsdLux.SphereLight(prim)
    place = UsdGeom.Xformable(prim).GetLocalTransformation().ExtractTranslation()
    times = light.GetIntensityAttr().GetTimeSamples()
    return Lamp(
        prim.GetName(),
        tuple(map(float, place)),
        float(light.GetRadiusAttr().Get()),
        max(float(light.GetIntensityAttr().Get(t)) for t in times),
    )
