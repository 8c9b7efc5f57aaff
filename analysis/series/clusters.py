"""Materials without labels: k-means of the pixels' features, and how well two segmentations agree.

Lloyd: Least squares quantization in PCM. IEEE Trans. Inf. Theory 1982; starts of Arthur, Vassilvitskii: k-means++.
SODA 2007. Adjusted Rand index: Hubert, Arabie: Comparing partitions. J. Classification 1985.
"""

from dataclasses import dataclass

import numpy as np

from interchange.problems import BrightfieldError


@dataclass(frozen=True, eq=False)
class Clusters:
    """``labels`` (H, W) int, -1 where a feature is missing; ``centers`` (K, F), in the features' own units."""

    labels: np.ndarray
    centers: np.ndarray
    inertia: float


def k_means(
    features: np.ndarray, classes: int, seed: int = 0, standardise: bool = True, restarts: int = 10
) -> Clusters:
    """Cluster the pixels of ``features`` (H, W, F) into ``classes``.

    ``standardise``: every feature by its mean and standard deviation, so that units do not matter. Labels are in the
    order of falling size. Raises BrightfieldError where fewer pixels than classes have all their features.
    """
    from sklearn.cluster import KMeans

    height, width, count = features.shape
    x = features.reshape(-1, count).astype(np.float64)
    there = np.isfinite(x).all(axis=1)
    if classes < 2 or there.sum() < classes:
        raise BrightfieldError(
            f"There must be two classes or more and a pixel for each; got {classes} classes, {int(there.sum())} pixels."
        )
    centre, scale = np.zeros(count), np.ones(count)
    if standardise:
        centre, scale = x[there].mean(axis=0), x[there].std(axis=0)
        scale = np.where(scale > 0, scale, 1.0)
    found = KMeans(classes, n_init=restarts, random_state=seed).fit((x[there] - centre) / scale)
    order = np.argsort(-np.bincount(found.labels_, minlength=classes), kind="stable")
    rank = np.empty(classes, np.int64)
    rank[order] = np.arange(classes)
    labels = np.full(height * width, -1)
    labels[there] = rank[found.labels_]
    centers = found.cluster_centers_[order] * scale + centre
    return Clusters(labels.reshape(height, width), centers, float(found.inertia_))


def adjusted_rand(a: np.ndarray, b: np.ndarray) -> float:
    """1 for the same partition whatever the names, 0 in the mean of chance. Pixels with a label below 0 are left
    out."""
    from sklearn.metrics import adjusted_rand_score

    a, b = np.ravel(a), np.ravel(b)
    both = (a >= 0) & (b >= 0)
    return float(adjusted_rand_score(a[both], b[both]))
