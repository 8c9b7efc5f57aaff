"""Make the demo: write the scene, render it both ways, diagnose captures of another, and a page that shows it all."""

import html
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from string import Template

import numpy as np

from analysis.agreement import Agreement, agreement, edges
from composer.demo import pictures
from composer.demo.diagnosis import CAPTURES, Shown, diagnosed
from composer.demo.station import FRAMES, station
from interchange.formats import captures as captures_file
from interchange.formats import exr
from interchange.formats.document import Document, open_scene
from interchange.formats.images import write_png
from interchange.formats.usd_author import author_scene
from interchange.image import Image
from offline.renderers.cycles import Cycles
from offline.settings import CyclesSettings
from realtime.renderers.rasterizer import Rasterizer

MIDDLE = 4  # the frame shown large
TRUTH = ("depth", "normal", "position", "object_id", "material_id", "direct", "indirect")
SEEN = ("depth", "normal", "position", "object_id", "material_id", "direct")
SHEET_WIDTH = 240  # px a frame of the contact sheet

Say = Callable[[str], None]


@dataclass(frozen=True)
class Pair:
    """One view through both renderers, and how far their direct light agrees."""

    camera: str
    live: Image
    true: Image
    direct: Agreement
    seconds: tuple[float, float]  # real-time, path-traced


def make(out: Path, assets: Path, samples: int, say: Say) -> Path:
    """Write everything to ``out`` and return the page's path."""
    given = captures_file.read(assets / CAPTURES)
    out.mkdir(parents=True, exist_ok=True)
    say("reading the STEP part and building the station")
    frames = station(assets)
    stage = author_scene(frames[0], 0.001, frames[1:])
    scene_file = out / "scene.usda"
    Document(stage, scene_file).save(scene_file)
    document = open_scene(scene_file)  # what is rendered is what a user gets from the file
    scene = document.scene(MIDDLE)

    with Cycles() as cycles:
        rasterizer = Rasterizer()
        pairs = []
        for camera in scene.cameras:
            name = camera.name.rsplit("/", 1)[-1]
            start = time.perf_counter()
            live = rasterizer.render(scene, camera, passes=SEEN, samples=32)
            middle = time.perf_counter()
            say(f"{name}: real-time in {middle - start:.1f} s; path-tracing {samples} samples a pixel")
            true = cycles.render(scene, camera, CyclesSettings(samples=samples, denoise=1), passes=TRUTH)
            seconds = (middle - start, time.perf_counter() - middle)
            pairs.append(Pair(name, live, true, _direct_agreement(live, true), seconds))
            exr.write(out / f"{name}.realtime.exr", live)
            exr.write(out / f"{name}.offline.exr", true)
            write_png(out / f"{name}.png", _side_by_side(pairs[-1]))
        say("moving the camera round the part")
        write_png(out / "sweep.png", _sweep(document, rasterizer, cycles, say))
    found, picture = diagnosed(out, given, say)
    write_png(out / found.picture, picture)
    page = out / "index.html"
    page.write_text(_page(pairs, scene_file, found), encoding="utf-8")
    return page


def _direct_agreement(live: Image, true: Image) -> Agreement:
    def part(image: Image) -> Image:
        return Image(image.passes["direct"])

    return agreement(part(live), part(true), ~edges(true, 2) & (true.passes["object_id"] >= 0))


def _side_by_side(pair: Pair) -> np.ndarray:
    live, true = pair.live.pixels, pair.true.pixels
    exposure = pictures.exposure_for(true)
    scale = 0.1 / exposure  # a tenth of white
    indirect = true - live
    direct = pair.true.passes["direct"] - pair.live.passes["direct"]
    share = np.mean(np.abs(indirect)) / np.mean(true)
    return pictures.sheet(
        [
            pictures.shown(live, exposure),
            pictures.shown(true, exposure),
            pictures.difference(true, live, scale),
            pictures.difference(direct, 0 * direct, scale),
        ],
        [
            f"real-time rasteriser, {pair.seconds[0]:.1f} s",
            f"path tracer, {pair.seconds[1]:.1f} s; reflected light denoised",
            f"path tracer - rasteriser: {100 * share:.1f} % of the light; full colour = 10 % of white",
            f"direct light alone: {100 * pair.direct.within[0.01]:.1f} % of pixels within 1 %",
        ],
        columns=2,
    )


def _sweep(document: Document, rasterizer: Rasterizer, cycles: Cycles, say: Say) -> np.ndarray:
    live, true, captions = [], [], []
    settings = CyclesSettings(samples=8, denoise=1)
    exposure = 0.0
    for time_code in document.times:
        scene = document.scene(time_code)
        camera = scene.camera("Oblique").resized(SHEET_WIDTH)
        true.append(cycles.render(scene, camera, settings).pixels)
        live.append(rasterizer.render(scene, camera, samples=8).pixels)
        exposure = exposure or pictures.exposure_for(true[0])
        captions.append(f"frame {time_code:g}")
        say(f"frame {len(true)} of {FRAMES}")
    rows: list[np.ndarray] = []
    names: list[str] = []
    columns = 4
    for k in range(0, len(live), columns):
        rows += [pictures.shown(x, exposure) for x in live[k : k + columns]]
        names += [f"{c}, real-time" for c in captions[k : k + columns]]
        rows += [pictures.shown(x, exposure) for x in true[k : k + columns]]
        names += [f"{c}, path-traced" for c in captions[k : k + columns]]
    return pictures.sheet(rows, names, columns)


def _page(pairs: list[Pair], scene_file: Path, found: Shown) -> str:
    figures = "\n".join(
        _figure(
            f"{p.camera}.png", f"Camera {p.camera}: both renderers of the same scene file, with one exposure."
        )
        for p in pairs
    )
    figures += _figure("sweep.png", "The oblique camera on its way round the part, one position a frame.")
    rows = "".join(
        f"<tr><td>{p.camera}</td><td>{p.seconds[0]:.2f} s</td><td>{p.seconds[1]:.2f} s</td>"
        f"<td>{100 * p.direct.within[0.01]:.1f} %</td><td>{100 * p.direct.p95:.2f} %</td>"
        f"<td>{100 * p.direct.bias:+.2f} %</td>"
        f"<td>{100 * float(p.true.passes['indirect'].mean() / p.true.pixels.mean()):.1f} %</td></tr>"
        for p in pairs
    )
    table = (
        "<table><tr><th>camera</th><th>real-time</th><th>path tracer</th>"
        "<th>direct light within 1 %</th><th>95th percentile</th><th>bias</th><th>indirect share</th></tr>"
        f"{rows}</table><p>Pixels up to two from an edge of a body are left out of the comparison.</p>"
    )
    names = [scene_file.name, *(f"{p.camera}.{r}.exr" for p in pairs for r in ("realtime", "offline"))]
    files = " · ".join(f'<a href="{html.escape(n)}">{html.escape(n)}</a>' for n in names)
    template = Template((Path(__file__).parent / "page.html").read_text(encoding="utf-8"))
    intro = (
        "A STEP workpiece in a fixture under a ring of twelve LEDs and a bar light, seen by two cameras. Aluminium and "
        "anodised fixture have Lafortune reflectance. The scene is plain USD; the rasteriser shows direct light, the "
        "path tracer all of it, so their difference is what the surfaces send to each other. Reflected light is "
        "denoised (Open Image Denoise); light straight from the lamps needs no denoising."
    )
    return template.substitute(
        intro=intro, figures=figures, table=table, files=files, diagnosis=_diagnosis(found)
    )


def _diagnosis(found: Shown) -> str:
    before, after, noise = found.gap
    text = (
        f"{found.captures} captures of a bench, path-traced by another engine through a lens that its scene file does "
        f"not know ({CAPTURES} of the assets). On captures that nothing was fitted to, χ goes from {before:.2f} to "
        f"{after:.2f}; the sensor's noise alone is {noise:.2f}. {', '.join(found.numbers)}."
    )
    return (
        f"<p><strong>{html.escape(found.verdict)}</strong></p><p>{html.escape(text)} "
        f'<a href="{found.report}">The whole report</a>.</p>'
        + _figure(
            found.picture, "A held-out capture, and what it has beyond the simulation before and after."
        )
    )


def _figure(name: str, caption: str) -> str:
    text = html.escape(caption)
    return f'<figure><img src="{name}" alt="{text}"><figcaption>{text}</figcaption></figure>'
