"""The bench of assets/bench_sample in little, for the tests of the diagnosis: 128 x 96 px, two of its six lamps; and
with captures (tests.analysis.gap.bench)."""

import json
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Protocol

import numpy as np
import pytest

from analysis.gap.compared.conditions import Condition, conditions
from analysis.gap.light.radiance import Paths, render_all
from interchange.camera import Camera
from interchange.formats import captures as captures_file
from interchange.formats import images
from interchange.formats.document import open_scene
from interchange.image import Image
from interchange.scene import Scene
from realtime.renderers.rasterizer import Rasterizer
from tests.analysis.gap.bench import Rig, little_bench, rig_in

WIDTH, HEIGHT = 128, 96


class Bench(Protocol):
    def __call__(
        self, folder: Path, shots: dict[int, str], spots: int, without: Sequence[str] = ()
    ) -> list[Condition]: ...


@pytest.fixture(scope="session")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where renderings are kept under their content, for all workers of a run."""
    own = tmp_path_factory.getbasetemp()
    folder = (own.parent if "PYTEST_XDIST_WORKER" in os.environ else own) / "renderings"
    folder.mkdir(exist_ok=True)
    return folder


@pytest.fixture(scope="session")
def rig(tmp_path_factory: pytest.TempPathFactory, kept: Path) -> Rig:
    return rig_in(tmp_path_factory.mktemp("gap"), kept)


@pytest.fixture(scope="session")
def small_bench(rasterizer: Rasterizer, kept: Path) -> Bench:
    """(folder, {time: camera}, spots of a pixel) to its conditions, rendered; ``without`` some of its things."""

    def made(folder: Path, shots: dict[int, str], spots: int, without: Sequence[str] = ()) -> list[Condition]:
        def render(
            scene: Scene, camera: Camera, passes: Sequence[str], per_light: bool, parts: int, paths: Paths
        ) -> Image:
            return rasterizer.render(scene, camera, passes, per_light, max(spots // parts, 1))

        little_bench(folder / "scene.usda", WIDTH, HEIGHT, without)
        for time in shots:
            images.write(folder / f"{time}.png", np.ones((HEIGHT, WIDTH, 3), np.uint16))
        entries = [
            {"image": f"{time}.png", "camera": f"/World/{camera}", "time": time, "exposure": 1.0}
            for time, camera in shots.items()
        ]
        (folder / "captures.json").write_text(json.dumps({"scene": "scene.usda", "captures": entries}))
        bare = conditions(captures_file.read(folder / "captures.json"), open_scene(folder / "scene.usda"))
        bare = [replace(c, scene=replace(c.scene, lights=c.scene.lights[0:3:2])) for c in bare]
        views = [(c.scene, c.camera) for c in bare]
        shown = render_all(views, render, {"renderer": "rasterizer", "samples": spots}, kept)
        return [replace(c, rendered=r) for c, r in zip(bare, shown, strict=True)]

    return made
