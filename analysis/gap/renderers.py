"""Both renderers as the diagnosis calls them, with settings that name every image they make."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from typing import Any

from analysis.gap.light.radiance import Paths, Render
from interchange.camera import Camera
from interchange.image import Image
from interchange.scene import Scene

NAMES = ("offline", "realtime")
LEAST = 4  # samples of the rasteriser that a lamp's half-shadow is told from
SAMPLES = {"offline": 81, "realtime": 16}  # of a pixel
REFLECTED = 64  # paths of reflected light, which is denoised


Renderer = tuple[Render, dict[str, Any]]


@contextmanager
def renderer(name: str, samples: int = 0, reflected: bool = True, binning: int = 1) -> Iterator[Renderer]:
    """The renderer, and what decides its image. ``samples`` of each of the sensor's pixels, of which ``binning`` x
    ``binning`` are one (analysis.gap.processed.binned) that has as much less noise; 0 takes as many as a diagnosis
    needs. The rasteriser draws no ``reflected`` light: with it, paths tell how much there would be, as a pass of its
    own."""
    samples = (samples or SAMPLES[name]) * binning**2
    with _cycles(samples) if name == "offline" else _rasterizer(samples, reflected) as found:
        yield found


@contextmanager
def _cycles(samples: int) -> Iterator[Renderer]:
    from offline.renderers.cycles import Cycles
    from offline.settings import CyclesSettings

    every = CyclesSettings(samples=samples, denoise=1)
    around = CyclesSettings(samples=min(samples, REFLECTED), denoise=1, direct_samples=1)
    with Cycles() as cycles:

        def traced(
            scene: Scene, camera: Camera, passes: Sequence[str], per_light: bool, parts: int, paths: Paths
        ) -> Image:
            own = {
                Paths.ALL: every,
                Paths.DIRECT: replace(every, samples=-(-samples // parts), max_bounces=0),
                Paths.REFLECTED: around,
            }[paths]
            return cycles.render(scene, camera, own, passes, per_light)

        settings = {"indirect": True, "reflected": around.samples, **every.as_dict()}
        yield traced, {"renderer": "cycles", **settings}


@contextmanager
def _rasterizer(samples: int, reflected: bool) -> Iterator[Renderer]:
    from offline.renderers.cycles import Cycles
    from offline.settings import CyclesSettings
    from realtime.renderers.rasterizer import Rasterizer

    around = CyclesSettings(samples=REFLECTED, denoise=1, direct_samples=1)
    with ExitStack() as opened:
        rasterizer = opened.enter_context(Rasterizer())
        tracing: list[Cycles] = []  # opened by the first rendering that no cache holds

        def drawn(
            scene: Scene, camera: Camera, passes: Sequence[str], per_light: bool, parts: int, paths: Paths
        ) -> Image:
            if paths == Paths.REFLECTED:
                if not tracing:
                    tracing.append(opened.enter_context(Cycles()))
                return tracing[0].render(scene, camera, around, passes, per_light)
            own = samples if parts == 1 else max(-(-samples // parts), LEAST)
            return rasterizer.render(scene, camera, passes, per_light, own)

        settings = {"indirect": False, "samples": samples, **({"reflected": REFLECTED} if reflected else {})}
        yield drawn, {"renderer": "rasterizer", **settings}
