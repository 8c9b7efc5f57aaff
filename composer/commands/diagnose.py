"""`brightfield diagnose CAPTURES.json`: where a simulation differs from captures, which effect causes it."""

import argparse
import os
import sys
import time
from pathlib import Path
from typing import TextIO

from interchange.problems import BrightfieldError

HELP = "tell where a simulation differs from captures, which effect causes it, and what closes the gap"


def configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "captures", type=Path, metavar="CAPTURES.json", help="captures and the scene they show"
    )
    parser.add_argument(
        "--render", choices=("offline", "realtime"), default="offline", help="(default %(default)s)"
    )
    parser.add_argument(
        "--out", type=Path, required=True, metavar="DIR", help="diagnosis.json, report.html, scene"
    )
    parser.add_argument(
        "--samples", type=int, default=0, metavar="N", help="of a rendered pixel (default: enough)"
    )
    parser.add_argument(
        "--cache", type=Path, metavar="DIR", help="where renderings are kept (default: the user's cache)"
    )
    parser.add_argument(
        "--metric", metavar="MODULE:FUNCTION", default="",
        help="your own measure of an image, (image) or (image, camera) -> number: its error before and after",
    )  # fmt: skip
    parser.add_argument(
        "--no-verify",
        action="store_true",
        help="do not render the held-out captures from the corrected scene",
    )
    parser.add_argument(
        "--rehearse",
        type=int,
        default=0,
        metavar="N",
        help="calibrate probabilities on N cases simulated from the scene (each takes as long as the fit)",
    )
    parser.add_argument(
        "--bin",
        type=int,
        default=0,
        metavar="N",
        help="take means over N x N pixels (default: 1, more above 0.8 megapixels; 2 or more of colour mosaics)",
    )


def run(args: argparse.Namespace) -> int:
    from analysis.gap.diagnose import diagnose
    from analysis.gap.diagnosis import write
    from analysis.gap.finding import Estimate
    from analysis.gap.measures import metric
    from analysis.gap.processed.binned import times_binned
    from analysis.gap.processed.encoded import has_a_number
    from analysis.gap.renderers import renderer
    from analysis.gap.report.page import write_report
    from analysis.gap.report.words import lacking, sentence
    from interchange.formats import captures as captures_file
    from interchange.formats.document import open_scene

    if args.samples < 0:
        raise BrightfieldError(f"--samples must be 1 or more; got {args.samples}.")
    if args.rehearse < 0:
        raise BrightfieldError(f"--rehearse must be 0 or more; got {args.rehearse}.")
    if args.bin < 0:
        raise BrightfieldError(f"--bin must be 1 or more; got {args.bin}.")
    measure = (args.metric, metric.load(args.metric)) if args.metric else None
    captures = captures_file.read(args.captures)
    document = open_scene(captures.scene)
    args.out.mkdir(parents=True, exist_ok=True)
    home = Path(os.environ.get("XDG_CACHE_HOME", "") or Path.home() / ".cache")
    cache = args.cache or home / "brightfield" / "renderings"
    binning = args.bin or times_binned(captures, document)
    with renderer(args.render, args.samples, binning=binning) as (render, settings):
        found = diagnose(
            captures,
            document,
            render,
            settings,
            cache,
            args.out,
            Progress(),
            not args.no_verify,
            measure,
            args.rehearse,
            binning,
        )

    def told(name: str, p: Estimate) -> str:
        unit = "" if p.unit == "1" else f" {p.unit}"
        return f"{name} = {p.value:.4g} ± {p.sigma:.2g}{unit}" if has_a_number(name) else name

    d = found.diagnosis
    write(args.out / "diagnosis.json", d)
    write_report(args.out / "report.html", found, captures)
    print(sentence(d))
    for f in d.effects:
        values = ", ".join(told(n, p) for n, p in f.parameters.items())
        print(f"  {f.name:28} p = {f.probability:.3f}  {values}")
    for words, p in d.unknown:
        print(f"  not in the catalogue         p = {p:.3f}  {words}")
    g = d.gap
    print(f"  gap on held-out captures: chi {g.before:.3f} -> {g.after:.3f}, noise {g.noise_floor:.3f}")
    if d.edges:
        print(
            f"  edges: rms {d.edges.before.rms:.3f} -> {d.edges.after.rms:.3f} px ({d.edges.after.count} places)"
        )
    if d.metric:
        errors = [d.metric.error(which) for which in ("before", "after")]
        print(f"  error of {d.metric.name}: rms {errors[0]:.4g} -> {errors[1]:.4g}")
    if d.verification:
        v = d.verification
        word = "holds" if v.holds else "DOES NOT HOLD"
        lacks = f" (the file has no {lacking(v)})" if v.lacks else ""
        print(f"  corrected scene rendered anew{lacks}: chi {v.rendered:.3f}; the claim {word} within 10 %")
    print(f"{args.out / 'report.html'} written.")
    return 0


PARTS = {"rendering": 0.45, "registration": 0.6, "fit": 0.8, "verdict": 0.8, "shares": 0.84, "noise": 0.86,
         "where": 0.88, "verification": 1.0}  # fmt: skip  # of the whole, by the end of each


class Progress:
    """One line on the terminal that is written over: what is done, how far it is, and what time is left."""

    def __init__(self, stream: TextIO = sys.stderr) -> None:
        self.began, self.stream, self.shown = time.monotonic(), stream, 0.0

    def __call__(self, what: str, share: float) -> None:
        now = time.monotonic()
        ended = what == list(PARTS)[-1] and share >= 1
        if not self.stream.isatty() or (now - self.shown < 0.2 and not ended):
            return
        self.shown = now
        whole = overall(what, share)
        spent = now - self.began
        left = f", about {_duration(spent * (1 - whole) / whole)} left" if whole > 0.02 and spent > 2 else ""
        end = "\n" if ended else ""
        print(f"\r{what} {100 * share:3.0f} %{left}\033[K", end=end, file=self.stream, flush=True)


def overall(what: str, share: float) -> float:
    """How much of the whole is done when ``share`` of a part is."""
    name = what.split()[0]
    if name not in PARTS:
        return 0.0
    start = ([0.0, *PARTS.values()])[list(PARTS).index(name)]
    return start + min(share, 1.0) * (PARTS[name] - start)


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 90 else f"{seconds / 60:.0f} min"
