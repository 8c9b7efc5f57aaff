"""The scene with the effects written in, in the terms of the file contract, ready to render."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from analysis.gap.diagnosis import Finding
from interchange.effects import MODELS, Effect
from interchange.formats import usd_sensor
from interchange.formats.document import Document
from interchange.scene import Scene

LIGHT = "inputs:intensity"


def write_corrected(
    document: Document, scene: Scene, effects: Sequence[Effect], findings: Sequence[Finding], path: Path
) -> list[str]:
    """Write to ``path``; returns the names of the effects that a scene file cannot carry yet."""
    stage = document.stage
    written = set()
    carried = [e for e in effects if e.carried_by or type(e).on is not Effect.on]
    for camera in scene.cameras:
        new = camera
        for effect in carried:
            new = effect.on(new)
        usd_sensor.author(stage.GetPrimAtPath(camera.name), new)
    written |= {e.name() for e in carried if e.name() in MODELS}
    for finding in findings:
        values = {name: p.value for name, p in finding.parameters.items()}
        if finding.name == "exposure":
            for camera in scene.cameras:
                _scale(stage.GetPrimAtPath(camera.name).GetAttribute("sensor:responsivity"), values["scale"])
        elif finding.name == "light_intensity":
            for name, value in values.items():
                lamp = name.removesuffix(" scale")
                light = next(x for x in scene.lights if x.name.rsplit("/", 1)[-1] == lamp)
                _scale(stage.GetPrimAtPath(light.name).GetAttribute(LIGHT), value)
        elif finding.name == "ambient_light":
            _add_dome(stage, [values.get(k, values.get("Y", 0.0)) for k in "RGB"])
        else:
            continue
        written.add(finding.name)
    document.save(path)
    if not stage.GetRootLayer().anonymous:
        stage.Reload()  # the file that was read stays what it is, in memory too
    return [f.name for f in findings if f.name not in written]


def _scale(attribute: Any, factor: float) -> None:
    times = attribute.GetTimeSamples()
    for time in times:
        attribute.Set(attribute.Get(time) * factor, time)
    if not times:
        attribute.Set(attribute.Get() * factor)


def _add_dome(stage: Any, radiance: Sequence[float]) -> None:
    root = stage.GetDefaultPrim()
    path = f"{root.GetPath() if root else ''}/AmbientLight"
    prim = stage.DefinePrim(path, "DomeLight")
    most = max(*radiance, 1e-12)
    prim.CreateAttribute(LIGHT, usd_sensor.NAMES.Float).Set(most)
    prim.CreateAttribute("inputs:color", usd_sensor.NAMES.Color3f).Set(
        tuple(max(x, 0.0) / most for x in radiance)
    )
