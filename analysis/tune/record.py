"""What a tuning writes: tune.json, trials.csv, prediction.json (before real images are scored), verification.json."""

import csv
import io
import json
import math
import os
from collections.abc import Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from analysis.tune.prediction import Prediction
from analysis.tune.scores import MEASURES, measures_of
from analysis.tune.search import Tuning
from analysis.tune.session import Session
from interchange.formats.atomic import written_beside


def write_prediction(folder: Path, tuning: Tuning, predictions: Sequence[Prediction]) -> Path:
    """``prediction.json``: parameters and intervals, and when it was stated."""
    return write_json(
        folder / "prediction.json",
        {
            "stated": datetime.now(UTC).isoformat(timespec="milliseconds"),
            "algorithm": algorithm_name(tuning),
            "parameters": tuning.trials[tuning.chosen].parameters,
            "of_one_real_image": [asdict(p) | {"unit": MEASURES[p.measure].unit} for p in predictions],
        },
    )


def write_verification(folder: Path, session: Session) -> Path:
    """``verification.json``: scores of the real images beside their predictions."""
    about = []
    for p in session.predictions:
        real = session.real_scores[p.measure]
        about.append(
            {
                **asdict(p),
                "unit": MEASURES[p.measure].unit,
                "real": dict(zip([f.name for f in session.real_frames], real, strict=True)),
                "real_mean": float(np.nanmean(real)) if np.isfinite(real).any() else None,
                "real_mean_with_defaults": float(np.nanmean(session.real_default[p.measure]))
                if np.isfinite(session.real_default[p.measure]).any()
                else None,
                "inside": session.verified.share[p.measure] if session.verified else None,
            }
        )
    scored = datetime.now(UTC).isoformat(timespec="milliseconds")
    return write_json(folder / "verification.json", {"scored": scored, "measures": about})


def write_tuning(folder: Path, session: Session, made_with: dict[str, Any]) -> Path:
    """``tune.json`` and ``trials.csv``."""
    t = session.tuning
    columns = [*t.bounds, *(f"objective {o}" for o in t.objectives), *measures_of(t.algorithm.finds)]
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(["trial", *columns])
    for i, trial in enumerate(t.trials):
        table.writerow([i, *trial.parameters.values(), *trial.values, *trial.scores.values()])
    write_text(folder / "trials.csv", text.getvalue())
    names = [f.name for f in session.frames]
    measures = measures_of(t.algorithm.finds)
    return write_json(
        folder / "tune.json",
        {
            "algorithm": algorithm_name(t),
            "source": t.algorithm.source,
            "objectives": {o: MEASURES[o].best for o in t.objectives},
            "parameters": t.trials[t.chosen].parameters,
            "defaults": t.trials[0].parameters,
            "bounds": {n: [b.low, b.high] for n, b in t.bounds.items()},
            "units": {n: b.unit for n, b in t.bounds.items()},
            "trials": len(t.trials),
            "front": [
                {"trial": i, "parameters": t.trials[i].parameters, "values": t.trials[i].values}
                for i in t.front
            ],
            "scores": {
                m: {
                    "unit": MEASURES[m].unit,
                    "tuned_on": session.mean(m, session.tuned_on),
                    "held_out": session.mean(m, session.held_out),
                    "held_out_with_defaults": session.mean(m, session.held_out, default=True),
                }
                for m in measures
            },
            "plateaus": {s.parameter: list(s.plateau) for s in session.slices},
            "dependence": session.dependence,
            "held_out": [names[i] for i in session.held_out],
            "frames": {
                n: {**{m: float(session.scores[m][i]) for m in measures}, **session.frames[i].variation}
                for i, n in enumerate(names)
            },
            **made_with,
        },
    )


def algorithm_name(tuning: Tuning) -> str:
    own = tuning.algorithm
    inside = own.__module__.startswith("analysis.tune.algorithms.")
    return own.__module__.rsplit(".", 1)[-1].replace("_", "-") if inside else own.source or own.__name__


def write_json(path: Path, data: Any) -> Path:
    """Beside and renamed; a number that there is not is null."""
    return write_text(path, json.dumps(_finite(data), indent=1, allow_nan=False, ensure_ascii=False) + "\n")


def write_text(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = written_beside(path)
    beside.write_text(text, encoding="utf-8")
    os.replace(beside, path)
    return path


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(k): _finite(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(v) for v in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value
