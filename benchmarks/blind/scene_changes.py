"""A scene with one of its materials, lamps or parts changed."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from benchmarks.blind.bench import Bench, Matter, Part


def of_matter(bench: Bench, name: str, change: Callable[[Matter], Matter]) -> Bench:
    return replace(bench, matters=tuple(change(m) if m.name == name else m for m in bench.matters))


def of_lamps(bench: Bench, place: str, **changes: Callable[[object], object]) -> Bench:
    def changed(lamp):  # type: ignore[no-untyped-def]
        if place and lamp.name != place:
            return lamp
        return replace(lamp, **{k: f(lamp) for k, f in changes.items()})

    return replace(bench, lamps=tuple(changed(x) for x in bench.lamps))


def of_part(bench: Bench, place: str, change: Callable[[np.ndarray], np.ndarray]) -> Bench:
    """Of a body of several parts (all have as many poses) all go together."""
    body = next(p for p in bench.parts if p.name == place)

    def one(p: Part) -> Part:
        mine = p.name == place or (len(body.poses) > 1 and len(p.poses) == len(body.poses))
        return replace(p, poses=tuple(change(M) for M in p.poses)) if mine else p

    return replace(bench, parts=tuple(one(p) for p in bench.parts))
