"""Causes by lot, in the forms of this folder where it has any. Who writes the diagnosis does not read this folder.

``OUTSIDE``: what no catalogue names, under names that say nothing, and the scenes that can show it.
"""

import numpy as np

from benchmarks.blind import proposals as first
from benchmarks.blind.bench import Bench
from benchmarks.blind.cause import Cause
from benchmarks.blind.proposals import Proposal

OUTSIDE: dict[str, tuple[str, ...]] = {
    "apart_1": first.EVERYWHERE, "apart_2": first.EDGES, "apart_3": first.EDGES, "apart_4": first.EVERYWHERE,
    "apart_5": first.EVERYWHERE,
}  # fmt: skip


def _uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(rng.uniform(low, high))


def _sign(rng: np.random.Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))


def _unit(rng: np.random.Generator) -> list[float]:
    v = rng.standard_normal(3)
    return [float(x) for x in v / np.linalg.norm(v)]


def _one(rng: np.random.Generator, options: tuple[str, ...]) -> str:
    return str(options[int(rng.integers(len(options)))])


def propose(name: str, bench: Bench, rng: np.random.Generator) -> Proposal:
    """By lot; as the first way does it where a cause has no other form."""
    found = _lens(name, rng) or _sensor(name, bench, rng) or _scene(name, bench, rng) or _outside(name, rng)
    return found or first.propose(name, bench, rng)


def _p(
    name: str, form: str, low: float, high: float, start: float, place: str = "", **shape: object
) -> Proposal:
    return Proposal(Cause(name, f"apart {form}", 0.0, dict(shape), place), low, high, start)


def _lens(name: str, rng: np.random.Generator) -> Proposal | None:
    angle, half = _uniform(rng, 0, 2 * np.pi), rng.random() < 0.5
    beside = {
        "x": float(rng.normal(0, 0.04)), "y": float(rng.normal(0, 0.04)), "squeeze": _uniform(rng, 0.95, 1.05)
    }  # fmt: skip
    match name:
        case "vignetting":
            if half:
                return _p(name, "rim", 1e-4, 0.95, 0.08, **{"from": _uniform(rng, 0.3, 0.55)}, **beside)
            return _p(name, "bell", 1e-4, 3, 0.04, power=_uniform(rng, 2.3, 3.5), **beside)
        case "veiling_glare":
            shape = {k: _uniform(rng, *v) for k, v in (("r0", (0.04, 0.15)), ("even", (0.3, 0.7)))}
            return _p(name, "barrel", 1e-4, 0.7, 0.04, kept=_uniform(rng, 0.6, 0.95), **shape)
        case "defocus":
            if half:
                shape = {"blades": int(rng.integers(5, 8)), "angle": angle, "rim": _uniform(rng, -0.5, 0.5)}
                return _p(name, "blades", 0.05, 8, 0.8, **shape)
            return _p(name, "curved", 0.05, 8, 0.6, zone=_uniform(rng, -0.5, 0.05))
        case "motion_blur":
            if half:
                return _p(name, "vibration", 0.05, 6, 0.6, angle=angle, flat=_uniform(rng, 0.0, 0.35))
            return _p(name, "settling", 0.1, 16, 1.5, angle=angle, rate=_uniform(rng, 1.0, 3.0))
        case "lens_distortion":
            return _p(name, "fov", 1e-5, 0.6, 0.01, sign=_sign(rng))
        case "lateral_chromatic_aberration":
            k = _sign(rng)
            shape = {"red": k, "blue": -k * _uniform(rng, 0.4, 1.1), "angle": angle}
            zone, plate = _uniform(rng, 0.2, 0.9), _uniform(rng, 0.0, 0.1)
            return _p(name, "zones", 1e-6, 0.08, 0.003, zone=zone, plate=plate, **shape)
    return None


def _sensor(name: str, bench: Bench, rng: np.random.Generator) -> Proposal | None:
    well, half = bench.sensor.full_well, rng.random() < 0.5
    match name:
        case "exposure" if half:
            return _p(name, "shutter", 1e-5, 0.08, 0.003, sign=_sign(rng))
        case "response_curve":
            if half:
                return _p(name, "running_out", 1e-3, 6, 0.04)
            return _p(name, "bent", 1e-3, 1.2, 0.05, sign=_sign(rng), zero=_uniform(rng, 0.35, 0.75))
        case "saturation":
            return _p(name, "drain", 1e-3, 8, 0.6, well=well, soft=_uniform(rng, 0.03, 0.15))
        case "color_crosstalk":
            # neighbours in the spectrum, and a little red for blue
            M = rng.uniform(0.3, 1.0, (3, 3)) * np.array([[0, 1, 0.15], [0.8, 0, 0.8], [0.15, 1, 0]])
            slope, angle = _uniform(rng, 0, 0.3), _uniform(rng, 0, 2 * np.pi)
            return _p(name, "leak", 1e-4, 0.35, 0.05, matrix=M.tolist(), slope=slope, angle=angle)
        case "black_level":
            colors = [float(x) for x in rng.uniform(0.92, 1.08, 3)]
            shape = {"halves": float(rng.normal(0, 0.04)), "dark": _uniform(rng, 0, 0.1), "colors": colors}
            return _p(name, "taps", 1e-5, 0.3, 0.003, sign=_sign(rng), well=well, **shape)
    return None


def _scene(name: str, bench: Bench, rng: np.random.Generator) -> Proposal | None:
    at, lamps = bench.name, tuple(x.name for x in bench.lamps)
    angle = _uniform(rng, 0, 2 * np.pi)
    match name:
        case "light_beam":
            aim = [*(float(x) for x in rng.normal(0, 15, 2)), 0.0]
            if rng.random() < 0.5:
                return _p(name, "narrow", 1e-3, 4, 0.25, aim=aim)
            return _p(name, "wings", 1e-3, 3, 0.25, aim=aim)
        case "ambient_light":
            warm = _uniform(rng, -0.3, 0.3)
            side = [0.8 * np.cos(angle), 0.8 * np.sin(angle), 0.6]
            shape = {"side": [float(x) for x in side], "lean": _uniform(rng, 0.3, 0.7)}
            return _p(name, "window", 1e-4, 5, 0.1, color=[1 + warm, 1.0, 1 - warm], **shape)
        case "texture":
            seed = int(rng.integers(1 << 31))
            return _p(name, "patches", 1e-3, 0.4, 0.015, _one(rng, first.STAINED[at]), seed=seed, grain=angle)
        case "light_position":
            return _p(name, "frame", 1e-2, 40, 2, direction=_unit(rng))
        case "light_size":
            return _p(name, "one_wide", 0.5, 45, 10, _one(rng, lamps))
        case "gloss":
            return _p(name, "peak", 1e-2, 1.6, 0.15, _one(rng, first.GLOSSY[at]), sign=_sign(rng))
        case "object_pose":
            return _p(name, "tipped", 1e-2, 12, 0.8, _one(rng, first.MOVED[at]), angle=angle)
        case "geometry":
            return _p(name, "swollen", 1e-3, 0.5, 0.03, _one(rng, first.HIGHER[at]), sign=_sign(rng))
        case "camera_pose":
            arm = [0.0, _uniform(rng, -120, -40), _uniform(rng, -160, -60)]
            return _p(name, "sagged", 1e-3, 20, 0.5, eye=int(rng.integers(2)), turn=_unit(rng), arm=arm)
    return None


def _outside(name: str, rng: np.random.Generator) -> Proposal | None:
    angle = _uniform(rng, 0, 2 * np.pi)
    match name:
        case "apart_1":
            wedge, bow = _uniform(rng, 1.5, 6), _uniform(rng, -4, 4)
            return _p(name, "rings", 1e-4, 0.4, 0.012, angle=angle, wedge=wedge, bow=bow)
        case "apart_2":
            x, y = (_uniform(rng, -0.5, 0.5) for _ in range(2))
            shape = {"size": _uniform(rng, 0.25, 0.5), "reach": _uniform(rng, 0.02, 0.06)}
            return _p(name, "mist", 1e-3, 1, 0.12, x=x, y=y, **shape)
        case "apart_3":
            return _p(name, "transfer", 1e-5, 0.2, 0.004)
        case "apart_4":
            return _p(name, "lag", 1e-4, 0.3, 0.01)
        case "apart_5":
            periods, phase, beat = _uniform(rng, 2, 9), angle, _uniform(rng, 0.5, 5.5)
            return _p(name, "mains", 1e-4, 0.3, 0.015, periods=periods, phase=phase, beat=beat)
    return None


def parameters(cause: Cause, bench: Bench) -> dict[str, float]:
    """Values under the names that a diagnosis gives them, where they mean the same thing."""
    a, s, K = cause.amplitude, cause.shape, bench.sensor.K
    match cause.form:
        case "apart taps":
            return {"black_level": bench.sensor.black + s["sign"] * a * s["well"] * K}
        case "apart frame":
            return {
                f"{x.name} {axis}": a * d
                for x in bench.lamps
                for axis, d in zip("xyz", s["direction"], strict=True)
            }
    return first.parameters(cause, bench)
