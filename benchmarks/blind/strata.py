"""Which cases a set has: nulls, singles by severity (stratum "camera": of one camera alone), pairs, triples, causes
outside the catalogue, stress, noise."""

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from benchmarks.blind.apart.proposals import OUTSIDE as APART_OUTSIDE
from benchmarks.blind.errors import SHARE
from benchmarks.blind.proposals import NOISE, OUTSIDE, PAIRS, SEEN, TRIPLES

SHARES = {"null": 120, "single": 240, "pair": 90, "triple": 20, "outside": 90, "stress": 60, "noise": 20}
SEVERITIES = (0.005, 0.01, 0.02, 0.04)
BALANCES = ((0.01, 0.01), (0.02, 0.02), (0.02, 0.01), (0.02, 0.005))
# What moves edges: at the declared registration of 0.05 px an image is already 1 % off, and less than four times a
# tolerance cannot be told from it, whoever looks. These causes are as many times as strong.
MOVES = ("camera_pose", "object_pose", "geometry", "principal_point", "lens_distortion", "light_position")
STRONGER = 4.0
OF_A_CAMERA = (
    "vignetting", "defocus", "lens_distortion", "veiling_glare", "response_curve", "black_level", "exposure",
    "white_balance", "color_crosstalk", "motion_blur",
)  # fmt: skip  # what a camera has alone, stratum "camera"
SCENES = ("rich", "metal", "plate", "board", "sample")


@dataclass(frozen=True)
class Plan:
    """A case before it is made. ``scale``: calibration errors over what is declared; ``filter`` of a pixel."""

    case: str
    stratum: str
    scene: str
    world: int
    effects: tuple[tuple[str, float], ...]  # name, severity
    seed: int
    scale: float = 1.0
    filter: str = "box"
    repeats: int = 4
    apart: bool = False  # errors and forms of apart/
    eye: int | None = None  # the camera that alone has the causes


def counts(cases: int) -> dict[str, int]:
    """Cases by stratum in the proportions of ``SHARES``; they add up to ``cases``."""
    total = sum(SHARES.values())
    exact = {k: cases * v / total for k, v in SHARES.items()}
    out = {k: int(v) for k, v in exact.items()}
    for k in sorted(exact, key=lambda k: out[k] - exact[k])[: cases - sum(out.values())]:
        out[k] += 1
    return out


def plans(
    cases: int, seed: int, worlds: int, severities: tuple[float, ...] = SEVERITIES,
    shares: dict[str, int] | None = None, scenes: tuple[str, ...] = SCENES, apart: float = 0.0,
) -> list[Plan]:  # fmt: skip
    """In an order, and under names, that say nothing. ``apart``: share of the cases of each stratum."""
    rng = np.random.default_rng(seed)
    found: list[tuple[str, tuple[tuple[str, float], ...], str]] = []
    for stratum, n in (shares or counts(cases)).items():
        found += [(stratum, *x) for x in _stratum(stratum, n, severities, rng, scenes)]
    ids: list[str] = []
    while len(ids) < len(found):
        name = f"{int(rng.integers(1 << 32)):08x}"
        if name not in ids:
            ids.append(name)
    out = []
    for name, (stratum, effects, scene) in zip(ids, found, strict=True):
        stress = stratum == "stress"
        gaussian = stress and rng.random() < 0.25
        out.append(
            Plan(
                name, stratum, scene, int(rng.integers(worlds)), effects, int(rng.integers(1 << 62)),
                scale=2 / SHARE if stress and not gaussian else 1.0,
                filter="Gaussian" if gaussian else "box", repeats=int(rng.choice([2, 4, 8], p=[0.25, 0.5, 0.25])),
                eye=int(rng.integers(2)) if stratum == "camera" else None,
            )
        )  # fmt: skip
    return sorted(_set_apart(out, apart, np.random.default_rng([seed, 1])), key=lambda p: p.case)


def _set_apart(plans: list[Plan], share: float, rng: np.random.Generator) -> list[Plan]:
    """By lot, ``share`` of each stratum; causes outside the catalogue are that way's own, all as often."""
    out = list(plans)
    used = dict.fromkeys(APART_OUTSIDE, 0)

    def renamed(name: str, scene: str) -> str:
        if name not in OUTSIDE:
            return name
        fitting = [n for n, seen in APART_OUTSIDE.items() if scene in seen]
        chosen = str(min(rng.permutation(fitting), key=lambda n: used[n]))
        used[chosen] += 1
        return chosen

    for stratum in dict.fromkeys(p.stratum for p in plans):
        of = [k for k, p in enumerate(plans) if p.stratum == stratum]
        for k in rng.permutation(of)[: int(share * len(of) + rng.random())]:
            p = plans[k]
            out[k] = replace(p, effects=tuple((renamed(n, p.scene), s) for n, s in p.effects), apart=True)
    return out


def _fit(names: tuple[str, ...], scenes: tuple[str, ...]) -> list[str]:
    """The scenes in which all of them can be seen."""
    return [s for s in scenes if all(s in (SEEN.get(n) or OUTSIDE.get(n) or SCENES) for n in names)]


def _where(rng: np.random.Generator, names: tuple[str, ...], used: dict[str, int]) -> str:
    """Of the scenes in which all of them can be seen, the one that had the fewest cases of the stratum."""
    chosen = str(min(rng.permutation(_fit(names, tuple(used))), key=lambda s: used[s]))
    used[chosen] += 1
    return chosen


def _turns(rng: np.random.Generator, options: list[tuple[tuple[str, float], ...]], n: int) -> list[tuple]:
    """All options in turn, shuffled each time round. Raises ValueError where there is none to take."""
    if n and not options:
        raise ValueError(
            "a stratum has no cause of these severities; those outside the catalogue stay below 4 %"
        )
    out: list[tuple] = []
    while len(out) < n:
        out += [options[k] for k in rng.permutation(len(options))]
    return out[:n]


def _stratum(
    stratum: str, n: int, severities: tuple[float, ...], rng: np.random.Generator, scenes: tuple[str, ...]
) -> list[tuple[tuple[tuple[str, float], ...], str]]:
    if stratum == "null":
        return [((), scenes[k % len(scenes)]) for k in range(n)]
    if stratum == "single":
        options = [((name, s),) for name, s in product(SEEN, severities)]
    elif stratum == "camera":
        options = [((name, s),) for name, s in product(OF_A_CAMERA, severities)]
    elif stratum == "pair":
        balances = BALANCES if len(severities) > 2 else tuple((s, s) for s in severities)
        options = [((a, s), (b, t)) for (a, b), (s, t) in product(PAIRS, balances)]
    elif stratum == "triple":
        options = [tuple((name, 0.015) for name in names) for names in TRIPLES]
    elif stratum == "outside":
        options = [((name, s),) for name, s in product(OUTSIDE, [s for s in severities if s < 0.04])]
    elif stratum == "stress":
        options = [*(((name, 0.01),) for name in SEEN), *[()] * len(SEEN)]
    else:
        options = [((name, 0.0),) for name in NOISE]
    options = [c for c in options if _fit(tuple(name for name, _ in c), scenes)]
    chosen = _turns(rng, options, n)
    used = dict.fromkeys(scenes, 0)
    chosen = [tuple((name, s * (STRONGER if name in MOVES else 1.0)) for name, s in c) for c in chosen]
    return [(c, _where(rng, tuple(name for name, _ in c), used)) for c in chosen]
