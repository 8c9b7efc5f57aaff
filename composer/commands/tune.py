"""`brightfield tune SERIES`: an algorithm's parameters, found on a series of known truth, proven on real images."""

import argparse
import sys
from pathlib import Path
from typing import Any

from interchange.problems import BrightfieldError, FileError, Problem, Where

HELP = "find an algorithm's parameters on a series of known truth, predict real images, then score them"


def configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "series", type=Path, metavar="SERIES", help="captures.json, or a folder that brightfield sweep wrote"
    )
    parser.add_argument(
        "--algorithm",
        required=True,
        metavar="NAME",
        help="canny, subpixel-edges, threshold-blobs, circle-gauge, line-gauge, template-match, or your own as "
        "module:function",
    )
    truth = parser.add_argument_group("what is true")
    truth.add_argument("--features", type=Path, metavar="YAML", help="edges, blobs, lines, circles, patterns")
    truth.add_argument(
        "--of", action="append", default=[], metavar="BODY",
        help="in place of --features: this body's CAD edges, or for blobs its region; may be repeated",
    )  # fmt: skip
    truth.add_argument(
        "--real", type=Path, metavar="CAPTURES.json", help="real images to be predicted, then scored"
    )
    search = parser.add_argument_group("the search")
    search.add_argument(
        "--objective", action="append", default=[], metavar="MEASURE",
        help="f1, precision, recall, position, edge_pixels, line_distance, size, overlap, false_rejects or "
        "false_accepts; repeated, it gives a Pareto front (default: f1, for gauges position)",
    )  # fmt: skip
    search.add_argument("--trials", type=int, default=100, metavar="N", help="(default %(default)s)")
    search.add_argument("--seed", type=int, default=0, metavar="N", help="(default %(default)s)")
    search.add_argument(
        "--bound",
        action="append",
        default=[],
        metavar="NAME=LOW:HIGH",
        help="narrower than declared; NAME=X holds it",
    )
    search.add_argument(
        "--holdout", type=float, default=0.35, metavar="SHARE",
        help="frames that nothing is tuned on and that predictions come from (default %(default)s)",
    )  # fmt: skip
    search.add_argument(
        "--worst", type=float, default=1.0, metavar="SHARE",
        help="optimise the mean over this share of the frames, the worst ones (default: all)",
    )  # fmt: skip
    search.add_argument(
        "--coverage",
        type=float,
        default=0.9,
        metavar="P",
        help="of a prediction's interval (default %(default)s)",
    )
    judged = parser.add_argument_group("how results are judged")
    judged.add_argument(
        "--roi",
        type=float,
        default=8.0,
        metavar="PX",
        help="half the width of regions of interest (default %(default)s)",
    )
    judged.add_argument(
        "--reach",
        type=float,
        default=2.0,
        metavar="PX",
        help="what counts as the same edge (default %(default)s)",
    )
    judged.add_argument(
        "--tolerance", type=float, default=0.5, metavar="PX",
        help="error at which a gauge rejects a good feature (default %(default)s)",
    )  # fmt: skip
    judged.add_argument(
        "--placement", type=float, default=1.5, metavar="PX",
        help="rms by which gauges are put down off their feature (default %(default)s)",
    )  # fmt: skip
    parser.add_argument("--out", type=Path, required=True, metavar="DIR")


def run(args: argparse.Namespace) -> int:
    from analysis.tune import record
    from analysis.tune.algorithms import algorithm
    from analysis.tune.plots import write_plots
    from analysis.tune.prediction import Prediction
    from analysis.tune.reading import read_series
    from analysis.tune.scores import MEASURES, Rules
    from analysis.tune.search import Tuning
    from analysis.tune.session import Session
    from analysis.tune.session import run as tuned
    from realtime.renderers.rasterizer import Rasterizer

    _check(args)
    model = algorithm(args.algorithm)
    wanted = _wanted(args, model.finds.__name__)
    bounds = dict(_bound(word) for word in args.bound)
    rules = Rules(args.roi, args.reach, args.tolerance, args.placement, args.seed)
    args.out.mkdir(parents=True, exist_ok=True)
    for stale in ("prediction.json", "verification.json"):
        (args.out / stale).unlink(missing_ok=True)

    def stated(tuning: Tuning, predictions: list[Prediction]) -> None:
        path = record.write_prediction(args.out, tuning, predictions)
        _clear()
        values = ", ".join(f"{n} {v:.4g}" for n, v in tuning.trials[tuning.chosen].parameters.items())
        print(f"{record.algorithm_name(tuning)}: {values}")
        if args.real is not None:
            print(f"Stated for one real image, before any is scored ({path}):")
            for p in predictions:
                unit = "" if MEASURES[p.measure].unit == "1" else f" {MEASURES[p.measure].unit}"
                print(
                    f"  {p.measure:14} {p.median:.4g}{unit}, {100 * p.coverage:.0f} %: {p.low:.4g} to {p.high:.4g}"
                )

    with Rasterizer() as renderer:
        frames = read_series(args.series, wanted, renderer)
        session: Session = tuned(
            model, frames, args.objective, rules, args.trials, args.seed, args.holdout, args.worst, bounds,
            real=None if args.real is None else lambda: read_series(args.real, wanted, renderer),
            coverage=args.coverage, registration=_registration(args.real), stated=stated, told=_told,
            keep=args.out / "trials.jsonl",
        )  # fmt: skip
    record.write_tuning(args.out, session, {"series": str(args.series), "seed": args.seed})
    if session.real_frames:
        record.write_verification(args.out, session)
    write_plots(args.out, session)
    _print(session)
    print(f"Written to {args.out}.")
    return 0


def _check(args: argparse.Namespace) -> None:
    for name, low in (("trials", 1), ("roi", 0), ("reach", 0), ("tolerance", 0), ("placement", -1e-12)):
        value = getattr(args, name)
        if not value > low and not (name == "trials" and value >= 1):
            raise BrightfieldError(
                f"--{name} must be {'1 or more' if name == 'trials' else 'above 0'}; got {value:g}."
            )
    if not 0 < args.coverage < 1:
        raise BrightfieldError(f"--coverage must lie between 0 and 1; got {args.coverage:g}.")
    if bool(args.of) == (args.features is not None):
        raise BrightfieldError("What is true must be told by --features or by --of, one of them.")


def _wanted(args: argparse.Namespace, finds: str) -> Any:
    from analysis.tune import features

    if args.features is not None:
        wanted = features.read(args.features)
    elif finds in ("Edges", "Blobs"):
        wanted = features.parse({"edges" if finds == "Edges" else "blobs": args.of})
    else:
        raise BrightfieldError(f"A {finds.lower()} must be told by --features; --of names edges and blobs.")
    needed = {"Edges": "edges", "Blobs": "blobs", "Circle": "circles", "Line": "lines", "Place": "patterns"}[
        finds
    ]
    if not getattr(wanted, needed):
        raise BrightfieldError(f"{args.algorithm} must have {needed} to be scored by. ({args.features})")
    return wanted


def _registration(real: Path | None) -> float:
    """px, rms: how well the file of real images says that their truth is known."""
    import json

    from interchange.captures import Tolerances

    if real is None:
        return 0.0
    file = real / "captures.json" if real.is_dir() else real
    try:
        head = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise FileError(
            Problem(f"The file of real images cannot be read: {error}", Where(str(file)))
        ) from None
    given = head.get("tolerances", {}).get("registration_px", Tolerances().registration_px)
    return Tolerances(registration_px=given).registration_px


def _bound(word: str) -> tuple[str, tuple[float, float]]:
    name, _, values = word.partition("=")
    low, colon, high = values.partition(":")
    try:
        return name, (float(low), float(high if colon else low))
    except ValueError:
        raise BrightfieldError(f"--bound must be NAME=LOW:HIGH or NAME=X; got {word}.") from None


def _print(session: Any) -> None:
    from analysis.tune.scores import MEASURES, measures_of

    t = session.tuning
    if t.resumed:
        print(f"{t.resumed} trials were there already.")
    real = bool(session.real_frames)
    rows: list[tuple[str, ...]] = [
        ("", "unit", "defaults", "tuned on", "held out", *(("stated", "real", "inside") if real else ()))
    ]
    stated = {p.measure: p for p in session.predictions}
    for m in measures_of(t.algorithm.finds):
        means = [session.mean(m, session.held_out, default=True)]
        means += [session.mean(m, which) for which in (session.tuned_on, session.held_out)]
        row = [m, MEASURES[m].unit, *(_number(v) for v in means)]
        if real:
            p = stated.get(m)
            row += [f"{p.low:.3g} .. {p.high:.3g}" if p else "", _number(_mean(session.real_scores[m]))]
            row.append(f"{100 * session.verified.share[m]:.0f} %" if p and session.verified else "")
        rows.append(tuple(row))
    wide = [max(len(r[k]) for r in rows) for k in range(len(rows[0]))]
    for told in rows:
        cells = zip(told, wide, strict=True)
        print("  ".join(f"{v:>{w}}" if k else f"{v:{w}}" for k, (v, w) in enumerate(cells)))
    if session.dependence:
        name, value = next(iter(session.dependence.items()))
        print(f"{t.objectives[0]} depends most on {name} (rank correlation {value:+.2f}).")


def _mean(values: Any) -> float:
    known = [float(v) for v in values if v == v]
    return sum(known) / len(known) if known else float("nan")


def _number(value: float) -> str:
    return f"{value:.4g}" if value == value else "-"


def _told(done: int, total: int) -> None:
    if sys.stderr.isatty():
        print(f"\rtrial {done}/{total}\033[K", end="", file=sys.stderr, flush=True)


def _clear() -> None:
    if sys.stderr.isatty():
        print("\r\033[K", end="", file=sys.stderr)
