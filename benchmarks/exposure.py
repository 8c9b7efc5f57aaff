"""How fast radiance becomes DN at 5 Mpx (2448 x 2048), and what each effect costs.

Frames a second are of the fastest of several frames, which a busy machine disturbs least; CPU time over all threads
says what they would be were the cores its own and always at work.
"""

import argparse
import os
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from interchange import fused, plane_kernels
from interchange.bands import each_band
from interchange.camera import Camera, Lens, Sensor
from interchange.effects import Stage, chain
from interchange.effects.motion_blur import MotionBlur
from interchange.effects.veiling_glare import VeilingGlare
from interchange.exposure import expose
from interchange.image import Image

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
    "everything but JPEG": replace(BAYER, lens=FIELD, sensor=COLOUR),
    "everything": replace(BAYER, lens=FIELD, sensor=replace(COLOUR, jpeg_quality=90)),
}
WITH_MOTION = [camera for name, camera in CASES.items() if name.startswith("everything")]


MOVED = (MotionBlur(2.5, 0.5),)  # a web that runs past the camera


def frames(image: Image, camera: Camera, count: int, plain: bool) -> tuple[float, float]:
    """Fastest wall time of a frame and its least CPU time, s."""
    rng = np.random.default_rng(0)

    def frame() -> None:
        expose(image, camera, rng=rng, effects=MOVED if camera in WITH_MOTION else (), step_by_step=plain)

    frame()  # fixed patterns and tables
    wall, cpu = [], []
    for _ in range(count):
        t, c = time.perf_counter(), time.process_time()
        frame()
        wall.append(time.perf_counter() - t)
        cpu.append(time.process_time() - c)
    return min(wall), min(cpu)


def timed(work: Callable[[], object], count: int) -> tuple[float, float]:
    best = [np.inf, np.inf]
    for _ in range(count):
        t, c = time.perf_counter(), time.process_time()
        work()
        best = [min(best[0], time.perf_counter() - t), min(best[1], time.process_time() - c)]
    return best[0], best[1]


def profile(image: Image, camera: Camera, count: int) -> dict[str, tuple[float, float]]:
    """Wall and CPU seconds of what ``expose`` runs, each with what comes before it taken off."""
    effects, camera = chain(camera, MOVED)
    optics = [e for e in effects if e.stage is Stage.OPTICS]
    glare = next(e for e in optics if isinstance(e, VeilingGlare))
    names, spent, before = [], {}, (0.0, 0.0)
    weights = np.ones((2, 2, 3))
    parts = [
        ("reading, measuring at sites", []),
        ("+ motion", optics[:1]),
        ("+ lateral colour", optics[:2]),
        ("+ blur by field", optics[:3]),
        ("+ axial colour, defocus, diffraction", optics[:6]),
        ("+ vignetting", optics[:7]),
    ]
    assert [e.name() for e in optics][:3] == ["motion_blur", "lateral_chromatic_aberration", "field_blur"]
    for name, own in parts:
        sites = fused.Sites(fused.locals_of(own, image, camera), None, weights)
        now = timed(partial(sites, image.pixels), count)
        spent[name] = (now[0] - before[0], now[1] - before[1])
        before = now
        names.append(name)
    now = timed(partial(fused.Sites(sites.steps, glare, weights), image.pixels), count)
    spent["+ glare"] = (now[0] - before[0], now[1] - before[1])
    charges = np.full(image.pixels.shape[:2], 3000, np.float32)
    known = (*fused.READ_OUT, fused.WhiteBalance)
    read = fused.ReadOut(tuple(e for e in effects if isinstance(e, known)), camera, True)
    raw = read(charges.copy(), None, np.uint16)
    rng = np.random.default_rng(0)
    spent["read-out: patterns to whole DN, no noise"] = timed(lambda: read(charges, None, np.uint16), count)
    with_noise = timed(lambda: read(charges, rng, np.uint16), count)
    spent["+ noise"] = tuple(a - b for a, b in zip(with_noise, spent[list(spent)[-1]], strict=True))  # type: ignore[assignment]
    late = [e for e in effects if e.stage is Stage.READOUT and e.order > fused.WhiteBalance.order]
    for name, own in (("demosaic, matrix, curve", late[:-1]), ("+ JPEG", late)):
        colours = fused.colours(own, camera, *raw.shape)
        now = timed(partial(colours, raw), count)
        spent[name] = now if name[0] != "+" else (now[0] - before[0], now[1] - before[1])
        before = now
    return spent


def floor(image: Image, count: int) -> tuple[float, float]:
    """What reading the radiance and writing as large an image take, in bands on all cores."""
    out = np.empty_like(image.pixels)

    def work(start: int, stop: int) -> None:
        np.copyto(out[start:stop], image.pixels[start:stop])

    return timed(lambda: each_band(work, len(out), out.shape[1] * 3), count)


def arithmetic(count: int) -> float:
    """Seconds that one core takes for a product and a sum of 10⁹ pixels in its first cache, as the convolutions do."""
    rows, out = plane_kernels.aligned(80 * plane_kernels.CHUNK), plane_kernels.aligned(plane_kernels.CHUNK)
    rows[:] = 1
    weights = np.full((1, 80), 1e-3, np.float32)

    return timed(lambda: _repeated(rows, weights, out, 20000), 5 * count)[0] / (20000 * 80 * len(out)) * 1e9


@plane_kernels.summing
def _repeated(rows: np.ndarray, weights: np.ndarray, out: np.ndarray, times: int) -> None:
    for _ in range(times):
        plane_kernels._added(rows, 0, weights, 0, 80, out)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=8)
    parser.add_argument("--case", default="")
    parser.add_argument("--plain", action="store_true", help="one effect after the other, the definition")
    args = parser.parse_args()
    y, x = np.mgrid[: SIZE[1], : SIZE[0]].astype(np.float32)
    scene = 40 + 30 * np.sin(x / 40) * np.cos(y / 60) + 10 * ((x // 64 + y // 64) % 2)
    image = Image(np.stack([scene, 0.8 * scene, 0.5 * scene], -1).astype(np.float32))
    cores = len(os.sched_getaffinity(0))
    print(f"{SIZE[0]} x {SIZE[1]} px, {cores} cores, load {os.getloadavg()[0]:.1f}")
    print(f"{'':32} frames/s   ms    ms CPU   frames/s were all cores its own")
    for name, camera in CASES.items():
        if args.case in name:
            wall, cpu = frames(image, camera, args.frames, args.plain)
            print(
                f"{name:32} {1 / wall:6.1f} {1e3 * wall:7.1f} {1e3 * cpu:8.1f} {cores / max(cpu, 1e-9):8.1f}"
            )
    print(f"\n{'of everything':44} ms   ms CPU")
    for step, (wall, cpu) in profile(image, CASES["everything"], args.frames).items():
        print(f"  {step:40} {1e3 * wall:6.1f} {1e3 * cpu:7.1f}")
    print(f"  10⁹ products and sums, one core: {1e3 * arithmetic(args.frames):.0f} ms")
    wall, cpu = floor(image, args.frames)
    print(f"  {'floor: an image read, an image written':40} {1e3 * wall:6.1f} {1e3 * cpu:7.1f}")


if __name__ == "__main__":
    main()
