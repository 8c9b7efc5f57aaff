"""How the samples of a pixel are shared out between passes over the geometry."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Schedule:
    """``passes`` over the geometry of ``grid``² samples a pixel, each lit in ``rounds`` from as many points of every
    lamp that has an extent."""

    passes: int
    grid: int
    rounds: int


def schedule(samples: int, extended: bool, depth_of_field: bool) -> Schedule:
    """Four samples to a pass where they may share the spot of the lens, since the geometry costs the most."""
    if depth_of_field or samples % 4:
        return Schedule(samples, 1, 1)
    return Schedule(samples // 4, 2, 4 if extended else 1)
