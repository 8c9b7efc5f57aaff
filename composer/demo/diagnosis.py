"""The demo's second part: captures that another engine made, against a scene that does not know their lens."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from analysis.gap.diagnose import Diagnosed, diagnose
from analysis.gap.diagnosis import write
from analysis.gap.renderers import renderer
from analysis.gap.report.page import write_report
from analysis.gap.report.words import sentence
from composer.demo import pictures
from interchange.captures import Captures
from interchange.formats.document import open_scene

CAPTURES = "bench_sample/captures.json"  # of the assets
BINNED = 2  # pixels across that are taken as one: a quarter of the time


@dataclass(frozen=True)
class Shown:
    """What the page says of a diagnosis: of how many captures, its verdict and numbers, χ before, after and of noise,
    and where files are."""

    captures: int
    verdict: str
    numbers: tuple[str, ...]
    gap: tuple[float, float, float]
    picture: str
    report: str


def diagnosed(out: Path, given: Captures, say: Callable[[str], None]) -> tuple[Shown, np.ndarray]:
    """Diagnoses captures into ``out``/diagnosis, renderings beside; the picture is (H, W, 3) uint8."""
    folder = out / "diagnosis"
    folder.mkdir(parents=True, exist_ok=True)
    with renderer("offline") as (render, settings):
        found = diagnose(
            given,
            open_scene(given.scene),
            render,
            settings,
            folder / "renderings",
            folder,
            _Told(say),
            binning=BINNED,
        )
    write(folder / "diagnosis.json", found.diagnosis)
    write_report(folder / "report.html", found, given)
    d = found.diagnosis
    numbers = tuple(
        f"{effect.name} {name} = {p.value:.3f} ± {p.sigma:.3f}"
        for effect in d.effects
        for name, p in effect.parameters.items()
    )
    gap = d.gap.before, d.gap.after, d.gap.noise_floor
    shown = Shown(len(given.captures), sentence(d), numbers, gap, "diagnosis.png", "diagnosis/report.html")
    return shown, _picture(found)


def _picture(found: Diagnosed) -> np.ndarray:
    """The held-out capture with the largest gap, and how far both simulations are off it."""
    sims = found.simulations
    off = [np.abs(c.mean - b).mean() for c, b in zip(found.held_out, sims.before, strict=True)]
    k = int(np.argmax(off))
    capture, top = found.held_out[k].mean, found.held_out[k].simulated().top
    scale = float(np.percentile(np.abs(capture - sims.before[k]), 99))
    planes = [
        pictures.shown(capture / top, pictures.exposure_for(capture / top)),
        pictures.difference(capture, sims.before[k], scale),
        pictures.difference(capture, sims.after[k], scale),
    ]
    captions = [
        "capture, held out",
        f"- the scene as written, at its best; full colour = {scale:.0f} DN",
        "- the corrected scene, same colours",
    ]
    return pictures.sheet([x.repeat(BINNED, 0).repeat(BINNED, 1) for x in planes], captions, columns=3)


class _Told:
    """Says what is done when that changes."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self.say, self.last = say, ""

    def __call__(self, what: str, share: float) -> None:
        if what != self.last:
            self.last = what
            self.say(f"diagnosing captures: {what}")
