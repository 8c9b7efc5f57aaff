"""What a plan may say of one number, and what becomes of it.

| in the file                                              | is                                                     |
|----------------------------------------------------------|--------------------------------------------------------|
| ``5``                                                    | that value in every frame                              |
| ``[1, 2, 5]``, ``{values: [1, 2], shares: [0.9, 0.1]}``  | one of them                                            |
| ``{range: [0, 5], unit: mm, steps: 6}``                  | a range; ``steps`` in a grid; ``law``: ``uniform``,    |
|                                                          | ``log_uniform``, ``normal`` with ``mean``, ``sigma``   |
| ``{samples: {0: -3, 10: 3}, unit: mm}``                  | a number that moves: time code to value                |

``nature`` is the law that the world follows where another one is sampled: ``{law: normal, mean: 0, sigma: 1}`` over
the same range, or the shares of the same values. Numbers stand in ``unit``, which must fit the declared one.
"""

import math
from collections.abc import Mapping
from typing import Any

from analysis.sweep.findings import Findings
from analysis.sweep.laws import Choice, Law, LogUniform, Normal, Uniform
from analysis.sweep.plan import Moving
from analysis.sweep.sampling import Axis, Method
from analysis.sweep.units import factor
from interchange.parameter import Parameter
from interchange.problems import BrightfieldError, did_you_mean

FORMS: dict[str, set[str]] = {
    "value": {"value", "unit"},
    "values": {"values", "unit", "shares", "nature"},
    "range": {"range", "unit", "steps", "law", "mean", "sigma", "nature"},
    "samples": {"samples", "unit"},
}
LAWS = ("uniform", "log_uniform", "normal")


def is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def read_axis(
    address: str, spec: Any, about: Parameter, unit: str, key: str, wrong: Findings, method: Method
) -> Axis | float | Moving | None:
    """An axis, a fixed value or a moving one, in the declared unit; None where something is wrong with it."""
    before = len(wrong.problems)
    data = spec if isinstance(spec, dict) else {"values" if isinstance(spec, list) else "value": spec}
    forms = [f for f in FORMS if f in data]
    if len(forms) != 1:
        hint = next((h for word in data if (h := did_you_mean(str(word), FORMS))), "")
        wrong(
            key,
            f"It must have one of {', '.join(FORMS)}; got {', '.join(map(str, data)) or 'nothing'}.{hint}",
        )
        return None
    form = forms[0]
    wrong.strange(data, FORMS[form], key)
    scale = _scale(data, about, unit, key, wrong)

    def number(value: Any, place: str) -> float:
        if not is_number(value):
            wrong(place, f"It must be a number; got {value!r}.")
            return about.low
        return float(value) * scale

    def bounded(value: Any, place: str) -> float:
        x = number(value, place)
        slack = 1e-6 * max(abs(about.low), abs(about.high))
        if not about.low - slack <= x <= about.high + slack:
            told = "" if about.unit == "1" else f" {about.unit}"
            wrong(
                place,
                f"{about.symbol} ({about.meaning}) must lie in [{about.low:g}, {about.high:g}]{told}; got {x:g}{told}.",
            )
        return min(max(x, about.low), about.high)

    found: Axis | float | Moving | None
    match form:
        case "value":
            found = bounded(data["value"], key)
        case "samples":
            found = _moving(address, data["samples"], bounded, key, wrong)
        case "values":
            found = _choice(address, data, bounded, key, wrong)
        case _:
            found = _range(address, data, bounded, number, key, wrong, method)
    return found if len(wrong.problems) == before else None


def _scale(data: Mapping[str, Any], about: Parameter, unit: str, key: str, wrong: Findings) -> float:
    given = data.get("unit", unit)
    if unit and "unit" in data and data["unit"] != unit:
        wrong(key, f'Its address says the unit "{unit}", and it says "{given}"; leave out one.')
    if not given:
        if about.unit not in ("1", ""):
            wrong(key, f"It must say its unit, {about.unit} say; nothing is guessed.")
        return 1.0
    try:
        return factor(str(given), about.unit)
    except BrightfieldError as error:
        wrong(f"{key}.unit", str(error))
        return 1.0


def _moving(address: str, given: Any, bounded: Any, key: str, wrong: Findings) -> Moving | None:
    if not isinstance(given, dict) or not given or not all(is_number(t) for t in given):
        wrong(f"{key}.samples", f"Time samples must be time codes with a value each; got {given!r}.")
        return None
    times = sorted(given)
    values = tuple(bounded(given[t], f"{key}.samples.{t}") for t in times)
    return Moving(address, tuple(float(t) for t in times), values)


def _choice(address: str, data: Mapping[str, Any], bounded: Any, key: str, wrong: Findings) -> Axis | None:
    given = data["values"]
    if not isinstance(given, list) or not given:
        wrong(f"{key}.values", f"It must be a list of one number or more; got {given!r}.")
        return None
    values = tuple(bounded(v, f"{key}.values[{i}]") for i, v in enumerate(given))
    shares = read_shares(data, "shares", values, key, wrong)
    nature = Choice(values, read_shares(data, "nature", values, key, wrong)) if "nature" in data else None
    if nature and any(p > 0 and q == 0 for p, q in zip(nature.shares, shares, strict=True)):
        wrong(f"{key}.shares", "What there is in nature must be sampled; a share is 0.")
    if len(set(values)) < len(values) and {"shares", "nature"} & set(data):
        wrong(f"{key}.values", "With shares every value must stand once.")
    return Axis(address, Choice(values, shares), nature=nature)


def read_shares(
    data: Mapping[str, Any], name: str, values: tuple[float, ...], key: str, wrong: Findings
) -> tuple[float, ...]:
    even = (1 / len(values),) * len(values)
    given = data.get(name, list(even))
    good = (
        isinstance(given, list) and len(given) == len(values) and all(is_number(p) and p >= 0 for p in given)
    )
    if not good or not sum(given) > 0:
        wrong(
            f"{key}.{name}",
            f"It must have a share of 0 or more for each of {len(values)} values; got {given!r}.",
        )
        return even
    return tuple(p / sum(given) for p in given)


def _range(
    address: str,
    data: Mapping[str, Any],
    bounded: Any,
    number: Any,
    key: str,
    wrong: Findings,
    method: Method,
) -> Axis | None:
    given = data["range"]
    if not isinstance(given, list) or len(given) != 2:
        wrong(f"{key}.range", f"It must be [lowest, highest]; got {given!r}.")
        return None
    low, high = (bounded(v, f"{key}.range[{i}]") for i, v in enumerate(given))
    if not low < high:
        wrong(f"{key}.range", f"The lowest must lie below the highest; got {given!r}.")
        return None
    steps = data.get("steps", 0)
    if "steps" in data and not (
        isinstance(steps, int) and not isinstance(steps, bool) and 1 <= steps <= 1_000_000
    ):
        wrong(f"{key}.steps", f"It must be a whole number in [1, 1000000]; got {steps!r}.")
    if method is Method.GRID and "steps" not in data:
        wrong(key, "A range in a grid must say its steps.")
    if method is not Method.GRID and "steps" in data:
        wrong(f"{key}.steps", f"Steps belong to a grid; this plan samples by {method}.")
    if method is Method.LIST:
        wrong(key, "With sampling by list it must be a list of values.")
    law = _law(data, low, high, number, key, wrong)
    nature = None
    if "nature" in data:
        other = data["nature"]
        if not isinstance(other, dict):
            wrong(f"{key}.nature", f"It must be a mapping with a law; got {other!r}.")
        else:
            wrong.strange(other, {"law", "mean", "sigma"}, f"{key}.nature")
            nature = _law(other, low, high, number, f"{key}.nature", wrong)
    return Axis(address, law, int(steps) if is_number(steps) else 0, nature)


def _law(data: Mapping[str, Any], low: float, high: float, number: Any, key: str, wrong: Findings) -> Law:
    word = data.get("law", "normal" if {"mean", "sigma"} & set(data) else "uniform")
    match word:
        case "uniform":
            law: Law = Uniform(low, high)
        case "log_uniform":
            if low <= 0:
                wrong(
                    f"{key}.law",
                    f"An even spread over magnitudes needs a range above 0; it begins at {low:g}.",
                )
                return Uniform(low, high)
            law = LogUniform(low, high)
        case "normal":
            if missing := {"mean", "sigma"} - set(data):
                wrong(
                    f"{key}.law",
                    f"A normal law must have mean and sigma; {', '.join(sorted(missing))} is missing.",
                )
                return Uniform(low, high)
            mean, sigma = number(data["mean"], f"{key}.mean"), number(data["sigma"], f"{key}.sigma")
            if not sigma > 0:
                wrong(f"{key}.sigma", f"It must be greater than 0; got {sigma:g}.")
                return Uniform(low, high)
            if not low - 6 * sigma <= mean <= high + 6 * sigma:
                wrong(
                    f"{key}.mean",
                    f"It must lie within 6 sigma of the range [{low:g}, {high:g}]; got {mean:g}.",
                )
                return Uniform(low, high)
            law = Normal(mean, sigma, low, high)
        case _:
            wrong(
                f"{key}.law",
                f'It must be one of {", ".join(LAWS)}; got "{word}".{did_you_mean(str(word), LAWS)}',
            )
            return Uniform(low, high)
    if word != "normal" and {"mean", "sigma"} & set(data):
        wrong(key, f"Mean and sigma belong to a normal law; this one is {word}.")
    return law
