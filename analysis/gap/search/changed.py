"""What a cause changes in a condition, where it stands."""

import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.search.model import Model
from analysis.gap.terms.base import added
from analysis.gap.terms.form import Changed, displaced


def changed_in(condition: Condition, model: Model, index: np.ndarray, stride: int) -> Changed:
    """Of the cause whose terms are ``index`` (k,), on every ``stride``-th pixel of a condition."""
    state, without = model.state(condition, stride), model.without(index)
    own = [model.terms[i] for i in index]
    change = added(state, own, (model.theta - model.at)[index])
    moved, bend = {}, None
    if model.at[index].any():
        whole = state.simulation.dn - without.state(condition).simulation.dn
        there = state.take(whole)
        change = change + there
        if any(t.kind != "flow" for t in own):  # what moves the image stands there without its cause as well
            bend = np.asarray(there - added(state, own, model.at[index]), np.float32)
        if any(t.kind == "chain" for t in own):
            moved = {word: state.take(plane) for word, plane in displaced(whole).items()}
    return Changed(np.asarray(change, np.float32), moved, bend)
