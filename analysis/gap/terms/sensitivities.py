"""What a unit of every term adds to each value of one condition, and when that must be drawn anew.

Where a model stands a little elsewhere, sensitivities change by as little, and what that changes in an image is a
product of two small numbers: all but those of the terms that stand elsewhere are kept.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from analysis.gap.compared.state import State
from analysis.gap.terms.base import Family, Term, families

# rms over the signal's; px: a model that stands further away has sensitivities of its own
BRIGHTER, AWAY = 0.03, 0.1


@dataclass(frozen=True, eq=False)
class Sensitivities:
    """``columns``: (n,) float32 of each of the terms ``few``, row by row of the ``n`` usable values, which stands share
    as far as they are the same; ``cells`` (m, n) of the terms ``many``, which belong to families. ``signal`` (h, w, C)
    DN and ``flow``: of the state that they are from."""

    columns: tuple[np.ndarray, ...]
    n: int
    cells: sparse.csr_array | None
    few: np.ndarray
    many: np.ndarray
    signal: np.ndarray
    flow: np.ndarray | None

    def near(self, state: State) -> bool:
        """Whether they hold for ``state`` too."""
        off = float(np.sqrt(np.mean((state.signal - self.signal) ** 2) / max(np.mean(self.signal**2), 1e-30)))
        a, b = (np.zeros(1) if f is None else f for f in (self.flow, state.flow))
        return off < BRIGHTER and float(np.abs(a - b).max()) < AWAY

    def of(self, index: np.ndarray) -> "Sensitivities":
        """Of these of the terms alone, which count from zero then."""
        place = np.full(len(self.few) + len(self.many), -1)
        place[index] = np.arange(len(index))
        rows, cells = place[self.few] >= 0, place[self.many] >= 0
        return replace(
            self,
            columns=tuple(self.columns[i] for i in np.flatnonzero(rows)),
            cells=self.cells[cells] if self.cells is not None and cells.any() else None,
            few=place[self.few[rows]],
            many=place[self.many[cells]],
        )

    def and_also(self, state: State, terms: Sequence[Term]) -> "Sensitivities":
        """With further ones, which count after all others."""
        if not terms:
            return self
        first = len(self.few) + len(self.many)
        columns = (*self.columns, *drawn(state, terms))
        return replace(self, columns=columns, few=np.append(self.few, np.arange(first, first + len(terms))))


def sensitivities(
    state: State,
    terms: Sequence[Term],
    kept: Sensitivities | None = None,
    anew: Collection[int] = (),
) -> Sensitivities:
    """``kept``: what the same terms had where the model stood before. If that is near, those of ``anew`` alone are
    drawn; it is ``kept`` itself where there are none."""
    found = families(terms)
    few = np.array([i for i, t in enumerate(terms) if t.family is None], int)
    if kept is None or not kept.near(state):
        many = np.concatenate([index for _, index in found]) if found else np.array([], int)
        columns = drawn(state, [terms[i] for i in few])
        n = columns.shape[1]
        return Sensitivities(tuple(columns), n, _cells(state, found), few, many, state.signal, state.flow)
    rows = [row for row, i in enumerate(few) if i in anew]
    if not rows:
        return kept
    own = list(kept.columns)
    for row, column in zip(rows, drawn(state, [terms[few[row]] for row in rows]), strict=True):
        own[row] = column
    return replace(kept, columns=tuple(own))


def drawn(state: State, terms: Sequence[Term]) -> np.ndarray:
    """(k, n) float32: what a unit of each term adds to the ``n`` usable values, row by row of ``state``'s pixels."""
    mask = state.usable
    out = np.zeros((len(terms), int(mask.sum()) * state.condition.mean.shape[2]), np.float32)
    own: dict[int, np.ndarray] = {}  # of fields that terms share
    for row, term in zip(out, terms, strict=True):
        if not term.shown(state):
            continue
        key = id(term.field)
        if key not in own:
            column = term.column(state)
            if column is not None:
                row[:] = np.asarray(column)[mask].reshape(-1)
            own[key] = row
        else:
            row[:] = own[key]
    return out


def _cells(state: State, found: Sequence[tuple[Family, np.ndarray]]) -> sparse.csr_array | None:
    """(m, n): the same, of all families' terms one after the other."""
    mask = state.usable
    n, channels = int(mask.sum()), state.condition.mean.shape[2]
    parts = []
    for family, index in found:
        seen = family.cells(state)
        if seen is None:
            parts.append(sparse.csr_array((len(index), n * channels), dtype=np.float32))
            continue
        ids, share, unit = seen[0][mask], seen[1][mask], seen[2]
        unit = np.broadcast_to(unit, (*mask.shape, channels))[mask]
        pixel, which = np.nonzero((ids >= 0) & (share > 0))
        value = (share[pixel, which][:, None] * unit[pixel]).astype(np.float32)
        row = np.repeat(ids[pixel, which], channels)
        column = (pixel[:, None] * channels + np.arange(channels)).reshape(-1)
        parts.append(sparse.csr_array((value.reshape(-1), (row, column)), shape=(len(index), n * channels)))
    return sparse.vstack(parts, format="csr") if parts else None
