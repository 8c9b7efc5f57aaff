"""What a fit is free to change: unknowns, each over its declared bounds, that set the numbers of a BRDF.

    p = x, exp(x) or expm1(x)

A parameter that runs over magnitudes (a lobe exponent, a roughness) is found by its logarithm, so that a step and an
error bar are relative. One unknown may set several numbers: the three channels of a grey measurement, the widths along
tangent and bitangent where the samples do not tell directions on the surface apart.

Lafortune's lobe w (C·v)^n does not change with C -> s C, w -> s^-n w. The scale is fixed by the largest of |Cx|, |Cy|,
|Cz| being 1, so that ``weight`` is the lobe's largest value in 1/sr; that entry of C is then no unknown. Ngan et al.
2005 publish C of unit length and rho_s = weight 2 pi / (n + 2) of the same lobe (``from_published``).
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from typing import Any

import numpy as np

from interchange.brdf.base import Brdf
from interchange.brdf.lafortune import Lafortune
from interchange.parameter import Kind, Parameter, parameters
from interchange.problems import BrightfieldError, did_you_mean

WIDE = 100.0  # bounds this far apart are magnitudes
COLORS, AXES = ("R", "G", "B"), ("x", "y", "z")
ALONG, ACROSS = re.compile(r"_(x|u)$"), {"x": "y", "u": "v"}


class Scale(StrEnum):
    LINEAR = "linear"
    LOG = "log"
    LOG1P = "log1p"  # for a wide range that begins at 0

    def to(self, p: Any) -> Any:
        return p if self is Scale.LINEAR else np.log(p) if self is Scale.LOG else np.log1p(p)

    def back(self, x: Any) -> Any:
        return x if self is Scale.LINEAR else np.exp(x) if self is Scale.LOG else np.expm1(x)

    def slope(self, p: Any) -> Any:
        """∂p/∂x."""
        return np.ones_like(p) if self is Scale.LINEAR else p if self is Scale.LOG else p + 1.0


@dataclass(frozen=True)
class Unknown:
    """``places``: the numbers of ``brdf.flat()`` that it sets, all to one value within [low, high]."""

    name: str
    places: tuple[int, ...]
    low: float
    high: float
    scale: Scale
    color: bool  # belongs to a colour


@dataclass(frozen=True, eq=False)
class Chart:
    """The unknowns ``x`` (P,) of a fit: ``template`` holds what stays as it is. ``channels``: which are fitted."""

    template: Brdf
    unknowns: tuple[Unknown, ...]
    channels: tuple[int, ...]

    @cached_property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        low, high = (
            [u.scale.to(np.float64(getattr(u, end))) for u in self.unknowns] for end in ("low", "high")
        )
        return np.array(low, np.float64), np.array(high, np.float64)

    def values(self, x: np.ndarray) -> np.ndarray:
        """The parameters at ``x`` (P,), within their bounds."""
        p = [float(u.scale.back(v)) for u, v in zip(self.unknowns, x, strict=True)]
        return np.array([min(max(v, u.low), u.high) for u, v in zip(self.unknowns, p, strict=True)])

    def brdf(self, x: np.ndarray) -> Brdf:
        numbers = self.template.flat()
        for unknown, value in zip(self.unknowns, self.values(x), strict=True):
            for place in unknown.places:
                numbers[place] = float(value)
        return self.template.with_flat(numbers)

    def start(self) -> np.ndarray:
        """The unknowns of the template itself."""
        numbers = self.template.flat()
        p = [np.mean([numbers[i] for i in u.places]) for u in self.unknowns]
        x = np.array(
            [u.scale.to(np.clip(v, u.low, u.high)) for u, v in zip(self.unknowns, p, strict=True)], float
        )
        return np.clip(x, *self.bounds) if len(x) else x

    @cached_property
    def active(self) -> dict[int, tuple[list[int], np.ndarray]]:
        """By channel: the numbers of ``flat()`` that its formula reads, and which unknown each of them follows."""
        slots, owner = self.template.slots(), {p: k for k, u in enumerate(self.unknowns) for p in u.places}
        about = parameters(self.template)
        found: dict[int, tuple[list[int], np.ndarray]] = {}
        for channel in self.channels:
            places = []
            for name, slot in slots.items():
                own = slot[channel::3] if about[name].kind is Kind.COLOR else slot
                places += [p for p in own if p in owner]
            found[channel] = places, np.array([owner[p] for p in places], int)
        return found


def chart_of(
    template: Brdf, channels: Sequence[int] = (0, 1, 2), grey: bool = False, isotropic: bool = False,
    fixed: Sequence[str] = (),
) -> Chart:  # fmt: skip
    """The unknowns of a model about ``template``.

    ``grey``: the three channels are one. ``isotropic``: widths along tangent and bitangent are one. ``fixed``: names
    of parameters that stay as ``template`` has them.
    """
    held = scale_places(template, isotropic)
    unknowns: list[Unknown] = []
    about, slots = parameters(template), template.slots()
    for name, p in about.items():
        twin = _twin(name, about) if isotropic else ""
        if name in fixed or (isotropic and _is_twin(name, about)):
            continue
        lobes = template.lobes if p.per_lobe else 1
        for lobe in range(lobes):
            first = slots[name].start + lobe * p.kind.width
            own = list(range(first, first + p.kind.width))
            both = f"{name}={twin}" if twin else name
            label = f"{both}[{lobe}]" if p.per_lobe else both
            for tag, places in _groups(p, own, channels, grey, isotropic):
                if twin:
                    offset = slots[twin].start - slots[name].start
                    places = (*places, *(i + offset for i in places))
                if not held & set(places):
                    unknowns.append(
                        Unknown(label + tag, places, p.low, p.high, _scale(p), p.kind is Kind.COLOR)
                    )
    return Chart(template, tuple(unknowns), tuple(channels))


def _groups(
    p: Parameter, own: list[int], channels: Sequence[int], grey: bool, isotropic: bool
) -> list[tuple[str, tuple[int, ...]]]:
    match p.kind:
        case Kind.FLOAT:
            return [("", tuple(own))]
        case Kind.COLOR if grey:
            return [("", tuple(own))]
        case Kind.COLOR:
            return [(f".{COLORS[c]}", (own[c],)) for c in channels]
        case _ if isotropic:
            return [(".xy", (own[0], own[1])), (".z", (own[2],))]
        case _:
            return [(f".{axis}", (i,)) for axis, i in zip(AXES, own, strict=True)]


def _scale(p: Parameter) -> Scale:
    if p.low > 0 and p.high / p.low >= WIDE:
        return Scale.LOG
    return Scale.LOG1P if p.low == 0 and p.high >= WIDE and p.kind is Kind.FLOAT else Scale.LINEAR


def _twin(name: str, about: Mapping[str, Parameter]) -> str:
    """The parameter across for one along: alpha_y for alpha_x, n_v for n_u."""
    if not (found := ALONG.search(name)):
        return ""
    other = name[: found.start(1)] + ACROSS[found[1]]
    return other if other in about else ""


def _is_twin(name: str, about: Mapping[str, Parameter]) -> bool:
    return any(_twin(other, about) == name for other in about)


def scale_places(brdf: Brdf, isotropic: bool = False) -> set[int]:
    """The numbers that are held because another parameter does the same: the largest entry of each Lafortune C (Cx and
    Cy together for an isotropic lobe)."""
    if not isinstance(brdf, Lafortune):
        return set()
    places, first = set(), brdf.slots()["C"].start
    for lobe, c in enumerate(brdf.C):
        largest = int(np.argmax(np.abs(c)))
        places |= {first + 3 * lobe + k for k in ((0, 1) if isotropic and largest < 2 else (largest,))}
    return places


def normalised(brdf: Brdf) -> Brdf:
    """The same reflectance with every Lafortune lobe's largest |C| entry at 1, as far as ``weight`` stays in bounds."""
    if not isinstance(brdf, Lafortune):
        return brdf
    weights, cs = [], []
    for w, c, n in zip(brdf.weight, brdf.C, brdf.n, strict=True):
        largest = max(map(abs, c))
        with np.errstate(over="ignore"):
            scaled = np.asarray(w) * np.power(largest, n)
        fits = largest > 0 and scaled.max() <= parameters(brdf)["weight"].high
        weights.append(tuple(scaled) if fits else w)
        cs.append(tuple(np.asarray(c) / largest) if fits else c)
    return replace(brdf, weight=tuple(weights), C=tuple(cs))


def from_published(
    diffuse: tuple[float, float, float], rho_s: tuple[float, float, float], Cxy: float, Cz: float, n: float
) -> Lafortune:
    """One isotropic lobe in Ngan's convention: f = rho_d / pi + rho_s (n + 2) / (2 pi max(|Cxy|, Cz)^n) (C·v)^n.

    Lafortune et al. 1997, eq. 3 and 4: rho_s is then the lobe's albedo at normal incidence where Cz is the largest.
    """
    largest = max(abs(Cxy), abs(Cz))
    weight = tuple(r * (n + 2) / (2 * np.pi) for r in rho_s)
    return Lafortune(diffuse, (weight,), ((Cxy / largest, Cxy / largest, Cz / largest),), (n,))  # type: ignore[arg-type]


def with_fixed(brdf: Brdf, fixed: Mapping[str, float]) -> Brdf:
    """``brdf`` with parameters set by name. Raises BrightfieldError for a name that it does not have."""
    numbers, slots = brdf.flat(), brdf.slots()
    for name, value in fixed.items():
        if name not in slots:
            raise BrightfieldError(
                f"{type(brdf).__name__} has no parameter {name}.{did_you_mean(name, slots)} It has {', '.join(slots)}."
            )
        for place in slots[name]:
            numbers[place] = value
    return brdf.with_flat(numbers)
