"""Whether captures follow a curve where the scene says that they are linear: most of what leaves a camera as a picture
does, and many a camera has a gamma. The curve is taken for what it is before anything is fitted: none that bends so far
is reached by steps from a line, and what it leaves would be taken for effects that are not there.

Over all pixels of a camera the captures' DN are a function of the simulated ones. Means of steps of it are
fitted by a line with a gain and an offset of its own, and by the curves of ``NAMED`` and a power with a gain and either
offset that a camera gives: its black level, or none where that was taken off before. (sRGB's curve is a power but for
its offset and its toe.) Which curve it is, is told once more without what shades the light
(analysis.gap.processed.curve_steps): of another than these the nearest is bowed into a table of its own.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.optimize import minimize_scalar

from analysis.gap.compared.conditions import Condition
from analysis.gap.finding import Estimate
from analysis.gap.parallel import each
from analysis.gap.processed.curve_steps import Steps, evened, in_the_dark, steps
from analysis.gap.sensor import cut
from interchange.camera import Camera
from interchange.effects.parts import called
from interchange.effects.response_curve import ResponseCurve
from interchange.sensor import Response, Sensor

NAMED = {Response.SRGB: "sRGB's curve", Response.REC709: "the curve of Rec. 709"}
GAINS = np.log(2) * np.linspace(-1, 1, 31)  # logarithms; between them the best is searched for
GAMMAS = (0.25, 4.0)
BENT = 0.01  # of the captures' range, rms, that a line leaves at least
BENT_BY_POWER = 0.02  # the same, of γ 0.82 and 1.2: what bends less the fit follows
BETTER = 10.0  # times as much (squared) that it leaves as the curve does
OWN = 0.005  # of the captures' range, rms, that the right curve leaves at most; it leaves 0.002 to 0.0035
HALF_A_CODE = 0.5 / 255  # of 8 bits
ENTRIES = 1025  # of a table
LINE = Estimate(1.0, 0.0, "1")


@dataclass(frozen=True)
class Encoding:
    """A camera whose captures follow a curve; ``black_off``: whether its black level was taken off before. ``gamma``:
    of a power, where ``response`` is linear; ``lut``: where it is one."""

    camera: str
    black_off: bool
    response: Response = Response.SRGB
    gamma: Estimate = field(default=LINE)
    lut: tuple[float, ...] = ()

    def of(self, camera: Camera) -> Camera:
        """The camera as its captures are."""
        if camera.name != self.camera:
            return camera
        sensor = replace(camera.sensor, response=self.response, gamma=self.gamma.value, response_lut=self.lut)
        return replace(camera, sensor=replace(sensor, black_level=0.0) if self.black_off else sensor)

    @property
    def words(self) -> str:
        if self.response is Response.LINEAR:
            return f"a power of γ {self.gamma.value:.3g}"
        return NAMED.get(self.response, "a curve without a name")

    @property
    def parameters(self) -> dict[str, Estimate]:
        return {"gamma": self.gamma} if self.response is Response.LINEAR else {str(self.response): LINE}


def parameters(by: Sequence[Encoding]) -> dict[str, Estimate]:
    """Of a response curve; by camera where they are not alike."""
    if all(e.response is by[0].response is not Response.LINEAR for e in by):
        return by[0].parameters
    return {f"{called(e.camera)} {n}" if len(by) > 1 else n: x for e in by for n, x in e.parameters.items()}


def has_a_number(parameter: str) -> bool:
    """Whether one of an effect's parameters is told by its value: a curve that has a name or a table is not."""
    return parameter.rpartition(" ")[2] not in (*NAMED, Response.LUT)


def grounds(by: Sequence[Encoding]) -> str:
    curves = " and ".join(dict.fromkeys(e.words for e in by))
    return (
        f"Over all pixels of a camera the captured DN follow {curves} of the simulated ones, and no line: it was taken "
        "so before anything was fitted."
    )


def encoded(found: Sequence[Condition]) -> list[Encoding]:
    """The cameras of which that is so."""
    cameras: dict[str, list[Condition]] = {}
    for c in found:
        if is_linear(c.camera.sensor):
            cameras.setdefault(c.camera.name, []).append(c)
    return [e for e in each(_encoding, cameras.values()) if e is not None]


def is_linear(sensor: Sensor) -> bool:
    """Whether a scene says that DN are linear, of however few bits."""
    return sensor.response is Response.LINEAR and sensor.gamma == 1 and not (sensor.bow or sensor.skew)


def _encoding(own: Sequence[Condition]) -> Encoding | None:
    """Of the captures of one camera; None of those that follow no curve."""
    seen = steps(own)
    if seen is None:
        return None
    bend = np.sqrt(_off_line(seen)) / max(float(np.ptp(seen[1])), 1e-12)  # dark steps show most of it
    if bend <= BENT:
        return None
    # of light that goes smoothly over one image, what shades it and the curve are not told apart
    both = [_curves(told, own[0].camera) for told in (seen, evened(own)) if told]
    curves = min(both, key=lambda some: some[0].left / some[0].range_ ** 2)
    best = curves[0]
    if bend <= BENT_BY_POWER and best.encoding.response not in NAMED:
        return None
    if _off_line(best.told) <= BETTER * best.left:
        return None
    right = best.left <= max(OWN * best.range_, HALF_A_CODE) ** 2
    return best.encoding if right else _bowed([c for c in curves if c.black == best.black], own)


def _bowed(curves: Sequence["_Curve"], own: Sequence[Condition]) -> Encoding:
    """Of the tables that curves are bowed into, which are alike where steps show them, the one whose dark is nearest to
    the captures'."""
    tables = [c.bowed(straight) for c in curves for straight in (False, True)]
    dark = in_the_dark(own)
    if dark is None:
        return tables[0]
    x, y = dark
    return min(tables, key=lambda t: abs(_dark_of(t, own[0].camera, x) - y))


def _dark_of(table: Encoding, camera: Camera, x: float) -> float:
    """Mean of what a camera gives of a signal, over its highest DN; noise among it."""
    sensor = table.of(camera).sensor
    linear = sensor.black_level + x * (2**sensor.bit_depth - 1 - sensor.black_level)
    curve = replace(ResponseCurve.of(table.of(camera)), bits_out=0)
    return float(cut.mean(np.array([linear]), sensor, curve)[0]) / (2**sensor.bit_depth - 1)


@dataclass(frozen=True, eq=False)
class _Curve:
    """An encoding, the mean square of what ``told`` is off it, and what it ``made`` of signals over the highest, by the
    gain that it has; ``black`` over the highest."""

    told: Steps
    left: float
    encoding: Encoding
    made: Callable[[np.ndarray], np.ndarray]
    black: float

    @property
    def range_(self) -> float:
        return float(np.ptp(self.told[1]))

    def bowed(self, straight: bool) -> Encoding:
        """That with what captures have beyond it, as a table; ``straight`` below the dimmest step, or as the curve."""
        x, y = self.told[0], _above(self.told, self.black)
        first = np.unique(x, return_index=True)[1]
        off = (y - self.made(x))[first]
        beyond = PchipInterpolator(np.append(0, x[first]), np.append(0, off))
        grid = np.linspace(0, 1, ENTRIES)
        table = np.clip(self.made(grid) + beyond(np.minimum(grid, x.max())), 0, 1)
        if straight:
            toe = grid < x.min()
            table[toe] = grid[toe] / x.min() * float(self.made(x.min()) + beyond(x.min()))
        lut = tuple(map(float, np.maximum.accumulate(table)))
        return replace(self.encoding, response=Response.LUT, gamma=LINE, lut=lut)


def _curves(told: Steps, camera: Camera) -> list[_Curve]:
    """Named curves and a power, with either black; the nearest first."""
    blacks = {True: 0.0, False: camera.sensor.black_level / (2**camera.sensor.bit_depth - 1)}
    found = []
    for off, black in blacks.items():
        found += [_named(told, Encoding(camera.name, off, response), black) for response in NAMED]
        found.append(_power(told, Encoding(camera.name, off, Response.LINEAR), black))
    return sorted(found, key=lambda c: c.left)


def _above(told: Steps, black: float) -> np.ndarray:
    """Captured signals above black, over their highest."""
    return (told[1] - black) / (1 - black)


def _named(told: Steps, encoding: Encoding, black: float) -> _Curve:
    """The curve that it names, by the best gain."""
    x, y, curve = told[0], _above(told, black), ResponseCurve(response=encoding.response).curve

    def made(log: float, x: np.ndarray) -> np.ndarray:
        return np.asarray(curve(np.clip(np.exp(log) * x, 0, 1)))

    def left(log: float) -> float:
        return float(np.square(y - made(log, x)).mean())

    near, step = min(GAINS, key=left), GAINS[1] - GAINS[0]
    solved = minimize_scalar(left, bounds=(near - step, near + step), method="bounded")
    return _Curve(told, float(solved.fun), encoding, partial(made, float(solved.x)), black)


def _power(told: Steps, encoding: Encoding, black: float) -> _Curve:
    """The power that leaves least; its σ by what it leaves."""
    x, y = told[0], _above(told, black)

    def made(gamma: float, x_of: np.ndarray) -> np.ndarray:
        power = x**gamma
        return float(power @ y) / max(float(power @ power), 1e-12) * np.asarray(x_of) ** gamma

    def left(log: float) -> float:
        return float(np.square(y - made(np.exp(log), x)).mean())

    solved = minimize_scalar(left, bounds=np.log(GAMMAS), method="bounded")
    gamma = float(np.exp(solved.x))
    by = np.stack([made(gamma, x), made(gamma, x) * np.log(np.maximum(x, 1e-9))], axis=1)
    variance = float(solved.fun) * len(x) / (len(x) - 2) * np.linalg.pinv(by.T @ by)[1, 1]
    own = replace(encoding, gamma=Estimate(gamma, float(np.sqrt(variance)), "1"))
    return _Curve(told, float(solved.fun), own, partial(made, gamma), black)


def _off_line(told: Steps) -> float:
    """Mean square of what captures are off a line."""
    line = np.stack([told[0], np.ones(len(told[0]))], axis=1)
    return float(np.square(told[1] - line @ np.linalg.lstsq(line, told[1], rcond=None)[0]).mean())
