"""EMVA 1288 of a colour camera: each channel of the raw mosaic is a camera of its own, as the standard has it.

The sheet of the whole camera has each channel's quantum efficiency, and of everything else the mean over the pixels:
one converter reads them all, and how far their gains differ shows in the channels' own sheets.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from interchange.effects.mosaic import phases
from interchange.formats.emva_sheet import DataSheet, Result
from interchange.problems import BrightfieldError
from interchange.sensor import Mosaic

NAMES = ("red", "green", "blue")
SHARED = (
    "K", "sigma_d", "sigma_y.dark", "mu_y.dark", "mu_I.mean", "mu_I.var", "DSNU1288", "DSNU1288.row", "DSNU1288.col",
    "DSNU1288.pixel", "PRNU1288", "PRNU1288.row", "PRNU1288.col", "PRNU1288.pixel", "mu_e.sat",
)  # fmt: skip


def planes(image: np.ndarray, pattern: Mosaic) -> dict[str, np.ndarray]:
    """A raw image (H, W) as its four (H/2, W/2): red, green (in red's rows), green2 (in blue's rows), blue.

    Raises BrightfieldError where the pattern is none or a side is odd.
    """
    if not pattern.is_bayer:
        raise BrightfieldError(f'Channels need a Bayer pattern; got "{pattern}".')
    if image.shape[0] % 2 or image.shape[1] % 2:
        raise BrightfieldError(
            f"A Bayer image must have even sides; got {image.shape[1]} x {image.shape[0]} px."
        )
    places = phases(pattern)
    red_row = next(i for i, _, channel in places if channel == 0)
    found = {}
    for i, j, channel in places:
        name = NAMES[channel] + ("2" if channel == 1 and i != red_row else "")
        found[name] = image[i::2, j::2]
    return dict(sorted(found.items(), key=lambda item: ("red", "green", "green2", "blue").index(item[0])))


def joined(sheets: Mapping[str, DataSheet], pattern: Mosaic) -> DataSheet:
    """The camera's sheet from those of its ``planes``; uncertainties of means as if the planes were independent."""
    of = {name: [s for n, s in sheets.items() if n.rstrip("2") == name] for name in NAMES}
    results = {}
    for name in NAMES:
        if all("eta" in s.results for s in of[name]):
            results[f"eta.{name}"] = _mean([s.results["eta"] for s in of[name]])
    for symbol in SHARED:
        known = [s.results[symbol] for s in sheets.values() if symbol in s.results]
        if len(known) == len(sheets):
            results[symbol] = _mean(known)
    first = next(iter(sheets.values()))
    return replace(
        first, results=results, mosaic=pattern.value, width=2 * first.width, height=2 * first.height, file=""
    )


def _mean(results: list[Result]) -> Result:
    sigmas = [r.sigma for r in results if r.sigma is not None]
    sigma = float(np.sqrt(np.square(sigmas).sum())) / len(results) if len(sigmas) == len(results) else None
    return Result(float(np.mean([r.value for r in results])), sigma)
