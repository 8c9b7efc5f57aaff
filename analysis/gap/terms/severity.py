"""How strong an effect is: the rms of what it changes over the mean signal, all compared pixels alike.

    s² = θ' M θ,      M = Σ_c X_c X_c' / n / (Σ_c signal / n)²

The evidence weighs pixels by what is known of them, edges little: a principal point that was to be found from 1.2 % on
by its weights is from 3.7 % by this.
"""

from collections.abc import Collection, Mapping

import numpy as np

from analysis.gap.terms.base import Cause
from analysis.gap.terms.sensitivities import Sensitivities


def severities(
    members: Mapping[Cause, np.ndarray], drawn: Collection[Sensitivities]
) -> dict[Cause, np.ndarray]:
    """M (k, k) of each cause of ``members`` (the indices of its terms); ``drawn``: one a condition."""
    products = {cause: np.zeros((len(index), len(index))) for cause, index in members.items()}
    count = sum(s.n for s in drawn)
    total = sum(float(s.signal.mean(dtype=np.float64)) * s.n for s in drawn)
    for s in drawn:
        row = {int(i): k for k, i in enumerate(s.few)}
        cell = {int(i): k for k, i in enumerate(s.many)}
        for cause, index in members.items():
            if s.cells is not None and int(index[0]) in cell:
                own = s.cells[[cell[int(i)] for i in index]]
                products[cause] += (own @ own.T).toarray()
            else:
                X = np.stack([s.columns[row[int(i)]] for i in index])
                products[cause] += X @ X.T
    scale = count / max(total, 1e-30) ** 2
    return {cause: product * scale for cause, product in products.items()}
