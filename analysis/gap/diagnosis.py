"""The diagnosis as data: what ``diagnosis.json`` says (file contract, part 3)."""

import json
import os
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from analysis.gap.finding import Finding, stage_of
from analysis.gap.judgement.detectable import Detectable
from analysis.gap.judgement.rehearsal import Rehearsal
from analysis.gap.judgement.verify import Verification
from analysis.gap.measures.edges import Edges
from analysis.gap.measures.ledger import Ledger
from analysis.gap.measures.metric import Metric
from analysis.gap.measures.shapley import Step
from analysis.gap.measures.shrinkage import Gap
from analysis.gap.measures.structure import STEPS, Structure


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """``unknown``: the generic families that the evidence asks for, in words, with their probabilities.

    ``notes``: what limits the diagnosis, one sentence each. ``waterfall``: mean χ² from the scene file as written down
    to noise; its steps add up to ``gap.as_written``². ``edges`` None: no edge could be measured. ``smallest``: of each
    effect, what would have been found. ``over_declared``: how large a tolerance looks over what is declared, of those
    that do not look as declared. ``rehearsal``: of cases that were simulated, what probabilities are calibrated on.
    ``left``: whether what is left away from edges has structure, where there is enough of that to tell.
    """

    effects: tuple[Finding, ...]
    unknown: tuple[tuple[str, float], ...]
    gap: Gap
    where: Ledger
    corrected_scene: str
    seconds: float
    notes: tuple[str, ...] = ()
    waterfall: tuple[Step, ...] = ()
    edges: Edges | None = None
    metric: Metric | None = None
    verification: Verification | None = None
    smallest: tuple[Detectable, ...] = ()
    over_declared: dict[str, float] = field(default_factory=dict)
    rehearsal: Rehearsal | None = None
    left: Structure | None = None

    @property
    def verdict(self) -> str:
        words = [w for w, there in (("effects", self.effects), ("unknown", self.unknown)) if there]
        return "+".join(words) or "none"


def record(d: Diagnosis) -> dict[str, Any]:
    """What ``diagnosis.json`` holds: the contract's keys, and behind them those that it leaves to us: ``share`` of an
    effect, ``gap.as_written`` (the scene file rendered as it is), ``unknown`` (what is not in the catalogue, in words),
    ``waterfall``, ``edges``, ``metric``, ``verified``, ``smallest`` (severity that an effect would be found from,
    ``easiest`` and ``hardest``; null: never), ``tolerances_over_declared``, ``rehearsal``, ``left`` (of σ², away from
    edges), ``notes``."""
    g = d.gap
    return {
        "verdict": d.verdict,
        "effects": [
            {
                "name": f.name,
                "stage": stage_of(f.name),
                "probability": f.probability,
                "parameters": {
                    n: {"value": p.value, "sigma": p.sigma, "unit": p.unit} for n, p in f.parameters.items()
                },
                "rivals": [{"name": n, "probability": p} for n, p in f.rivals],
                "separate_by": f.separate_by,
                "gap_without": f.gap_without,
                "gap_with": f.gap_with,
                "share": f.share,
            }
            for f in d.effects
        ],
        "gap": {
            "unit": "chi",
            "before": g.before,
            "after": g.after,
            "noise_floor": g.noise_floor,
            "ci95_before": list(g.ci95_before),
            "ci95_after": list(g.ci95_after),
            "rmse_dn_before": g.rmse_dn_before,
            "rmse_dn_after": g.rmse_dn_after,
            "explained": g.explained,
            "held_out": list(g.held_out),
            "as_written": g.as_written,
            "rmse_dn_as_written": g.rmse_dn_as_written,
        },
        "where": {
            "total": d.where.total,
            "by_region": [{"kind": s.kind, "name": s.name, "share": s.share} for s in d.where.shares],
        },
        "corrected_scene": d.corrected_scene,
        "seconds": d.seconds,
        "unknown": [{"name": words, "probability": p} for words, p in d.unknown],
        "waterfall": [{"name": s.name, "kind": s.kind, "chi2": s.chi2} for s in d.waterfall],
        "edges": _edges(d.edges) if d.edges else None,
        "metric": _metric(d.metric) if d.metric else None,
        "verified": {**asdict(d.verification), "holds": d.verification.holds} if d.verification else None,
        "smallest": {
            x.cause[0]: {
                k: v if np.isfinite(v) else None for k, v in (("easiest", x.easiest), ("hardest", x.hardest))
            }
            for x in d.smallest
        },
        "tolerances_over_declared": d.over_declared,
        "rehearsal": _rehearsal(d.rehearsal) if d.rehearsal else None,
        "left": _left(d.left) if d.left else None,
        "notes": list(d.notes),
    }


def _edges(e: Edges) -> dict[str, Any]:
    return {
        "unit": "px",
        **{which: {"mean": o.mean, "rms": o.rms} for which, o in vars(e).items()},
        "noise_floor": e.after.floor,
        "count": e.after.count,
    }


def _rehearsal(r: Rehearsal) -> dict[str, Any]:
    return {"temperature": r.temperature, "cases": [asdict(c) for c in r.cases]}


def _left(s: Structure) -> dict[str, Any]:
    near = {f"{d} px": x for d, x in zip(STEPS, s.near, strict=True)}
    return {"white": s.white, "structure": near, "expected": s.expected}


def _metric(m: Metric) -> dict[str, Any]:
    return {
        "name": m.name,
        **{f"error_{which}": m.error(which) for which in ("as_written", "before", "after")},
        "readings": [asdict(r) for r in m.readings],
    }


def write(path: Path, d: Diagnosis) -> None:
    write_text(path, json.dumps(record(d), indent=1, allow_nan=False) + "\n")


def write_text(path: Path, text: str) -> None:
    """Beside its place, and renamed there."""
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    beside.write_text(text, encoding="utf-8")
    os.replace(beside, path)
