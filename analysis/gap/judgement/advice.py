"""Which capture tells an effect from what looks like it; the effects' own files say it."""

from interchange.effects import MODELS


def separating(effect: str, rival: str) -> str:
    """The one more capture that tells ``effect`` from ``rival``, both names of the catalogue or of a generic family."""
    known = [name for name in (effect, rival) if name in MODELS]
    if not known:
        return "the same scene from a second pose and under a second lamp"
    other = {effect: rival, rival: effect}  # the first that says what tells it from the other one
    return MODELS[next((n for n in known if other[n] in MODELS[n].confused_with), known[0])].separated_by
