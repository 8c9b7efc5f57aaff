"""What a distorting lens costs the rasteriser: CPU time of a frame against the same frame through a pinhole.

The scene of benchmarks/rasterizer.py, in pairs of frames drawn one after the other; a lens of six OpenCV parameters
that bends the corners by some 40 px.

    python benchmarks/distortion.py [--frames 8] [--triangles 100000]
"""

import argparse
import time
from dataclasses import replace

import numpy as np
from rasterizer import SIZES, camera, scene

from realtime.renderers.rasterizer import Rasterizer

K = (-0.18, 0.06, 0.0005, -0.0004, -0.01, 0.0)
WAYS = (
    (1, "sample", "live"),
    (4, "pixel", "×4, lit once a pixel"),
    (4, "sample", "×4, every sample lit"),
    (16, "sample", "×16"),
)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--frames", type=int, default=8)
    parser.add_argument("--triangles", type=int, default=100_000)
    options = parser.parse_args()
    station = scene(options.triangles)
    print("| | pinhole, CPU ms | distorting lens | more |\n|---|---|---|---|")
    with Rasterizer() as rasterizer:
        for size in SIZES:
            for samples, shading, label in WAYS:
                ratios, plain, bent = [], [], []
                for step in range(options.frames + 2):
                    view = camera(size, step)
                    distorting = replace(view, lens=replace(view.lens, distortion=K))
                    spent = []
                    for one in (view, distorting):
                        start = time.process_time()
                        rasterizer.render(station, one, samples=samples, shading=shading)
                        spent.append(1e3 * (time.process_time() - start))
                    if step > 1:  # the first upload, and draw shadow maps
                        plain.append(spent[0])
                        bent.append(spent[1])
                        ratios.append(spent[1] / spent[0])
                name = f"{size[0]}×{size[1]}, {label}"
                more = 100 * (float(np.median(ratios)) - 1)
                print(
                    f"| {name} | {np.median(plain):.0f} | {np.median(bent):.0f} | {more:+.0f} % |", flush=True
                )


if __name__ == "__main__":
    main()
