"""One image a lamp, against as many whole renders, at equal noise: ``python benchmarks/per_light.py [LAMPS]``.

Noise is that of the lamps' images, from the difference of two seeds. Time is that of the
rendering calls, both ways from a warm worker; cost = time · noise² (time to reach the same noise), ratios of cost.
"""

import sys
import time
from dataclasses import replace

import numpy as np

from benchmarks.cycles import at, camera, scene
from interchange.brdf.lambert import Lambert
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.scene import Body, Scene
from offline.renderers.cycles import Cycles
from offline.settings import CyclesSettings

SAMPLES, SIZE = 64, (160, 120)


def ring(count: int) -> Scene:
    """A ring of LEDs of 3 mm over a part on a ground with a wall, which reflect light onto each other."""
    base = scene()
    wall = np.eye(4)
    wall[:3, :3] = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]
    wall[:3, 3] = -0.7, 0, 0.5
    lamps = []
    for k in range(count):
        a = 2 * np.pi * k / count
        lamps.append(
            Light(
                f"/led{k}",
                LightKind.SPHERE,
                (0.1, 0.1, 0.1),
                at(0.5 * np.cos(a), 0.5 * np.sin(a), 0.9),
                radius=1.5e-3,
            )
        )
    bodies = (
        *base.bodies,
        Body("/wall", base.bodies[0].mesh, Material("wall", Lambert((0.7, 0.4, 0.3))), wall),
    )
    return Scene(bodies, tuple(lamps))


def noise(a: np.ndarray, b: np.ndarray) -> float:
    """One standard deviation of a pixel over the mean, from the mean difference of two seeds (which stray bright
    pixels sway less than the rms)."""
    return float(np.mean(np.abs(a - b)) * np.sqrt(np.pi) / 2 / a.mean())


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 24
    whole, view = ring(count), camera(20, *SIZE)
    settings = CyclesSettings(samples=SAMPLES, max_bounces=3)
    spent = {"per light": 0.0, "whole": 0.0}
    stacks: dict[str, list[np.ndarray]] = {"per light": [], "whole": []}
    with Cycles() as cycles:
        cycles.render(whole, view, replace(settings, samples=1))
        for seed in (0, 1):
            began = time.perf_counter()
            image = cycles.render(whole, view, replace(settings, seed=seed), per_light=True)
            spent["per light"] += time.perf_counter() - began
            stacks["per light"].append(np.stack([image.passes[f"light:{x.name}"] for x in whole.lights]))
        for seed in (0, 1):
            began = time.perf_counter()
            singles = [
                cycles.render(replace(whole, lights=(x,)), view, replace(settings, seed=seed)).pixels
                for x in whole.lights
            ]
            spent["whole"] += time.perf_counter() - began
            stacks["whole"].append(np.stack(singles))
    noises = {name: noise(*pair) for name, pair in stacks.items()}
    for name, seconds in spent.items():
        print(f"{name:10s} {seconds / 2:6.1f} s, noise {100 * noises[name]:.3f} %")
    bias = abs(np.mean(stacks["per light"]) / np.mean(stacks["whole"]) - 1)
    ratio = spent["per light"] * noises["per light"] ** 2 / (spent["whole"] * noises["whole"] ** 2)
    print(f"{count} lamps of {SIZE[0]} x {SIZE[1]}, {SAMPLES} samples: per light / whole at equal noise = {ratio:.2f} "
          f"(means agree to {100 * bias:.2f} %)")  # fmt: skip


if __name__ == "__main__":
    main()
