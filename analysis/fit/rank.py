"""All models of the catalogue fitted to one measurement, by how well they foretell what they have not seen."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

from analysis.fit.fit import Fit, Options, fit, fittable, metric_of
from interchange.problems import BrightfieldError
from interchange.reflectance import ReflectanceSamples


@dataclass(frozen=True, eq=False)
class Ranked:
    """``fit`` None: the model could not be fitted, and ``reason`` says why."""

    model: str
    fit: Fit | None
    reason: str = ""

    def error(self, metric: str) -> float:
        return self.fit.held_out.rms[metric] if self.fit else float("inf")


def rank(
    samples: ReflectanceSamples,
    options: Options = Options(),  # noqa: B008  # frozen
    models: Iterable[str] = (),
    seconds: float = 60.0,
    told: Callable[[str, int, int], None] | None = None,
) -> list[Ranked]:
    """Every model that can be fitted (or those named), the lowest held-out error in the weighting's metric first.

    ``seconds``: for each; a model that has no fit by then stands last with its reason. Fixed parameters are dropped for
    models that do not have them. ``told``: gets each model's name before it starts, its number and how many there are.
    """
    names = list(models) or sorted(fittable())
    found = []
    for k, name in enumerate(names):
        if told is not None:
            told(name, k, len(names))
        model = fittable()[name]
        own = {p: v for p, v in options.fixed.items() if p in model().slots()}
        limits = replace(options, seconds=seconds, fixed=own, lobes=0)
        try:
            found.append(Ranked(name, fit(samples, model, limits)))
        except BrightfieldError as error:
            found.append(Ranked(name, None, str(error)))
    done = next((r.fit for r in found if r.fit is not None), None)
    metric = metric_of(done.options.weighting if done is not None else options.weighting)
    return sorted(found, key=lambda r: r.error(metric))
