"""A fit as data: what was measured, how it was fitted, what came out, with the versions that made it."""

import hashlib
import importlib.metadata
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from analysis.fit.fit import METRICS, Fit, metric_of
from analysis.fit.rank import Ranked
from interchange.brdf.base import Brdf
from interchange.brdf.sum import Sum
from interchange.parameter import parameters
from interchange.reflectance import ReflectanceSamples

PACKAGES = ("brightfield", "numpy", "scipy")


def record(
    fit: Fit, measured: ReflectanceSamples, command: str, ranked: Sequence[Ranked] = ()
) -> dict[str, Any]:
    """JSON-ready. ``measured``: the samples before masks and bands. Numbers that do not exist are None."""
    options = fit.options
    return _finite(
        {
            "measurement": provenance(fit, measured),
            "command": command,
            "versions": {name: _version(name) for name in PACKAGES},
            "options": {
                "weighting": options.weighting,
                "compared_by": metric_of(options.weighting),
                "folds": options.folds,
                "held_out": list(fit.folds.labels),
                "per_channel": options.per_channel,
                "fixed": dict(options.fixed),
                "isotropic": fit.isotropic,
                "seed": options.seed,
            },
            "model": described(fit.brdf),
            "estimates": [
                {
                    "name": e.name,
                    "value": e.value,
                    "sigma": e.sigma,
                    "interval_95": [e.low, e.high],
                    "at_bound": e.bound or None,
                    "sigma_over_folds": fit.jackknife.get(e.name),
                }
                for e in fit.estimates
            ],
            "correlation": {"names": [e.name for e in fit.estimates], "matrix": fit.correlation.tolist()},
            "errors": {"rms": fit.errors.rms, "share_of_rms": fit.errors.share},
            "held_out_errors": {
                "rms": fit.held_out.rms,
                "share_of_rms": fit.held_out.share,
                "by_fold": fit.held_out.by_fold,
                "foretold": foretold(fit),
            },
            "lobes_tried": {str(k): v for k, v in fit.tried.items()},
            "chi2_per_degree_of_freedom": fit.chi2,
            "warnings": list(fit.warnings),
            "finished": fit.finished,
            "seconds": round(fit.seconds, 3),
            "ranking": [ranked_row(r) for r in ranked],
        }
    )


def provenance(fit: Fit, measured: ReflectanceSamples) -> dict[str, Any]:
    """File, its SHA-256, and what became of its samples."""
    file = Path(measured.file)
    digest = ""
    if file.is_file():
        with file.open("rb") as stream:
            digest = hashlib.file_digest(stream, "sha256").hexdigest()
    below = (measured.wi[:, 2] <= 0) | (measured.wo[:, 2] <= 0)
    return {
        "file": file.name,
        "sha256": digest,
        "samples": len(measured),
        "used": len(fit.samples),
        "masked": int((~measured.use).sum()),
        "not_finite": int((~np.isfinite(measured.f).all(axis=1)).sum()),
        "below_the_surface": int(below.sum()),
        "columns": list(measured.channels),
        "bands": list(fit.samples.channels),
        "negative": {
            name: int(n) for name, n in zip(fit.samples.channels, fit.samples.negatives, strict=True)
        },
        "zero": {
            n: int(z) for n, z in zip(fit.samples.channels, (fit.samples.f == 0).sum(axis=0), strict=True)
        },
        "sigma": fit.samples.sigma is not None,
        "notes": [str(n) for n in measured.notes],
    }


def described(brdf: Brdf) -> dict[str, Any]:
    if isinstance(brdf, Sum):
        parts = [described(part) for part in brdf.parts]
        return {"name": "Sum", "source": brdf.source, "weight": brdf.weight, "parts": parts}
    values = {name: getattr(brdf, name) for name in parameters(brdf)}
    return {"name": type(brdf).__name__, "source": brdf.source, "parameters": values}


def foretold(fit: Fit) -> dict[str, float]:
    """Medians and 90th percentiles of |foretold - measured| / measured over held-out readings above the noise floor."""
    f = np.broadcast_to(fit.samples.f, fit.held.shape)
    bright = f > 0.05 * np.median(np.abs(f.mean(axis=1)))
    off = np.abs(fit.held - f)[bright] / f[bright]
    return {
        "median": float(np.median(off)),
        "p90": float(np.percentile(off, 90)),
        "readings": int(bright.sum()),
    }


def ranked_row(ranked: Ranked) -> dict[str, Any]:
    if ranked.fit is None:
        return {"model": ranked.model, "error": ranked.reason}
    found = ranked.fit
    return {
        "model": ranked.model,
        "lobes": found.lobes,
        "unknowns": found.unknowns,
        "held_out": {m: found.held_out.rms[m] for m in METRICS},
        "fitted": {m: found.errors.rms[m] for m in METRICS},
        "foretold_median": foretold(found)["median"],
        "finished": found.finished,
        "seconds": round(found.seconds, 3),
        "warnings": len(found.warnings),
    }


def _version(name: str) -> str:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return "source"


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _finite(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(v) for v in value]
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    return value
