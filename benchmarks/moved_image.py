"""What moving an image by part of a pixel errs by, and its time: edges kept in their cells against interpolation alone.

    python benchmarks/moved_image.py [--by 0.165 -0.116] [--render offline] [--cache DIR]

The bench of assets/bench_sample as its first camera sees it with all lamps on, moved by so many pixels, against what is
rendered with the principal point there. Told as χ: over the noise of a mean of four captures.
"""

import argparse
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import numpy as np  # noqa: E402

from analysis.gap.light import views  # noqa: E402
from analysis.gap.light.radiance import render_all  # noqa: E402
from analysis.gap.renderers import renderer  # noqa: E402
from analysis.gap.sensor.expected import expected  # noqa: E402
from interchange.filtering import edges, resample, resample_cells  # noqa: E402
from interchange.formats.document import open_scene  # noqa: E402

ALL_LAMPS, EXPOSURE, REPEATS = 6, 0.5, 4


def main() -> None:
    p = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    p.add_argument("--by", type=float, nargs=2, default=(0.165, -0.116), help="px to the right and down")
    p.add_argument("--render", choices=("offline", "realtime"), default="offline")
    p.add_argument("--cache", type=Path, help="where renderings are kept (default: nowhere)")
    args = p.parse_args()
    scene = open_scene(ROOT / "assets/bench_sample/scene.usda").scene(ALL_LAMPS)
    camera = replace(scene.camera("/World/Camera0"), t_exp=EXPOSURE)
    w, h = camera.sensor.resolution
    there = replace(camera, principal_point=((w - 1) / 2 + args.by[0], (h - 1) / 2 + args.by[1]))
    with tempfile.TemporaryDirectory() as folder, renderer(args.render, None, False) as (render, settings):
        both = [(scene, camera), (scene, there)]
        base, anew = render_all(both, render, settings, args.cache or Path(folder))
    true = expected(anew.radiance(scene), there)
    sigma = np.sqrt(true.temporal / REPEATS + true.fixed)
    lit = true.dn.max(axis=2) < 0.95 * true.top
    flow = np.broadcast_to(np.float32(args.by), (h, w, 2)).copy()

    def chi(dn: np.ndarray) -> float:
        return float(np.sqrt(np.mean((((dn - true.dn) / sigma)[lit]) ** 2)))

    def moved() -> float:
        return chi(expected(views.Views(base, flow, ()).here.radiance(scene), camera).dn)

    print(f"not moved                 chi {chi(expected(base.radiance(scene), camera).dn):.2f}")
    with patch.object(views, "resample_cells", lambda cells, x, y, known: resample(cells, x, y)):
        print(f"interpolated              chi {moved():.2f}")
    print(f"edges kept in their cells chi {moved():.2f}")

    name, plane = next(iter(base.fine.items()))
    cells = np.ascontiguousarray(plane, np.float32)
    (places,) = views._places(flow, base.finer, base.finer * base.margin)
    known = base.edges[name]

    def seconds(work: object) -> float:
        times = []
        for _ in range(5):
            began = time.perf_counter()
            work()  # type: ignore[operator]
            times.append(time.perf_counter() - began)
        return min(times)

    floor = seconds(lambda: resample(cells, *places))
    print(
        f"a lamp's {cells.shape[1]} x {cells.shape[0]} cells, over interpolation alone ({1e3 * floor:.0f} ms):"
    )
    print(f"  edges known  {seconds(lambda: resample_cells(cells, *places, known)) / floor:.1f} times")
    print(f"  finding them {seconds(lambda: edges(cells)) / floor:.1f} times, once a rendering")


if __name__ == "__main__":
    main()
