"""Terms of every effect in ``interchange.effects`` that changes the mean image: differences of the chain itself, but
for what acts within a pixel (analysis.gap.terms.subpixel).

Which parameters there are, their units and their bounds, the effects' own files say. Where an effect grows with the
square of its parameter (a blur's width) the term is the square.
"""

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.compared.state import State
from analysis.gap.sensor.uneven_optics import UnevenBlur
from analysis.gap.terms.base import NUISANCE, Field, Term
from analysis.gap.terms.left import BENT, EDGED, SCATTERED, SMOOTH
from analysis.gap.terms.subpixel import PRODUCT, UNEVENLY, across, subpixel, unevenly
from analysis.gap.terms.uneven_blur import DRAWN, uneven
from interchange.captures import Tolerances
from interchange.effects import MODELS, Effect
from interchange.effects.exposure import Exposure
from interchange.parameter import Parameter, ParameterError, parameters

NAMED = (
    "vignetting", "defocus", "lateral_chromatic_aberration", "veiling_glare", "motion_blur", "black_level",
    "exposure", "response_curve", "white_balance", "color_crosstalk", "rolling_shutter",
)  # fmt: skip  # of the file contract's names, those of the chain that change the mean
SHARES = {  # of the flat field's tolerance; else SMOOTH
    "defocus": EDGED,
    "lateral_chromatic_aberration": EDGED,
    "motion_blur": EDGED,
    "rolling_shutter": EDGED,
    "veiling_glare": EDGED,
}
LEAST = {"veiling_glare": SCATTERED, "response_curve": BENT}  # of the signal
# parts of a lateral chromatic aberration: axes lie near the middle, and magnifications differ by a share; and of a
# response curve, of which the second term of a smooth deviation is the smaller, and a power is what files are encoded
# by, no sensor's
MINOR = {
    "red_u": 0.2, "red_v": 0.2, "blue_u": 0.2, "blue_v": 0.2, "red3": 0.5, "blue3": 0.5,
    "skew": 0.5, "gamma": 0.5, UNEVENLY: 0.3,
}  # fmt: skip
DELAY = "delay"  # of the exposure
REDUNDANT = {
    ("white_balance", "green"),
    ("exposure", DELAY),
    ("motion_blur", UNEVENLY),
}  # with the exposure it is any other two; told apart below
SEEN = 2e-6  # of the signal's rms: a parameter that changes less at its test step is not in the image
RELATIVE_STEP, STEP = 0.01, 1e-3
CROSS_STEP = 0.7  # px, of the step that a path's product is told by
SHARED = 0.7  # of a tolerance, by all cameras
OF_A_CHANNEL = 0.5  # of a black level's, of each channel by itself
OF_A_CAMERA = float(np.sqrt(1 - SHARED**2 - OF_A_CHANNEL**2))  # of a black level's, of each camera by itself
DARK = "dark_current"  # of the black level
SENSOR = "sensor"  # what it is of
# over a black level that is off: sensors give 1 to 100 e-/s (EMVA 1288 data sheets, 25 degrees C), of which exposures
# of machine vision, milliseconds, leave nothing to be seen
LEAKING = 0.01
SHADED = 0.5  # of its tolerance, that it may be uneven by: a guess, half of what may be wrong with all of it
APART = 2.0  # times, from which on exposures tell it from the level
SHORTEST = 0.01  # of an exposure that is set, that a shutter is open for
VIBRATION = "vibration"  # a path that is as long in every exposure
EVENLY = 1.2  # times, up to which exposures do not tell that
TYPICAL = 0.01  # rms of an effect over the signal, at which its sensitivity is taken


def chain_terms(state: State, tolerances: Tolerances, exposures: Collection[float] = ()) -> list[Term]:
    """The terms that ``state``'s condition shows (linearised where the effects of the chain are the camera's own).
    ``exposures`` s: of all conditions; where they differ they tell a motion, whose path grows with them, from a
    vibration, which is done with many times in each."""
    base = state.dn(())
    signal = float(np.sqrt(np.mean((base - state.simulation.black) ** 2))) or 1.0
    absolute = {"black_level": SHARED * tolerances.black_level_dn, "exposure": tolerances.light_intensity / 5}
    finely = bool(state.base.fine)
    terms = []
    for name in (n for n in NAMED if n in MODELS):
        model = MODELS[name]
        found = []
        steady = ("", VIBRATION) if name == "motion_blur" and differ(exposures) else ("",)
        for parameter, about, target in ((*x, t) for t in steady for x in parameters(model).items()):
            if (name, parameter) in REDUNDANT or parameter in model.per_second.values():
                continue
            own = model.of(state.camera)
            start = float(getattr(own, parameter))
            grows = parameter in model.per_second and target != VIBRATION
            t_exp = state.camera.t_exp if grows else 0.0
            told = subpixel(own, parameter, t_exp, state.camera) if finely else None
            if told is None:
                told = _by_difference(state, own, parameter, about, base, signal, t_exp)
            if told is None:
                continue
            field, power = told
            least = start <= about.low or start <= model.physical.get(parameter, -np.inf)
            found.append(
                Term(
                    cause=name,
                    target=target,
                    parameter=parameter,
                    unit=about.unit,
                    form=len(steady) > 1,
                    spike=absolute.get(
                        name, max(tolerances.flat_field * SHARES.get(name, SMOOTH), LEAST.get(name, 0.0))
                    ),
                    field=field,
                    relative=name not in absolute,
                    power=power,
                    low=0.0 if power == 2 or least else -np.inf,
                    kind="chain",
                    start=start,
                    t_exp=t_exp,
                    part=MINOR.get(parameter, 1.0),
                )
            )
        if {t.parameter for t in found} >= {"u", "v"} and name == "motion_blur":
            for v in [t for t in found if t.parameter == "v"]:
                found.append(
                    replace(v, parameter=PRODUCT, unit="px^2", power=1, low=-np.inf, field=across(v.t_exp))
                    if finely
                    else _across(v, model)
                )
                if finely:
                    found.append(_unevenly(v, float(getattr(model.of(state.camera), UNEVENLY))))
        found = [replace(t, spike=t.spike / np.sqrt(len(found))) if t.relative else t for t in found]
        blur = [t for t in found if (t.cause, t.parameter) == ("defocus", "blur")]
        more = [x for t in blur for x in uneven(t, state)]  # which may be all of a blur
        terms += [*(replace(t, held=bool(more)) if t in blur else t for t in found), *more]
    return terms


def differ(exposures: Collection[float]) -> bool:
    return bool(exposures) and max(exposures) > EVENLY * min(exposures)


def black_levels(conditions: Sequence[Condition], tolerances: Tolerances) -> list[Term]:
    """How far each camera's black level may be off by itself: no cause. The tolerance is of the sum, with what all
    share and what each channel has."""
    names = list(dict.fromkeys(c.camera.name for c in conditions))

    def own(name: str) -> Field:
        return lambda s: np.ones_like(s.signal) if s.camera.name == name else None

    spike = OF_A_CAMERA * tolerances.black_level_dn
    return [Term(NUISANCE, n, "black level", "DN", spike, own(n)) for n in names]


def black_of_channels(conditions: Sequence[Condition], tolerances: Tolerances) -> list[Term]:
    """How far the black level of each channel of each camera may be off by itself, as each has an amplifier of its own:
    no cause."""
    channels = {c.camera.name: c.mean.shape[2] for c in conditions}

    def own(name: str, channel: int) -> Field:
        def field(s: State) -> np.ndarray | None:
            if s.camera.name != name:
                return None
            out = np.zeros_like(s.signal)
            out[..., channel] = 1.0
            return out

        return field

    spike = OF_A_CHANNEL * tolerances.black_level_dn
    return [
        Term(NUISANCE, name, f"black level of channel {k}", "DN", spike, own(name, k))
        for name, n in channels.items()
        for k in range(n)
    ]


def dark_shading(conditions: Sequence[Condition], tolerances: Tolerances) -> list[Term]:
    """How uneven each camera's black level may be along rows and columns, as electronics warm and lines are read one
    after the other: half a wave and a whole one over the image; no cause. A tolerance holds anywhere on the sensor."""
    cameras = {c.camera.name: c.camera for c in conditions}

    def wave(name: str, axis: int, order: int) -> Field:
        def field(s: State) -> np.ndarray | None:
            if s.camera.name != name:
                return None
            along = (s.grid[axis] + 0.5) / s.camera.sensor.resolution[axis]
            return np.broadcast_to(np.cos(np.pi * order * along)[..., None], s.signal.shape).astype(
                np.float32
            )

        return field

    return [
        Term(
            NUISANCE,
            name,
            f"black level along {('rows', 'columns')[axis]} {order}",
            "DN",
            SHADED / order * tolerances.black_level_dn,
            wave(name, axis, order),
        )
        for name in cameras
        for axis in (0, 1)
        for order in (1, 2)
    ]


def dark_current(conditions: Sequence[Condition], tolerances: Tolerances) -> list[Term]:
    """What a black level grows by with the exposure, where exposures tell: as far off the data sheet's, at the longest
    of them, as the level itself may be. Below nothing there is none. It is a cause by itself, and a rare one: an even
    plate shows ambient light alike."""
    longest = max(conditions, key=lambda c: c.camera.t_exp).camera
    if longest.t_exp < APART * min(c.camera.t_exp for c in conditions):
        return []

    def field(s: State) -> np.ndarray:
        return np.full_like(s.signal, s.camera.sensor.K_out * s.camera.t_exp)

    spike = tolerances.black_level_dn / (longest.sensor.K * longest.t_exp)
    sheet = longest.sensor.dark_current
    return [Term("black_level", SENSOR, DARK, "e-/s", spike, field, low=-sheet, start=sheet, usual=LEAKING)]


def shutter_delay(conditions: Sequence[Condition], tolerances: Tolerances) -> list[Term]:
    """How much longer the shutter is open than is set, where exposures tell: at the shortest of them as far off as an
    exposure may be."""
    times = [c.camera.t_exp for c in conditions]
    if max(times) < APART * min(times):
        return []

    def field(s: State) -> np.ndarray:
        now = next((e for e in s.effects if isinstance(e, Exposure)), Exposure.of(s.camera))
        return np.asarray(s.signal / np.float32(max(s.camera.t_exp + now.delay, SHORTEST * s.camera.t_exp)))

    spike, start = tolerances.light_intensity / 5 * min(times), conditions[0].camera.sensor.exposure_delay
    return [Term("exposure", "", DELAY, "s", spike, field, kind="chain", start=start)]


def _across(down: Term, model: type[Effect]) -> Term:
    """The product of both ways of a motion, whose squares do not tell a path to the lower right from one to the lower
    left: what the path with the other sign does less, the change of the squares taken out."""

    def field(s: State) -> np.ndarray:
        now = next((e for e in s.effects if type(e) is model), model.of(s.camera))
        grown = down.grown(s)
        u, v, a = float(getattr(now, "u")), float(getattr(now, "v")), CROSS_STEP * grown  # noqa: B009
        others = [e for e in s.effects if type(e) is not model]
        ways = [s.dn([*others, replace(now, u=u + np.copysign(a, u), v=v + w)]) for w in (a, -a)]  # type: ignore[type-var]
        own = down.column(s)
        assert own is not None
        both = s.take(ways[0] - ways[1]) - np.float32(4 * v * a / grown**2) * own
        return np.asarray(both * np.float32(grown**2 / (2 * a * (u + np.copysign(a, u)))), np.float32)

    return replace(down, parameter=PRODUCT, unit="px^2", power=1, low=-np.inf, field=field)


def _unevenly(down: Term, start: float) -> Term:
    """How much faster a motion is at the end of its path than at the start."""
    return replace(
        down,
        parameter=UNEVENLY,
        unit="1",
        power=1,
        low=-np.inf,
        field=unevenly,
        start=start,
        t_exp=0.0,
        spike=down.spike * MINOR[UNEVENLY],
        part=MINOR[UNEVENLY],
    )


def signed(values: dict[str, float]) -> dict[str, float]:
    """Parameters of an effect as its file names them: the product of a motion's ways gives the second its sign."""
    product = values.get(PRODUCT, 0.0)
    out = {n: x for n, x in values.items() if n != PRODUCT}
    return {**out, "v": -out["v"]} if product < 0 and "v" in out else out


def _by_difference(
    state: State,
    own: Effect,
    parameter: str,
    about: Parameter,
    base: np.ndarray,
    signal: float,
    t_exp: float,
) -> tuple[Field, int] | None:
    """DN a unit, and the power of the parameter that the unit is of, by what a step of it changes in the chain's
    image; None where ``state`` does not show it."""
    start = float(getattr(own, parameter))
    step, change = 0.0, [0.0, 0.0]
    for step in _steps(start, about):
        found = [_changed(state, own, parameter, start + k * step, base) for k in (1, 2)]
        change = [x or 0.0 for x in found]
        if min(change) >= SEEN * signal:
            break
    else:
        return None
    power = 2 if change[1] > 3 * change[0] else 1
    larger = step * (TYPICAL * signal / change[0]) ** (1 / power)
    if larger > step and _changed(state, own, parameter, start + larger, base) is not None:
        step = larger
    return _difference(type(own), parameter, power, start, step, t_exp), power


def _steps(start: float, about: Parameter) -> list[float]:
    """What is tried, until it shows: a part of what the camera has, and a part of what there may be."""
    span = STEP * min(about.high - about.low, 500.0)
    return [RELATIVE_STEP * abs(start), span] if start else [span]


def _changed(state: State, own: Effect, parameter: str, value: float, base: np.ndarray) -> float | None:
    try:
        effect = replace(own, **{parameter: value})  # type: ignore[type-var]
    except ParameterError:
        return None
    return float(np.sqrt(np.mean((state.dn([effect]) - base) ** 2)))


def _difference(
    model: type[Effect], parameter: str, power: int, start: float, step: float, t_exp: float
) -> Any:
    def field(s: State) -> np.ndarray:
        now = next((e for e in s.effects if type(e) is model), model.of(s.camera))
        own = float(getattr(model.of(s.camera), parameter)) if power == 1 else start
        grown = s.camera.t_exp / t_exp if t_exp else 1.0
        theta = ((float(getattr(now, parameter)) - own) / grown) ** power
        limits, more = parameters(model)[parameter], step**power

        def further(by: float) -> float:
            return own + grown * (theta + by) ** (1 / power)

        if not limits.low <= further(more) <= limits.high:
            more = -more  # inwards
        others = [e for e in s.effects if type(e) is not model]
        there = replace(now, **{parameter: further(more)})  # type: ignore[type-var]
        return s.take((s.dn([*others, there]) - s.simulation.dn) / np.float32(more))

    return field


def effects_at(terms: Sequence[Term], theta: dict[tuple[str, str, str], float], state: State) -> list[Effect]:
    """The effects whose chain terms are not at zero, within their bounds."""
    found: dict[tuple[str, str], dict[str, float]] = {}
    for term in terms:
        if term.kind == "chain" and theta.get(term.key, 0.0) and term.shown(state):
            found.setdefault(term.candidate, {})[term.parameter] = theta[term.key]
    made = []
    for candidate, values in found.items():
        model = MODELS[candidate[0]]
        own = model.of(state.camera)
        about = parameters(model)
        given = {}
        for term in terms:
            known = term.parameter in values and term.parameter not in (PRODUCT, *DRAWN)
            if term.candidate == candidate and known:
                t = values[term.parameter]
                start = float(getattr(own, term.parameter))
                change = max(t, 0.0) ** 0.5 if term.power == 2 else t
                value = start + change * term.grown(state)
                limits = about[term.parameter]
                given[term.parameter] = float(np.clip(value, limits.low, limits.high))
        given = signed({**given, PRODUCT: values.get(PRODUCT, 0.0)})
        made.append(replace(own, **given))  # type: ignore[type-var]
        slopes = {DRAWN[n]: x for n, x in values.items() if n in DRAWN}
        made += [UnevenBlur(**UnevenBlur.within(slopes))] if slopes else []
    return made
