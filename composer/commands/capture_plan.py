"""`brightfield capture-plan SCENE`: the few captures that make a diagnosis possible, before anyone goes to the rig."""

import argparse
import json
import os
import sys
from pathlib import Path
from typing import Any

from interchange.problems import BrightfieldError

HELP = "propose the few captures that make the effects of a diagnosis identifiable"
SHOWN = 3  # pairs a capture; in all, 12


def configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scene", type=Path, metavar="SCENE", help="its time codes tell where cameras stand")
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="write captures.json to fill with images, and the scene, there",
    )
    parser.add_argument(
        "--most", type=int, default=12, metavar="N", help="captures at most (default %(default)s)"
    )
    parser.add_argument(
        "--render", choices=("offline", "realtime"), default="realtime", help="(default %(default)s)"
    )
    parser.add_argument(
        "--cache", type=Path, metavar="DIR", help="where renderings are kept (default: the user's cache)"
    )


def run(args: argparse.Namespace) -> int:
    from analysis.gap.capture_plan import capture_plan
    from analysis.gap.renderers import renderer
    from interchange.formats.document import open_scene

    if args.most < 3:
        raise BrightfieldError(f"--most must be 3 or more, so that one can be held out; got {args.most}.")
    document = open_scene(args.scene)
    home = Path(os.environ.get("XDG_CACHE_HOME", "") or Path.home() / ".cache")
    cache = args.cache or home / "brightfield" / "renderings"
    with renderer(args.render, reflected=False) as (render, settings):
        plan = capture_plan(document, render, settings, cache, most=args.most, told=_told)
    if sys.stderr.isatty():
        print("\r\033[K", end="", file=sys.stderr)
    _print(plan)
    if args.out is not None:
        _write(args.out, document, plan)
        print(f"{args.out / 'captures.json'} written: put the images where it names them.")
    return 0


def _print(plan: Any) -> None:
    from analysis.gap.capture_plan import DIM, LONGEST, advice, words

    rows = []
    for k, p in enumerate(plan.captures):
        newly = list(
            dict.fromkeys(f"{words(x.effect)} from {words(x.rival)}" for x in p.separates if x.rival)
        )
        newly = newly or [words(x.effect) for x in p.separates]
        more = f" and {len(newly) - SHOWN} more" if len(newly) > SHOWN else ""
        times = f" x {p.repeats}" if p.repeats > 1 else ""
        said = "; ".join(newly[:SHOWN]) + more
        rows.append(
            (str(k + 1), p.candidate.name + times, f"{p.candidate.exposure:g} s", said or "makes all surer")
        )
    head = ("", "capture", "exposure", "tells")
    wide = [max(len(r[i]) for r in (head, *rows)) for i in range(3)]
    for row in (head, *rows):
        print(
            "  ".join(
                [f"{row[0]:>{wide[0]}}", f"{row[1]:{wide[1]}}", f"{row[2]:>{wide[2]}}", row[3]]
            ).rstrip()
        )
    print(
        f"With these, {plan.told} of {plan.pairs} pairs of effects are told apart where each is 1 % of the signal."
    )
    for c in (p.candidate for p in plan.captures):
        if c.lamps and not c.stops and c.bright < DIM:
            print(
                f"{c.name}: {c.exposure:g} s give its brightest part {100 * c.bright:.2g} % of the highest DN, and "
                f"more than {LONGEST:g} s are not planned for. A brighter lamp, a wider aperture or more gain "
                "would tell more."
            )
    left: dict[str, Any] = {}
    for pair in plan.confusable:
        left.setdefault(" and ".join(sorted((words(pair.effect), words(pair.rival)))), pair)
    if left:
        print("Still confusable:")
    for text, pair in list(left.items())[:12]:
        print(f"  {text} (margin {pair.margin:.1f}): {advice(pair)}")
    if len(left) > 12:
        print(f"  and {len(left) - 12} more pairs")


def _write(folder: Path, document: Any, plan: Any) -> None:
    """captures.json by the file contract, and where the scene has no time code for a capture, a scene that has."""
    from dataclasses import asdict

    from analysis.gap.diagnosis import write_text
    from interchange.captures import Tolerances
    from interchange.formats.usd_changes import Moment, author_moments

    folder.mkdir(parents=True, exist_ok=True)
    times: dict[Any, float] = {}
    moments: list[Moment] = []
    new = max(document.times) + 1
    for p in plan.captures:
        c = p.candidate
        key = (c.like, c.lamps)
        if c.time is not None:
            times[key] = c.time
        elif key not in times:
            times[key] = new
            moments.append(Moment(new, c.like, c.lamps))
            new += 1
    scene = os.path.relpath(document.path, folder)
    if moments:
        own = folder / f"{document.path.stem}_plan.usda"
        lamps = [x.name for x in document.scene().lights]
        author_moments(document.stage, document.times, lamps, moments)
        document.save(own)
        if not document.stage.GetRootLayer().anonymous:
            document.stage.Reload()
        scene = own.name
    entries: list[dict[str, Any]] = []
    for p in plan.captures:
        c = p.candidate
        for _ in range(p.repeats):
            image = f"images/{len(entries):03d}.png"
            time = times[c.like, c.lamps] if c.time is None else c.time
            entries.append({"image": image, "camera": c.camera, "time": time, "exposure": c.exposure})
    head = {"scene": scene, "tolerances": asdict(Tolerances()), "captures": entries}
    (folder / "images").mkdir(exist_ok=True)
    write_text(folder / "captures.json", json.dumps(head, indent=1) + "\n")


def _told(what: str, share: float) -> None:
    if sys.stderr.isatty():
        print(f"\r{what} {100 * share:3.0f} %\033[K", end="", file=sys.stderr, flush=True)
