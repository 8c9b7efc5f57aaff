"""`brightfield diagnose CAPTURES.json`: where a simulation differs from captures, which effect causes it."""

import argparse
import os
import sys
from pathlib import Path

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


def run(args: argparse.Namespace) -> int:
    from analysis.gap.diagnose import diagnose
    from analysis.gap.diagnosis import write
    from analysis.gap.renderers import renderer
    from analysis.gap.report import sentence, write_report
    from interchange.formats import captures as captures_file
    from interchange.formats.document import open_scene

    if args.samples < 0:
        raise BrightfieldError(f"--samples must be 1 or more; got {args.samples}.")
    captures = captures_file.read(args.captures)
    document = open_scene(captures.scene)
    args.out.mkdir(parents=True, exist_ok=True)
    home = Path(os.environ.get("XDG_CACHE_HOME", "") or Path.home() / ".cache")
    cache = args.cache or home / "brightfield" / "renderings"
    with renderer(args.render, args.samples) as (render, settings):
        found = diagnose(captures, document, render, settings, cache, args.out, _told)
    d = found.diagnosis
    write(args.out / "diagnosis.json", d)
    write_report(args.out / "report.html", found, captures)
    print(sentence(d))
    for f in d.effects:
        values = ", ".join(f"{n} = {p.value:.4g} ± {p.sigma:.2g} {p.unit}" for n, p in f.parameters.items())
        print(f"  {f.name:28} p = {f.probability:.3f}  {values}")
    for words, p in d.unknown:
        print(f"  not in the catalogue         p = {p:.3f}  {words}")
    g = d.gap
    print(f"  gap on held-out captures: chi {g.before:.3f} -> {g.after:.3f}, noise {g.noise_floor:.3f}")
    print(f"{args.out / 'report.html'} written.")
    return 0


def _told(what: str, share: float) -> None:
    if sys.stderr.isatty():
        print(f"\r{what} {100 * share:3.0f} %   ", end="", file=sys.stderr, flush=True)
