"""Which causes there are, where they can be seen, and by lot: their form, their shape, what they are about.

``OUTSIDE`` are those that no catalogue names. ``TIED``: causes that no capture of these plans tells apart.
"""

from dataclasses import asdict, dataclass

import numpy as np

from benchmarks.blind.bench import Bench, Lamp
from benchmarks.blind.chain import Cause

EVERYWHERE = ("rich", "metal", "plate", "board", "sample")
EDGES = ("rich", "metal", "board", "sample")
GLOSSY = {"rich": ("metal", "plastic"), "metal": ("steel", "brass"), "board": ("tin",),
          "sample": ("metal", "plastic")}  # fmt: skip
PAINTED = {"rich": ("base", "card", "white"), "metal": ("cloth", "tag", "steel"), "plate": ("paint",),
           "board": ("varnish", "tray", "plug"), "sample": ("base", "white", "red")}  # fmt: skip
STAINED = {"rich": ("base",), "metal": ("cloth",), "plate": ("paint",), "board": ("tray", "varnish"),
           "sample": ("base",)}  # fmt: skip
MOVED = {"rich": ("box", "rod", "wall"), "metal": ("block",), "board": ("chip", "plug", "can"),
         "sample": ("bracket", "pin", "ball")}  # fmt: skip
HIGHER = {"rich": ("box", "rod", "wall"), "metal": ("boss",), "board": ("plug", "can", "chip"),
          "sample": ("bracket", "pin", "wall_b")}  # fmt: skip
SOFT = {"rich": ("white", "card"), "board": ("plug", "varnish"), "sample": ("white", "base")}

SEEN: dict[str, tuple[str, ...]] = {
    "vignetting": EVERYWHERE, "veiling_glare": EDGES, "exposure": EVERYWHERE, "white_balance": EVERYWHERE,
    "response_curve": EVERYWHERE, "black_level": EVERYWHERE, "color_crosstalk": ("rich", "board", "sample"),
    "saturation": ("rich", "metal", "sample"), "lens_distortion": EDGES, "principal_point": EDGES,
    "lateral_chromatic_aberration": EDGES, "defocus": EDGES, "motion_blur": EDGES, "camera_pose": EDGES,
    "object_pose": EDGES, "geometry": EDGES, "light_position": EVERYWHERE, "light_intensity": EVERYWHERE,
    "light_spectrum": EVERYWHERE, "light_beam": EVERYWHERE, "light_size": EDGES, "ambient_light": EVERYWHERE,
    "albedo": EVERYWHERE, "gloss": EDGES, "texture": EVERYWHERE, "interreflection": ("rich", "metal", "sample"),
    "anisotropy": ("metal",),
}  # fmt: skip
OUTSIDE: dict[str, tuple[str, ...]] = {
    "ghost": EVERYWHERE, "dirt": EVERYWHERE, "stripes": EVERYWHERE, "moire": EVERYWHERE, "tone_map": EDGES,
    "sharpening": EDGES, "occluder": EVERYWHERE, "extra_lamp": EVERYWHERE, "subsurface": ("rich", "board", "sample"),
}  # fmt: skip
NOISE = ("sensor_noise", "fixed_pattern", "quantization")
# what may be said of an outside cause besides "unknown": a name of the contract that is right too
ALSO = {"occluder": ("shadow",), "subsurface": ("translucency",)}
TIED = (
    ("exposure",),
    ("white_balance", "light_spectrum"),
    ("camera_pose", "principal_point"),
    ("fixed_pattern", "sensor_noise"),
)
PAIRS = (
    ("vignetting", "light_beam"), ("black_level", "veiling_glare"), ("response_curve", "exposure"),
    ("defocus", "motion_blur"), ("albedo", "light_intensity"), ("lens_distortion", "lateral_chromatic_aberration"),
    ("ambient_light", "black_level"), ("vignetting", "veiling_glare"), ("gloss", "light_size"),
    ("light_position", "vignetting"), ("object_pose", "camera_pose"), ("white_balance", "color_crosstalk"),
    ("texture", "vignetting"), ("interreflection", "ambient_light"), ("defocus", "veiling_glare"),
    ("vignetting", "response_curve"), ("light_intensity", "black_level"), ("albedo", "ambient_light"),
)  # fmt: skip
TRIPLES = (
    ("vignetting", "defocus", "black_level"), ("light_position", "vignetting", "response_curve"),
    ("lateral_chromatic_aberration", "veiling_glare", "albedo"), ("ambient_light", "vignetting", "white_balance"),
)  # fmt: skip


@dataclass(frozen=True)
class Proposal:
    """A cause without its amplitude, which lies in [``low``, ``high``]."""

    cause: Cause
    low: float
    high: float
    start: float  # about what gives one per cent


def _pick(rng: np.random.Generator, options: tuple[str, ...]) -> str:
    return str(options[int(rng.integers(len(options)))])


def _sign(rng: np.random.Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))


def _unit(rng: np.random.Generator, n: int = 3) -> list[float]:
    v = rng.standard_normal(n)
    return [float(x) for x in v / np.linalg.norm(v)]


def _beside(rng: np.random.Generator) -> dict[str, float]:
    return {"x": float(rng.normal(0, 0.03)), "y": float(rng.normal(0, 0.03))}


def propose(name: str, bench: Bench, rng: np.random.Generator) -> Proposal:
    """By lot. ``bench``: the scene that it happens in."""
    at, lamps = bench.name, tuple(x.name for x in bench.lamps)
    well = bench.sensor.full_well

    def p(form: str, low: float, high: float, start: float, place: str = "", **shape: object) -> Proposal:
        return Proposal(Cause(name, form, 0.0, dict(shape), place), low, high, start)

    match name:
        case "vignetting":
            if rng.random() < 0.5:
                return p("cosine power", 1e-3, 20, 0.25, **_beside(rng))
            return p("mechanical", 1e-4, 0.95, 0.04, **_beside(rng))
        case "veiling_glare":
            return p(
                "power law", 1e-4, 0.6, 0.04, r0=float(rng.uniform(0.05, 0.2)), p=float(rng.uniform(1.1, 1.5))
            )
        case "exposure":
            return p("gain", 1e-4, 0.5, 0.01, sign=_sign(rng))
        case "white_balance":
            k = _sign(rng)
            return p("colour gains", 1e-4, 0.5, 0.01, red=k, blue=-k * float(rng.uniform(0.5, 1)))
        case "response_curve":
            if rng.random() < 0.5:
                return p("Naka-Rushton", 1e-4, 3, 0.02)
            return p("quadratic", 1e-4, 0.9, 0.02, sign=_sign(rng))
        case "black_level":
            return p("offset ramp", 1e-5, 0.3, 0.003, sign=_sign(rng), well=well)
        case "color_crosstalk":
            return p("diffusion", 1e-4, 0.4, 0.05, blue=float(rng.uniform(0.6, 1.4)))
        case "saturation":
            return p("soft well", 1e-3, 6, 0.5, well=well)
        case "lens_distortion":
            return p("division", 1e-5, 0.3, 0.004, sign=_sign(rng))
        case "principal_point":
            return p("offset", 1e-6, 0.02, 0.0007, angle=float(rng.uniform(0, 2 * np.pi)))
        case "lateral_chromatic_aberration":
            k = _sign(rng)
            shape = {"red": k, "blue": -k * float(rng.uniform(0.5, 1)), **_beside(rng)}
            return p("wedge colours", 1e-6, 0.05, 0.002, **shape)
        case "defocus":
            if rng.random() < 0.5:
                return p("pillbox", 0.05, 8, 0.7)
            return p("two Gaussians", 0.02, 6, 0.4, share=float(rng.uniform(0.1, 0.25)))
        case "motion_blur":
            return p(
                "smear", 0.1, 12, 1.2, angle=float(rng.uniform(0, np.pi)), speed=float(rng.uniform(0.2, 0.5))
            )
        case "camera_pose":
            return p("camera_pose", 1e-3, 20, 0.4, turn=_unit(rng), shift=_unit(rng))
        case "object_pose":
            angle, turn = float(rng.uniform(0, 2 * np.pi)), _sign(rng)
            return p("object_pose", 1e-2, 20, 0.6, _pick(rng, MOVED[at]), angle=angle, turn=turn)
        case "geometry":
            return p("geometry", 1e-3, 0.6, 0.03, _pick(rng, HIGHER[at]), sign=_sign(rng))
        case "light_position":
            return p("light_position", 1e-2, 60, 3, _pick(rng, lamps), direction=_unit(rng))
        case "light_intensity":
            return p("one lamp", 1e-3, 0.8, 0.03, _pick(rng, lamps), sign=_sign(rng))
        case "light_spectrum":
            k = _sign(rng)
            color = [k, 0.0, -k * float(rng.uniform(0.6, 1.2))]
            return p("one lamp's colour", 1e-3, 0.8, 0.03, _pick(rng, lamps), color=color)
        case "light_beam":
            return p("light_beam", 1e-3, 0.42, 0.1, second=float(rng.uniform(-0.1, 0.1)))
        case "light_size":
            return p("light_size", 0.5, 40, 6)
        case "ambient_light":
            return p("sky", 1e-4, 5, 0.1, color=[float(x) for x in rng.uniform(0.6, 1.4, 3)])
        case "albedo":
            k = _sign(rng)
            color = [float(k * x) for x in rng.uniform(0.5, 1, 3)]
            return p("albedo", 1e-3, 0.28, 0.02, _pick(rng, PAINTED[at]), color=color)
        case "gloss":
            return p("gloss", 1e-2, 1.6, 0.2, _pick(rng, GLOSSY[at]), sign=_sign(rng))
        case "anisotropy":
            return p("anisotropy", 1e-3, 0.4, 0.05, "steel")
        case "texture":
            place = _pick(rng, STAINED[at])
            seed, waves = int(rng.integers(1 << 31)), float(rng.uniform(3, 8))
            return p("texture", 1e-3, 0.25, 0.012, place, seed=seed, waves=waves)
        case "interreflection":
            return p("bounces", 1e-2, 6, 0.3, sign=1.0)
        case "ghost":
            return p(
                "ghost", 1e-4, 0.4, 0.01, scale=float(rng.uniform(0.8, 1.2)), blur=float(rng.uniform(1, 4))
            )
        case "dirt":
            spots = [
                [float(v) for v in (*rng.uniform(-0.6, 0.6, 2), rng.uniform(0.05, 0.2), rng.uniform(0.5, 1))]
                for _ in range(int(rng.integers(1, 5)))
            ]
            return p("dirt", 1e-3, 1, 0.06, spots=spots)
        case "stripes":
            waves, angle = float(rng.uniform(20, 90)), float(rng.uniform(0, 6))
            return p("stripes", 1e-4, 0.3, 0.008, waves=waves, angle=angle, rows=bool(rng.random() < 0.5))
        case "moire":
            u, v = (float(x) for x in rng.uniform(25, 120, 2))
            return p("moire", 1e-4, 0.4, 0.012, u=u, v=v)
        case "tone_map":
            return p("tone map", 1e-3, 1, 0.03, radius=float(rng.uniform(0.04, 0.15)))
        case "sharpening":
            return p("sharpen", 1e-2, 4, 0.3, radius=float(rng.uniform(0.7, 1.6)))
        case "occluder":
            lamp = bench.lamps[int(rng.integers(len(bench.lamps)))]
            target = np.array([*rng.uniform(-60, 60, 2), 0.0])
            where = target + 0.86 * (np.array(lamp.position) - target)
            return p("occluder", 0.3, 45, 5, lamp.name, at=[float(x) for x in where])
        case "extra_lamp":
            angle = rng.uniform(0, 2 * np.pi)
            where = (float(300 * np.cos(angle)), float(300 * np.sin(angle)), float(rng.uniform(120, 400)))
            color = [float(x) for x in np.sort(rng.uniform(0.6, 1.2, 3))[::-1]]
            return p("extra lamp", 1e-4, 2, 0.02, lamp=asdict(Lamp("extra", where, 4.0, 30.0)), color=color)
        case "subsurface":
            return p("translucent", 1e-2, 1, 0.4, _pick(rng, SOFT[at]), reach=float(rng.uniform(1, 3)))
        case "sensor_noise":
            form = _pick(rng, ("read noise", "gain error"))
            return p(form, 0, 100, 4.0 if form == "read noise" else 0.08)
        case "fixed_pattern":
            form = _pick(rng, ("uneven pixels", "uneven columns"))
            return p(form, 0, 1, 0.01 if form == "uneven pixels" else 0.002, seed=int(rng.integers(1 << 31)))
        case "quantization":
            return p("steps", 0, 1, float(1 / 2 ** rng.integers(6, 9)))
    raise KeyError(name)


def parameters(cause: Cause, bench: Bench) -> dict[str, float]:
    """Values under the names that a diagnosis gives them, where they mean the same thing."""
    a, s, K = cause.amplitude, cause.shape, bench.sensor.K
    match cause.form:
        case "gain":
            return {"scale": 1 + s["sign"] * a}
        case "one lamp":
            return {f"{cause.place} scale": 1 + s["sign"] * a}
        case "light_position":
            return {f"{cause.place} {x}": a * d for x, d in zip("xyz", s["direction"], strict=True)}
        case "colour gains":
            return {"red": 1 + a * s["red"], "blue": 1 + a * s["blue"]}
        case "offset ramp":
            return {"black_level": bench.sensor.black + s["sign"] * a * s["well"] * K}
        case "albedo":
            return {f"{cause.place} {c}": 1 + a * x for c, x in zip("RGB", s["color"], strict=True)}
        case "bounces":
            return {"scale": 1 + s["sign"] * a}
    return {}
