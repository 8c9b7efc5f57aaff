"""How reflected light grows with an albedo: what analysis.gap.terms.bounced tells, and the path tracer's difference.

    python benchmarks/albedo_bounces.py captures.json MATERIAL [--cache DIR]

Draws what the first capture's camera sees anew with MATERIAL's albedo times ``DARKER``. For each lamp both
s = d ln I / d ln rho of the light that came by way of surfaces, red, green, blue: mean over all that is not MATERIAL.
"""

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from analysis.gap.compared.conditions import conditions
from analysis.gap.light.radiance import render_all
from analysis.gap.renderers import renderer
from analysis.gap.terms.bounced import STEP, growth
from interchange.effects.albedo import Albedo
from interchange.formats import captures
from interchange.formats.document import open_scene

DARKER = 0.8


def main() -> None:
    p = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    p.add_argument("captures", type=Path)
    p.add_argument("material")
    p.add_argument("--cache", type=Path, default=None)
    args = p.parse_args()
    given = captures.read(args.captures)
    views = [(c.scene, c.camera) for c in conditions(given, open_scene(given.scene))]
    cache = args.cache or Path(tempfile.mkdtemp())
    with renderer("offline") as (render, settings):
        whole, *others = dict.fromkeys(render_all(views, render, settings, cache))
        darker = Albedo(DARKER, DARKER, DARKER).on_scene(whole.scene, args.material)
        (less,) = render_all([(darker, whole.camera)], render, settings, cache)
    told, ids = growth(whole, others), whole.passes["material_id"]
    beside = (ids >= 0) & (ids != whole.scene.material_names.index(args.material))
    for lamp, share in whole.indirect.items():
        before = (whole.lamps[lamp] * share)[beside]
        after = (less.lamps[lamp] * less.indirect[lamp])[beside]
        by_paths = (1 - after.sum(axis=0) / before.sum(axis=0)) / (1 - DARKER)
        s = told.get((lamp, args.material), np.zeros(share.shape))[beside] * STEP
        here = (before * s).sum(axis=0) / before.sum(axis=0)
        print(f"{lamp}: paths {np.round(by_paths, 3)}, told {np.round(here, 3)}")


if __name__ == "__main__":
    main()
