"""The algorithms that are tuned, one file each, and the user's own by ``module:function``."""

from analysis.tune.algorithms.base import Algorithm
from interchange.catalogue import catalogue
from interchange.problems import BrightfieldError, did_you_mean

MODELS = catalogue(__name__, Algorithm)  # by file name, which is the algorithm's name


def algorithm(name: str) -> type[Algorithm]:
    """By its name ("canny", "circle-gauge"), or a function or class of the user's as "module:name"."""
    if ":" in name:
        from analysis.tune.user_function import load

        return load(name)
    word = name.replace("-", "_")
    if word not in MODELS:
        known = [n.replace("_", "-") for n in MODELS]
        raise BrightfieldError(
            f'There is no algorithm "{name}".{did_you_mean(name, known)} There are {", ".join(known)}, and your own '
            f"as module:function."
        )
    return MODELS[word]
