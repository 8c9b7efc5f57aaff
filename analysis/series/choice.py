"""Which few lamps of a series say nearly as much as all.

With labels: a random forest ranks the lamps by how much its trees gain from them, and the least telling ones are
dropped step by step. Jehle, Sommer, Jähne: Learning of optimal illumination for material classification. DAGM 2010
(embedded selection by the forest; Breiman: Random forests. Machine Learning 2001).

Without: lamps one after the other, each the one that leaves the least variance of the others unexplained,

    minimise tr(C_rr - C_rs C_ss⁻¹ C_sr)        s chosen, r the rest

McCabe: Principal variables. Technometrics 1984, criterion 2, by forward steps. Its aim is that of Gruna, Beyerer:
Acquisition and evaluation of illumination series for unsupervised defect detection. I2MTC 2011; the formula is
McCabe's.
"""

from dataclasses import dataclass

import numpy as np

from analysis.series.covariance import moments
from interchange.problems import BrightfieldError
from interchange.series import Series


@dataclass(frozen=True, eq=False)
class Chosen:
    """``lamps`` (K,): the most telling first. ``score`` (K,): with the first 1 ... K of them, the share of variance
    explained or the forest's accuracy on samples that its trees have not seen."""

    lamps: np.ndarray
    score: np.ndarray


def choose_unsupervised(series: Series, count: int, standardise: bool = True) -> Chosen:
    """``count`` lamps by the covariance of their images over all pixels with no invalid sample.

    ``standardise``: bright images do not count for more. Raises BrightfieldError for more lamps than there are.
    """
    _check(series, count)
    x = series.grey.reshape(len(series), -1)
    whole = series.usable.all(axis=0).ravel()
    rest = moments(x[:, whole] if not whole.all() else x).covariance
    if standardise:
        scale = np.sqrt(np.maximum(np.diag(rest), 1e-300))
        rest = rest / np.outer(scale, scale)
    total = float(np.trace(rest))
    if not total > 0:
        raise BrightfieldError("The images must vary over their pixels for lamps to be chosen.")
    least = 1e-9 * np.diag(rest).max()
    lamps: list[int] = []
    score: list[float] = []
    for _ in range(count):
        variance = np.diag(rest)
        gain = np.where(variance > least, (rest**2).sum(axis=0) / np.maximum(variance, least), 0.0)
        gain[lamps] = -1.0
        best = int(np.argmax(gain))
        lamps.append(best)
        if variance[best] > least:
            rest = rest - np.outer(rest[:, best], rest[best]) / variance[best]
        score.append(1 - max(float(np.trace(rest)), 0.0) / total)
    return Chosen(np.array(lamps), np.array(score))


def choose_by_forest(
    series: Series,
    labels: np.ndarray,
    count: int,
    trees: int = 100,
    drop: float = 0.25,
    most: int = 1000,
    seed: int = 0,
) -> Chosen:
    """``count`` lamps that tell the classes of ``labels`` (H, W) apart, below 0 where none is known.

    The share ``drop`` of the lamps left is dropped at a step; the last ``count`` are ranked by dropping them one by
    one. At most ``most`` pixels a class are trained on, and three times as many as the rarest class has.
    Raises BrightfieldError for fewer than two classes.
    """
    from sklearn.ensemble import RandomForestClassifier

    _check(series, count)
    x = np.moveaxis(series.per_irradiance, 0, -1).reshape(-1, len(series))
    y = np.where(series.usable.all(axis=0).ravel(), np.ravel(labels), -1)
    rng = np.random.default_rng(seed)
    classes = np.unique(y[y >= 0])
    if len(classes) < 2:
        raise BrightfieldError(f"Lamps are chosen for two classes or more; got {len(classes)}.")
    own = [rng.permutation(np.flatnonzero(y == k)) for k in classes]
    limit = min(most, 3 * min(map(len, own)))
    train = np.concatenate([pixels[:limit] for pixels in own])
    x, y = x[train], y[train]

    def grown(lamps: np.ndarray) -> tuple[np.ndarray, float]:
        forest = RandomForestClassifier(
            trees, oob_score=True, random_state=seed, n_jobs=-1, min_samples_leaf=2
        ).fit(x[:, lamps], y)
        return forest.feature_importances_, float(forest.oob_score_)

    left = np.arange(len(series))
    while len(left) > count:
        importance, _ = grown(left)
        keep = max(count, int(np.floor(len(left) * (1 - drop))))
        left = left[np.sort(np.argsort(-importance, kind="stable")[:keep])]
    order: list[int] = []
    score: list[float] = []
    while len(left):
        importance, accuracy = grown(left)
        worst = int(np.argmin(importance))
        order.append(int(left[worst]))
        score.append(accuracy)
        left = np.delete(left, worst)
    return Chosen(np.array(order[::-1]), np.array(score[::-1]))


def _check(series: Series, count: int) -> None:
    if not 1 <= count <= len(series):
        raise BrightfieldError(f"Between 1 and {len(series)} lamps can be chosen; got {count}.")
