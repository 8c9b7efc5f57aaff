"""How fast radiance becomes DN at 5 Mpx (2448 x 2048), and what each effect costs.

Frames a second are of the fastest of several frames, which a busy machine disturbs least; CPU seconds a frame say how
many cores that took. Effects are timed one by one, on the whole image, with all threads.
"""

import argparse
import os
import time
from dataclasses import replace

import numpy as np

from interchange.camera import Camera, Lens, Sensor
from interchange.effects import chain
from interchange.exposure import expose, steps_of
from interchange.image import Image, Quantity
from interchange.steps import in_bands

SIZE = (2448, 2048)
SENSOR = Sensor(
    SIZE,
    (3.45e-6, 3.45e-6),
    responsivity=1e4,
    full_well=10500,
    bit_depth=12,
    black_level=64,
    read_noise=2.5,
    prnu=0.006,
    dsnu=1.1,
    dark_current=4.0,
    prnu_row=0.001,
    prnu_column=0.002,
    dsnu_row=0.3,
    dsnu_column=0.5,
    hot_pixels=(1e-4, 300.0),
    serial_number="1",
)
MONO = Camera(sensor=replace(SENSOR, mosaic="mono"), t_exp=0.01)
BAYER = Camera(sensor=replace(SENSOR, mosaic="RGGB"), t_exp=0.01)
LENS = Lens(0.016, vignetting=(-0.3, 0.05), blur=0.7, veiling_glare=(0.01,))
CHROMATIC = replace(
    LENS,
    f_stop=5.6,
    diffraction=True,
    lateral_chromatic_aberration=(2e-4, -3e-4),
    axial_chromatic_aberration=(2.0, 0.0, 3.0),
)
FIELD = replace(CHROMATIC, field_blur=(0.5, 4.0, 2.0, 0.4))  # a corner of 1.1 px rms outward
COLOUR = replace(
    BAYER.sensor,
    color_crosstalk=(0.05, 0.01, 0.05, 0.05, 0.01, 0.05),
    white_balance=(1.6, 1, 1.9),
    color_correction=(1.5, -0.4, -0.1, -0.2, 1.4, -0.2, 0, -0.5, 1.5),
    response="sRGB",
    output_bit_depth=8,
)
CASES = {
    "mono: sensor": MONO,
    "mono: lens and sensor": replace(MONO, lens=LENS),
    "mono: with diffraction": replace(MONO, lens=replace(LENS, f_stop=5.6, diffraction=True)),
    "Bayer, raw: sensor": replace(BAYER, sensor=replace(BAYER.sensor, demosaic="none")),
    "Bayer, raw: lens and sensor": replace(BAYER, lens=LENS, sensor=replace(BAYER.sensor, demosaic="none")),
    "Bayer to sRGB: lens and sensor": replace(BAYER, lens=LENS, sensor=COLOUR),
    "everything but JPEG and field": replace(BAYER, lens=CHROMATIC, sensor=COLOUR),
    "everything but field": replace(BAYER, lens=CHROMATIC, sensor=replace(COLOUR, jpeg_quality=90)),
    "everything": replace(BAYER, lens=FIELD, sensor=replace(COLOUR, jpeg_quality=90)),
}


def frames(image: Image, camera: Camera, count: int) -> tuple[float, float]:
    """Fastest wall time of a frame and its CPU time, s."""
    rng = np.random.default_rng(0)
    expose(image, camera, rng=rng)  # fixed patterns and tables
    wall, cpu = [], []
    for _ in range(count):
        t, c = time.perf_counter(), time.process_time()
        expose(image, camera, rng=rng)
        wall.append(time.perf_counter() - t)
        cpu.append(time.process_time() - c)
    return min(wall), min(cpu)


def profile(image: Image, camera: Camera, count: int) -> dict[str, float]:
    """Seconds of each step, run as ``expose`` runs a chain of that step alone."""
    through, camera = chain(camera)
    steps = steps_of(camera, through, Quantity.DN)
    rng = np.random.default_rng(0)
    out, spent = replace(image, camera=None), {}
    for name, pointwise, function, _ in steps:
        best = np.inf
        for _ in range(count):
            t = time.perf_counter()
            done = replace(out, pixels=in_bands(out, [function], rng)) if pointwise else function(out, rng)
            best = min(best, time.perf_counter() - t)
        out, spent[name] = done, best
    return spent


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=8)
    parser.add_argument("--case", default="")
    args = parser.parse_args()
    y, x = np.mgrid[: SIZE[1], : SIZE[0]].astype(np.float32)
    scene = 40 + 30 * np.sin(x / 40) * np.cos(y / 60) + 10 * ((x // 64 + y // 64) % 2)
    image = Image(np.stack([scene, 0.8 * scene, 0.5 * scene], -1).astype(np.float32))
    print(f"{SIZE[0]} x {SIZE[1]} px, {len(os.sched_getaffinity(0))} cores")
    for name, camera in CASES.items():
        if args.case in name:
            wall, cpu = frames(image, camera, args.frames)
            print(f"{name:32} {1 / wall:6.1f} frames/s   {1e3 * wall:6.1f} ms   {1e3 * cpu:6.1f} ms CPU")
    print("\nms of each step, alone:")
    for step, seconds in profile(image, CASES["everything"], args.frames).items():
        print(f"  {step:30} {1e3 * seconds:7.1f}")


if __name__ == "__main__":
    main()
