"""How a path-traced image is made: what decides its noise, its length of paths and its seed."""

from dataclasses import asdict, dataclass, fields
from typing import Any

from interchange.parameter import freeze, parameter


@dataclass(frozen=True)
class CyclesSettings:
    """Hashable, and by ``as_dict`` JSON-able. Equal settings, scene and machine give equal bits."""

    samples: int = parameter(
        64, "N", "1", 1, 2**20, "light paths a pixel; with noise > 0 the most a pixel gets"
    )
    noise: float = parameter(
        0.0, "ε", "1", 0, 1, "relative noise at which a pixel is done; 0 gives all N samples"
    )
    seed: int = parameter(0, "s", "1", 0, 2**31 - 1, "start of the random numbers")
    max_bounces: int = parameter(
        6, "b", "1", 0, 128, "reflections after the first surface; 0 is direct light"
    )
    lamp_grid: int = parameter(2, "g", "1", 1, 4, "g² shadow rays to a lamp with extent at the first surface")
    denoise: int = parameter(0, "d", "1", 0, 1, "1: reflected light is denoised, which biases it locally")
    direct_samples: int = parameter(
        0, "N_d", "1", 0, 2**20, "where denoised: samples of direct light; 0: as many, at least 16"
    )
    threads: int = parameter(0, "t", "1", 0, 1024, "processor threads; 0 takes all")
    tile: int = parameter(2048, "p", "px", 8, 65536, "edge of the tiles in which a large image is made")

    def __post_init__(self) -> None:
        freeze(self)
        for f in fields(self):
            if f.name != "noise":
                object.__setattr__(self, f.name, round(getattr(self, f.name)))

    def as_dict(self) -> dict[str, Any]:
        return asdict(self)
