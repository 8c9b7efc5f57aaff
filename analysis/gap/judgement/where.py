"""Where the gap lies: the ledger, with what it is fixed to, and edges that are off."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.evidence.likelihood import Evidence
from analysis.gap.judgement.verdict import Simulations
from analysis.gap.measures.edges import Edges, offsets
from analysis.gap.measures.ledger import Ledger, fixed_to, ledger
from analysis.gap.measures.shrinkage import Yardstick
from analysis.gap.parallel import each
from analysis.gap.search.fit import Fit
from analysis.gap.search.model import Model
from analysis.gap.terms.base import Term
from analysis.gap.terms.normal_equations import NormalEquations, equations, stride_for, total_of


def edge_offsets(held: Sequence[Condition], by: Yardstick, shown: Simulations) -> Edges | None:
    """How far edges are off in the simulations of the held-out conditions; None where none can be told."""
    regions, noise = [], []
    for c in held:
        ids = c.shown.passes
        regions.append(ids["object_id"].astype(np.int64) * 100000 + ids["material_id"])
        model = c.simulated()
        variance = (model.temporal / len(c.captures) + model.fixed).sum(axis=2)
        noise.append(np.sqrt(variance) / model.dn.shape[2])
    found = offsets(
        [c.mean for c in held],
        [shown.as_written, shown.before, shown.after],
        regions,
        [ok.any(axis=2) for ok in by.ok],
        noise,
    )
    return Edges(*found) if found else None


def ledger_of(found: Sequence[Condition], fitted: Fit, after: Sequence[np.ndarray]) -> Ledger:
    """Where the gap of the file at its best lies, and what ``after``, (H, W, C) DN of each condition, leaves."""
    before = fitted.before.simulations(found)
    families = {
        "the image": ("fixed to the image, multiplicative", "fixed to the image, additive", "exposure"),
        "the surface": ("fixed to the surface", "albedo"),
        "the lamp": ("fixed to the lamp", "light_intensity"),
    }
    index: dict[str, list[int]] = {}
    own: list[Term] = []
    for name, causes in families.items():
        chosen = [t for t in fitted.terms if t.cause in causes]
        index[name] = list(range(len(own), len(own) + len(chosen)))
        own += chosen
    zero, stride = np.zeros(len(own)), stride_for(found)
    model = Model(tuple(own), zero, zero)

    def part(both: tuple[Condition, np.ndarray]) -> NormalEquations | None:
        c, dn = both
        left = replace(c, mean=c.mean - dn + c.simulated().dn)  # what is to be told apart is before's gap
        state = model.state(left, stride)
        return equations(state, own, zero) if state.usable.any() else None

    fitted_to = [(c, dn) for c, dn in zip(found, before, strict=True) if not c.held_out]
    total = total_of([p for p in each(part, fitted_to) if p is not None])
    evidence = Evidence(total, own)
    seen = {name: np.array([i for i in places if evidence.seen[i]], int) for name, places in index.items()}
    fixed = fixed_to(seen, total.G, total.b, total.rr, evidence.spike)
    return ledger(found, before, after, fixed)
