"""Both renderers as the diagnosis calls them, with settings that name every image they make."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

from analysis.gap.radiance import Paths, Render
from interchange.camera import Camera
from interchange.image import Image
from interchange.scene import Scene

NAMES = ("offline", "realtime")
LEAST = 4  # samples of the rasteriser that a lamp's half-shadow is told from
SAMPLES = {"offline": 81, "realtime": 16}  # of a pixel
REFLECTED = 64  # paths of reflected light, which is denoised


@contextmanager
def renderer(name: str, samples: int = 0) -> Iterator[tuple[Render, dict[str, Any]]]:
    """The renderer, and what decides its image. ``samples`` 0 takes as many as a diagnosis needs."""
    samples = samples or SAMPLES[name]
    if name == "offline":
        from offline.renderers.cycles import Cycles
        from offline.settings import CyclesSettings

        every = CyclesSettings(samples=samples, denoise=1)
        around = CyclesSettings(samples=min(samples, REFLECTED), denoise=1, direct_samples=1)
        with Cycles() as cycles:

            def traced(
                scene: Scene,
                camera: Camera,
                passes: Sequence[str],
                per_light: bool,
                parts: int,
                paths: Paths,
            ) -> Image:
                own = {
                    Paths.ALL: every,
                    Paths.DIRECT: replace(every, samples=-(-samples // parts), max_bounces=0),
                    Paths.REFLECTED: around,
                }[paths]
                return cycles.render(scene, camera, own, passes, per_light)

            yield (
                traced,
                {
                    "renderer": "cycles",
                    "indirect": True,
                    "reflected": around.samples,
                    **every.as_dict(),
                },
            )
    else:
        from realtime.renderers.rasterizer import Rasterizer

        with Rasterizer() as rasterizer:

            def drawn(
                scene: Scene,
                camera: Camera,
                passes: Sequence[str],
                per_light: bool,
                parts: int,
                paths: Paths,
            ) -> Image:
                own = samples if parts == 1 else max(-(-samples // parts), LEAST)
                return rasterizer.render(scene, camera, passes, per_light, own)

            yield drawn, {"renderer": "rasterizer", "indirect": False, "samples": samples}
