"""One image a lamp, against as many whole renders, at equal error: ``python benchmarks/per_light.py [LAMPS]``.

Error is the rms difference to a reference of many samples, over its mean (the lamps' images, the brightest 0.5 % of
differences left out: stray paths sway them). Whole: one render a lamp with 64 samples. Per light: one call, plain and
with reflected light denoised, with as few samples as keep its error to that of the whole renders.
"""

import sys
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from cycles import at, camera, scene

from interchange.brdf.lambert import Lambert
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.scene import Body, Scene
from offline.renderers.cycles import Cycles
from offline.settings import CyclesSettings

SAMPLES, SIZE, REFERENCE = 64, (160, 120), 512


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


def error(images: np.ndarray, reference: np.ndarray) -> float:
    """Relative to the mean; images (L, H, W, 3)."""
    off = np.abs(images - reference).ravel()
    return float(np.sqrt(np.mean(np.sort(off)[: int(0.995 * off.size)] ** 2)) / reference.mean())


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 24
    whole, view = ring(count), camera(20).resized(SIZE[0])
    settings = CyclesSettings(samples=SAMPLES, max_bounces=3)
    checked = whole.lights[:: max(1, count // 4)]  # lamps whose reference is made
    with Cycles() as cycles:

        def singles(lights: Sequence[Light], samples: int, seed: int) -> tuple[np.ndarray, float]:
            began = time.perf_counter()
            chosen = replace(settings, samples=samples, seed=seed)
            images = [cycles.render(replace(whole, lights=(x,)), view, chosen).pixels for x in lights]
            return np.stack(images), time.perf_counter() - began

        reference, _ = singles(checked, REFERENCE, 9)
        images, seconds = singles(whole.lights, SAMPLES, 1)
        target = error(images[:: max(1, count // 4)], reference)
        size = f"{SIZE[0]} x {SIZE[1]}"
        print(
            f"{count} whole renders of {size}, {SAMPLES} samples: {seconds:.1f} s, error {100 * target:.2f} %"
        )
        for name, denoise, steps in (
            ("plain", 0, (SAMPLES,)),
            ("reflected light denoised", 1, (2, 4, 8, 16, 32, 64)),
        ):
            for samples in steps:
                chosen = replace(settings, samples=samples, seed=2, denoise=denoise)
                cycles.render(whole, view, replace(chosen, samples=1))  # compiles
                began = time.perf_counter()
                image = cycles.render(whole, view, chosen, per_light=True)
                took = time.perf_counter() - began
                got = error(np.stack([image.passes[f"light:{x.name}"] for x in checked]), reference)
                if got <= 1.05 * target:
                    break
            print(
                f"{name}: {samples} samples, {took:.1f} s, error {100 * got:.2f} %; ratio {took / seconds:.2f}"
            )


if __name__ == "__main__":
    main()
