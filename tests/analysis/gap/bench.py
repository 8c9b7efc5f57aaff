"""Captures of the bench with three of its six lamps, and its renderings by the rasteriser, for the tests of the
diagnosis from captures.json to the verdict; the fixture ``rig`` of conftest."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
import trimesh
from pxr import Usd, UsdGeom, Vt

from analysis.gap.compared.conditions import Condition, conditions
from analysis.gap.diagnose import Diagnosed, diagnose
from analysis.gap.light import knots
from analysis.gap.light.radiance import Rendered, render_all
from analysis.gap.renderers import renderer
from analysis.gap.sensor.expected import noise_variance
from interchange.captures import Captures
from interchange.effects import Effect
from interchange.exposure import expose
from interchange.formats import captures as captures_file
from interchange.formats import images
from interchange.formats.document import Document, open_scene
from interchange.image import Image

BENCH = Path(__file__).parents[3] / "assets/bench_sample/scene.usda"
WIDTH, HEIGHT = 112, 84
SAMPLES = 8
TIMES = (0, 1, 4, 6, 7, 10, 12, 13, 15)
EXPOSURE = dict.fromkeys((6, 7, 13), 0.5) | {10: 0.25}


def little_bench(file: Path, width: int, height: int, without: Sequence[str] = (), mosaic: str = "") -> None:
    """The bench for sensors of a few px, behind a ``mosaic``, without some of its lamps and things, into ``file``. Its
    ball, which has 9024 faces and takes half of the time of every rendering, has 480 here."""
    stage = Usd.Stage.Open(str(BENCH))
    ball = UsdGeom.Mesh(stage.GetPrimAtPath("/World/ball"))
    points = np.array(ball.GetPointsAttr().Get())
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    coarse = trimesh.creation.uv_sphere(np.ptp(points[:, 2]) / 2, [12, 12])
    ball.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy((coarse.vertices + middle).astype(np.float32)))
    ball.GetNormalsAttr().Set(Vt.Vec3fArray.FromNumpy(coarse.vertex_normals.astype(np.float32)))
    ball.GetFaceVertexCountsAttr().Set(Vt.IntArray.FromNumpy(np.full(len(coarse.faces), 3, np.int32)))
    ball.GetFaceVertexIndicesAttr().Set(Vt.IntArray.FromNumpy(coarse.faces.astype(np.int32).ravel()))
    for name in without:
        assert stage.RemovePrim(f"/World/{name}")
    text = stage.GetRootLayer().ExportToString()
    assert text.count("(480, 360)") == 2
    filters = f'\n        token sensor:mosaic = "{mosaic}"' if mosaic else ""
    file.write_text(text.replace("(480, 360)", f"({width}, {height}){filters}"))


def camera_at(time: float) -> str:
    return "/World/Camera0" if time < 13 else "/World/Camera1"


@dataclass(frozen=True, eq=False)
class Rig:
    """``truth``: what ``document`` shows at each of ``times``, by the diagnosis's own renderer, which is not what is
    tested. ``cache`` holds what was rendered."""

    folder: Path
    document: Document
    truth: list[Rendered]
    cache: Path
    times: tuple[int, ...]

    def captured(self, name: str, effects: Sequence[Effect], reflected: float = 0.0) -> Captures:
        """Written to ``folder / name``, and read; with ``reflected`` times the light that the renderer leaves out."""
        rng = np.random.default_rng(3)
        entries = []
        (self.folder / name).mkdir(exist_ok=True)
        for time, shown in zip(self.times, self.truth, strict=True):
            scene = self.document.scene(time)
            camera = scene.camera(camera_at(time))
            camera = replace(camera, sensor=replace(camera.sensor, prnu=0.0))
            t_exp = EXPOSURE.get(time, 1.0)
            radiance = shown.radiance(scene) + np.float32(reflected) * sum(
                plane * shown.weights(scene)[name].astype(np.float32) for name, plane in shown.undrawn.items()
            )
            dn = expose(Image(radiance), camera, t_exp, rng=rng, effects=effects).pixels
            file = self.folder / name / f"{time:02d}.png"
            images.write(file, dn.astype(np.uint16))
            entries.append({"image": file.name, "camera": camera.name, "time": time, "exposure": t_exp})
        path = self.folder / name / "captures.json"
        path.write_text(json.dumps({"scene": "../scene.usda", "captures": entries}))
        return captures_file.read(path)

    def diagnosed(self, captures: Captures, out: str, binning: int = 1, reflected: bool = True) -> Diagnosed:
        """``reflected``: whether light that the renderer leaves out is traced. What things that move change is rendered
        with a quarter of the spots, as most of the time goes there."""
        where = self.folder / out
        where.mkdir(exist_ok=True)
        samples = SAMPLES // binning**2
        with (
            patch.object(knots, "FINER", 1),
            patch.object(knots, "MANY", SAMPLES),
            renderer("realtime", samples, reflected, binning) as (render, settings),
        ):
            return diagnose(
                captures,
                self.document,
                render,
                settings,
                self.cache,
                where,
                verify=True,
                binning=binning,
            )


def rig_in(
    folder: Path,
    cache: Path,
    without: Sequence[str] = (),
    reflected: bool = True,
    times: tuple[int, ...] = TIMES,
    mosaic: str = "",
) -> Rig:
    """``without``: what the bench has besides three of its lamps; ``reflected``: whether it shows light by way of
    surfaces; ``mosaic``: of its sensors."""
    little_bench(folder / "scene.usda", WIDTH, HEIGHT, ("LED2", "LED3", "LED5", *without), mosaic)
    document = open_scene(folder / "scene.usda")
    views = [(s, s.camera(camera_at(s.time))) for s in map(document.scene, times)]
    with renderer("realtime", SAMPLES, reflected) as (render, settings):
        return Rig(folder, document, render_all(views, render, settings, cache), cache, times)


def of_their_own(rig: Rig, seed: int) -> tuple[list[Condition], list[np.ndarray], list[np.ndarray]]:
    """Conditions whose captures are their own simulation and noise of its size; the simulations, and σ, DN."""
    rng = np.random.default_rng(seed)
    whole, expected, sigmas = [], [], []
    found = conditions(rig.captured("null", ()), rig.document)
    for c, r in zip(found, [r for t, r in zip(TIMES, rig.truth, strict=True) if t != 7], strict=True):
        there = replace(c, rendered=r)
        dn = there.simulated().dn
        temporal, pattern = noise_variance(dn, c.camera)
        sigma = np.sqrt(temporal / len(c.captures) + pattern)
        whole.append(replace(there, mean=dn + sigma * rng.standard_normal(dn.shape)))
        expected.append(dn)
        sigmas.append(sigma)
    return whole, expected, sigmas
