"""How well defects are found: precision, recall, false alarms, and the area under the ROC curve."""

from dataclasses import dataclass

import numpy as np

from interchange.problems import BrightfieldError


@dataclass(frozen=True)
class Detection:
    """``auc``: chance that a defective pixel scores above a sound one (Mann, Whitney 1947), ties half."""

    precision: float
    recall: float
    false_alarms: float
    auc: float


def detection(truth: np.ndarray, score: np.ndarray, mask: np.ndarray) -> Detection:
    """``truth`` and ``mask`` (H, W) bool, ``score`` (H, W), NaN leaves a pixel out. Precision is NaN
    where nothing is found.

    Raises BrightfieldError where all or none of the pixels are defective.
    """
    there = np.isfinite(score)
    y, m = np.asarray(truth, bool)[there], np.asarray(mask, bool)[there]
    if y.all() or not y.any():
        raise BrightfieldError("A truth must have defective and sound pixels.")
    hits = int((y & m).sum())
    return Detection(
        hits / m.sum() if m.any() else float("nan"),
        hits / int(y.sum()),
        float(m[~y].mean()),
        area_under_roc(y, score[there]),
    )


def area_under_roc(y: np.ndarray, score: np.ndarray) -> float:
    """By ranks: (R - n(n+1)/2) / (n m), R the sum of the n positives' ranks."""
    from scipy.stats import rankdata

    y = np.ravel(y).astype(bool)
    ranks = rankdata(np.ravel(score))
    n, m = int(y.sum()), int((~y).sum())
    return float((ranks[y].sum() - n * (n + 1) / 2) / (n * m))
