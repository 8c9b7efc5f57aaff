"""The discs and the dark at shutter times from 25 to 3916 ms, against a sensor that never saturates and has no dark
current.

One green site of every four, as it was read out. Reference: the DN at which pictures end, medians over the shutter
time, and what hot sites of the dark frames grow by.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from benchmarks.diagnosed import diagnosed, written
from benchmarks.flea3_discs import (
    FOLDER,
    FULL_WELL,
    Discs,
    falling_off,
    ink,
    lamp,
    light,
    picture,
    sheet,
    smaller,
    taught,
)
from benchmarks.twin_flea3 import raw, rims
from interchange.camera import Camera, Lens, Sensor
from interchange.exposure import expose
from interchange.formats import images
from interchange.scene import Scene
from realtime.renderers.rasterizer import Rasterizer

SHUTTERS = (25, 50, 100, 250, 500, 2000, 3916)  # ms
HELD = (50, 500)  # ms of the conditions that nothing is fitted to
TAUGHT = 25  # ms of the picture that pose, lamp and ink are from: no site is saturated in it
HOT = 5  # DN in the longest dark frames from which on a site is looked at by itself


@dataclass(frozen=True, eq=False)
class Series:
    """``light`` and ``dark`` {ms: (h, w) or (2, h, w) DN} of one green site of every four."""

    light: dict[int, np.ndarray]
    dark: dict[int, np.ndarray]

    @property
    def highest(self) -> int:
        """DN at which pictures end."""
        return int(max(y.max() for y in self.light.values()))

    def grown(self, ms: int) -> np.ndarray:
        """(n,) DN at a shutter time of the sites that are hot in both of the longest dark frames."""
        hot = (self.dark[max(self.dark)] >= HOT).all(axis=0)
        return np.asarray(self.dark[ms].mean(axis=0)[hot])


def read() -> Series:
    def green(y: np.ndarray) -> np.ndarray:
        return y[0::2, 0::2]

    dark = {
        ms: np.stack([green(raw(FOLDER / f"dark_{ms:04d}ms_{k}.png")) for k in (1, 2)]) for ms in SHUTTERS
    }
    return Series({ms: green(picture(550, ms)) for ms in SHUTTERS}, dark)


def exposures(out: Path, with_dark: bool, drawn_to: Path | None) -> None:
    series = read()
    print(f"pictures end at {series.highest} DN; {series.grown(SHUTTERS[0]).size} sites are hot")
    for ms in SHUTTERS:
        y, hot = series.light[ms], series.grown(ms)
        print(
            f"  {ms} ms: median {np.median(y):.0f} DN, {np.median(y) / ms:.3f} DN/ms, saturated "
            f"{100 * (y == series.highest).mean():.1f} %; dark: hot sites {hot.mean():.2f} DN in the mean, "
            f"hottest {series.dark[ms].max()}, {100 * (series.dark[ms] > 0).mean():.2f} % above 0"
        )
    long = sorted(SHUTTERS)[-3:]
    rates = [1e3 * series.grown(ms).mean() / ms for ms in long]
    print("  hot sites: " + ", ".join(f"{r:.2f} DN/s at {ms} ms" for r, ms in zip(rates, long, strict=True)))
    discs = taught(picture(550, TAUGHT))
    camera = twin(discs.camera, series.light[TAUGHT].shape)
    bodies = sheet(discs, [ink(discs, picture(550, TAUGHT), "green")] * 3)
    at, power = lamp(discs, picture(550, TAUGHT), "green")
    own = [light("/World/Lamp550", at, (x,) * 3) for x in (power / (1e-3 * TAUGHT), 0.0)]
    camera = as_sharp(camera, Scene(bodies, (own[0],), (camera,)), series.light[TAUGHT], discs)
    entries: list[dict[str, Any]] = []
    for ms in SHUTTERS:
        names = [(f"light_{ms:04d}ms.png", series.light[ms], 0)]
        if with_dark:
            names += [(f"dark_{ms:04d}ms_{k + 1}.png", y, 1) for k, y in enumerate(series.dark[ms])]
        for name, y, time in names:
            images.write(out / name, y.astype(np.uint16))
            entries.append({"image": name, "camera": "/World/Camera", "time": time, "exposure": 1e-3 * ms})
    held = [e["image"] for e in entries if round(1e3 * e["exposure"]) in HELD]
    tolerances = {"registration_px": 0.05, "light_intensity": 0.02, "light_position_mm": 30, "flat_field": 0.01,
                  "black_level_dn": 1, "albedo": 0.05, "object_pose_mm": 0.01}  # fmt: skip
    written(out, [Scene(bodies, (x,), (camera,)) for x in own], entries, tolerances, held)
    found = diagnosed(out)
    compared(found, series)
    if drawn_to is not None:
        drawn(found, series).savefig(drawn_to, dpi=110)


def compared(found: dict[str, Any], series: Series) -> None:
    told = {f["name"]: f["parameters"] for f in found["effects"]}
    dn = 255 / FULL_WELL
    if "saturation" in told:
        full = told["saturation"]["full_well"]
        print(
            f"  saturation at {full['value'] * dn:.2f} ± {full['sigma'] * dn:.2f} DN; pictures end at {series.highest}"
        )
    else:
        print(f"  saturation: not found; pictures end at {series.highest} DN")
    if "hot_current" in told.get("fixed_pattern", {}):
        own, longest = told["fixed_pattern"], max(SHUTTERS)
        grown = series.grown(longest)
        size = series.dark[longest][0].size
        share, current = own["hot_share"], own["hot_current"]
        print(
            f"  hot: {size * share['value']:.1f} ± {size * share['sigma']:.1f} pixels, "
            f"{current['value'] * dn:.1f} ± {current['sigma'] * dn:.1f} DN/s in the mean; reference: "
            f"{grown.size}, {1e3 * (grown.mean() - HOT) / longest:.1f} DN/s beyond the {HOT} DN that "
            f"they were chosen by"
        )


def twin(camera: Camera, shape: tuple[int, int]) -> Camera:
    """One site of every 2 x 2: its middle is the site's own. Radiance 1 for a second is a DN."""
    sensor = Sensor(
        responsivity=FULL_WELL / 255, full_well=FULL_WELL * (2**16 - 1) / 255, bit_depth=16, mosaic="mono"
    )
    own = smaller(camera, 2, (shape[1], shape[0]), sensor)
    cx, cy = camera.K[:2, 2] / 2
    return falling_off(replace(own, lens=Lens(camera.lens.focal_length), principal_point=(cx, cy)))


def as_sharp(camera: Camera, scene: Scene, real: np.ndarray, discs: Discs) -> Camera:
    """The camera with the blur of the discs' edges in ``real``."""
    with Rasterizer() as renderer:
        sharp = expose(renderer.render(scene, camera, samples=16), t_exp=1e-3 * TAUGHT).pixels[..., 0]
    a, b = (rims(p, camera, discs.centres, discs.radius)[0].sigma for p in (real, sharp))
    blur = float(np.sqrt(max(np.nanmedian(a) ** 2 - np.nanmedian(b) ** 2, 0)))
    print(f"  blur {blur:.2f} px rms")
    return replace(camera, lens=replace(camera.lens, blur=blur))


def drawn(found: dict[str, Any], series: Series) -> Figure:
    """Medians over the shutter time beside the ideal sensor and what was found; hot sites of the dark frames."""
    figure = Figure(figsize=(10, 4), layout="tight")
    left, right = figure.subplots(1, 2)
    ms = np.array(SHUTTERS, float)
    seen = np.array([np.median(series.light[t]) for t in SHUTTERS])
    ideal = seen[0] / ms[0] * ms
    left.loglog(ms, seen, "ko", label="pictures, median of green sites")
    left.loglog(ms, ideal, "r:", label="ideal twin")
    told = {f["name"]: f["parameters"] for f in found["effects"]}
    if "saturation" in told:
        full = told["saturation"]["full_well"]["value"] * 255 / FULL_WELL
        left.loglog(ms, np.minimum(ideal, full), "g--", label=f"diagnosis: full well at {full:.1f} DN")
    left.set(xlabel="shutter time, ms", ylabel="DN", title="discs under 550 nm")
    left.legend()
    hot = np.array([series.grown(t) for t in SHUTTERS])
    right.loglog(ms, np.maximum(hot, 0.1), "o-", ms=3, lw=0.8)
    right.set(
        xlabel="shutter time, ms", ylabel="DN, lens covered", title="sites that are hot (0 is drawn at 0.1)"
    )
    return figure
