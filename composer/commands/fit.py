"""`brightfield fit MEASUREMENT --brdf NAME`: a measured material becomes a model, its uncertainties and a report."""

import argparse
import json
import os
import shlex
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from interchange.problems import BrightfieldError

HELP = "fit a reflectance model to a measured BRDF: parameters, uncertainties, material, report"


def configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "measurement", metavar="MEASUREMENT", help="a BRDF: goniometer table, MERL, UTIA, RGL"
    )
    parser.add_argument(
        "--brdf", required=True, metavar="NAME", help="a model of the catalogue: lafortune, ggx, ward"
    )
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="write fit.json, material.usda and report.html"
    )
    parser.add_argument("--json", action="store_true", help="print fit.json instead of a summary")
    how = parser.add_argument_group("how it is fitted")
    how.add_argument(
        "--weight",
        default="auto",
        metavar="NAME",
        help="what is minimised: sigma (chi squared; the default where the file gives σ), log (of ln f; the default "
        "elsewhere), relative (differences over the fitted f: no bias where readings are noisy), cosine (of the "
        "radiance, as Ngan et al. 2005), mse (of f itself)",
    )
    how.add_argument(
        "--lobes", type=int, default=0, metavar="N", help="lobes; without it as many as foretell best, to 3"
    )
    how.add_argument(
        "--per-channel", action="store_true", help="fit every channel alone, with a shape of its own"
    )
    how.add_argument(
        "--fix", nargs="+", default=[], metavar="NAME=VALUE", help="parameters that are not fitted"
    )
    direction = how.add_mutually_exclusive_group()
    direction.add_argument(
        "--isotropic", action="store_true", help="whatever the samples' azimuths could tell"
    )
    direction.add_argument("--anisotropic", action="store_true", help="even where the lamp did not go round")
    how.add_argument("--seed", type=int, default=0, help="start of the random numbers (starts, subsets)")
    held = parser.add_argument_group("what is held out and what is left out")
    held.add_argument(
        "--folds", choices=("incidence", "random"), default="incidence", help="what is left out in turn"
    )
    held.add_argument(
        "--max-angle",
        type=float,
        default=80.0,
        metavar="DEG",
        help="leave out directions beyond (default 80)",
    )
    held.add_argument(
        "--min-retro",
        type=float,
        default=0.0,
        metavar="DEG",
        help="leave out camera nearer to the lamp (default 0)",
    )
    held.add_argument(
        "--samples",
        type=int,
        default=20000,
        metavar="N",
        help="draw so many from a larger file (default 20000)",
    )
    ranks = parser.add_argument_group("which model would be best")
    ranks.add_argument("--rank", action="store_true", help="fit every model of the catalogue and rank them")
    ranks.add_argument(
        "--seconds", type=float, default=60.0, help="for each model of the ranking (default 60)"
    )


def run(args: argparse.Namespace) -> int:
    from analysis.fit.fit import Options, fit, model_of
    from analysis.fit.rank import Ranked, rank
    from analysis.fit.record import record
    from interchange.formats.document import open_file
    from interchange.measurement import Measurement
    from interchange.reflectance import ReflectanceSamples

    model = model_of(args.brdf)
    if args.samples < 1 or args.lobes < 0 or args.seconds <= 0:
        raise BrightfieldError("--samples, --lobes and --seconds must be positive.")
    if not 0 < args.max_angle <= 90 or not 0 <= args.min_retro < 90:
        raise BrightfieldError("--max-angle must lie in (0, 90] degrees and --min-retro in [0, 90).")
    found = open_file(args.measurement)
    if not isinstance(found, Measurement):
        raise BrightfieldError(f"A measured BRDF was expected; this file holds none. ({args.measurement})")
    measured = ReflectanceSamples.from_measurement(found).trusted(
        float(np.radians(args.max_angle)), float(np.radians(args.min_retro))
    )
    options = Options(
        weighting=args.weight,
        lobes=args.lobes,
        per_channel=args.per_channel,
        isotropic=True if args.isotropic else False if args.anisotropic else None,
        fixed=_fixed(args.fix),
        folds=args.folds,
        seed=args.seed,
    )
    few = measured
    if int(measured.usable.sum()) > args.samples:
        few = measured.subsample(np.random.default_rng(args.seed), args.samples)
    result = fit(few, model, options)
    ranked: list[Ranked] = []
    if args.rank:
        ranked = rank(few, replace(options, per_channel=False), seconds=args.seconds, told=_progress)
    command = shlex.join(["brightfield", "fit", *_given(args)])
    made = record(result, measured, command, ranked)
    if args.out is not None:
        from analysis.fit.material import write_material
        from analysis.fit.report import report

        page = report(result, made, ranked, getattr(found, "model", None))
        args.out.mkdir(parents=True, exist_ok=True)
        _write(args.out / "fit.json", json.dumps(made, indent=1, ensure_ascii=False) + "\n")
        write_material(args.out / "material.usda", Path(args.measurement).stem, result.brdf)
        _write(args.out / "report.html", page)
    if args.json:
        print(json.dumps(made, indent=1, ensure_ascii=False))
    else:
        print("\n".join(summary(made)))
        if args.out is not None:
            print(f"\nWritten to {args.out}: report.html, material.usda, fit.json")
    return 0


def summary(made: dict[str, Any]) -> list[str]:
    """A record as lines for a terminal."""
    m, told = made["measurement"], made["held_out_errors"]["foretold"]
    lines = [f"{made['model']['name']} fitted to {m['file']}: {m['used']} of {m['samples']} samples"]
    lines += [f"  minimised: {made['options']['weighting']}", ""]
    width = max((len(e["name"]) for e in made["estimates"]), default=0)
    for e in made["estimates"]:
        low, high = e["interval_95"]
        spread = f"at its {e['at_bound']} bound" if e["at_bound"] else f"[{low:.4g}, {high:.4g}]"
        if e["sigma"] is None and not e["at_bound"]:
            spread = "not told by the samples"
        lines.append(f"  {e['name']:{width}}  {e['value']:<10.4g} {spread}")
    lines += ["", f"Held out ({', '.join(made['options']['held_out'])}), rms; fitted in brackets:"]
    fitted, held = made["errors"]["rms"], made["held_out_errors"]["rms"]
    for metric, unit in (("mse", "1/sr, of f"), ("cosine", "1/sr, of f cos"), ("log", "of ln f")):
        lines.append(f"  {held[metric]:<8.3g} ({fitted[metric]:.3g}) {unit}")
    lines.append(f"  half of the held-out readings are foretold within {100 * told['median']:.0f} %")
    if made["warnings"]:
        lines += ["", "Beware:", *(f"  {w}" for w in made["warnings"])]
    if made["ranking"]:
        lines += ["", "All models by held-out error:"]
        for r in made["ranking"]:
            name = f"{r['model']} ({r['lobes']})" if r.get("lobes") else r["model"]
            error = r.get("error") or f"{r['held_out'][made['options']['compared_by']]:.3g}"
            lines.append(f"  {name:28} {error}")
    return lines


def _progress(name: str, done: int, total: int) -> None:
    print(f"{done + 1}/{total} {name}", file=sys.stderr, flush=True)


def _fixed(words: Sequence[str]) -> dict[str, float]:
    fixed = {}
    for word in words:
        name, _, value = word.partition("=")
        try:
            fixed[name] = float(value)
        except ValueError:
            raise BrightfieldError(f"--fix must be NAME=NUMBER, k=0 say; got {word}.") from None
    return fixed


def _given(args: argparse.Namespace) -> list[str]:
    """The command line as it was typed, where it was; else what the options say."""
    words = sys.argv[2:] if sys.argv[1:2] == ["fit"] else [args.measurement, "--brdf", args.brdf]
    return [str(w) for w in words]


def _write(path: Path, text: str) -> None:
    from interchange.formats.atomic import written_beside

    beside = written_beside(path)
    try:
        beside.write_text(text, encoding="utf-8")
        os.replace(beside, path)
    finally:
        beside.unlink(missing_ok=True)
