"""Which capture tells an effect from what looks like it; the effects' own files say it."""

from interchange.effects import MODELS


def separating(effect: str, rival: str) -> str:
    """The one more capture that tells ``effect`` from ``rival``, both names of the catalogue or of a generic family."""
    known = [MODELS[name].separated_by for name in (effect, rival) if name in MODELS]
    return known[0] if known else "the same scene from a second pose and under a second lamp"
