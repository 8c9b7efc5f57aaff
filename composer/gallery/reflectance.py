"""The reference page of the reflectance models, made from their files: formula, source, parameters, a ball and a plot.

python -m composer.gallery.reflectance [--out docs] [--text-only]
"""

import argparse
import inspect
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np

from analysis.sphere import sphere_camera, sphere_scene
from composer.demo.pictures import shown
from interchange.brdf import MODELS, Brdf
from interchange.formats.atomic import written_beside
from interchange.parameter import parameters, settings, tables

BALL = 240  # px
HEAD = """# Reflectance models

Made from the files in `interchange/brdf/` by `make reference`; nothing here is written by hand.

Every model is a formula f(wi, wo) in 1/sr, without the cosine, wi to the light and wo to the camera, both unit vectors
away from the surface in the shading frame (x tangent, y bitangent, z normal). The same text is evaluated by NumPy,
traced to GLSL for the rasteriser and to OSL for the path tracer; the law tests hold the three together.

Pictures: a ball under a small lamp to the upper left (a white matte surface that faces it would show radiance 1, shown
as white) and one of a tenth to the lower right. Plots: f in the plane of incidence for light from 15°, 45° and 70°, one
colour each, on a logarithmic scale of radius, over the angle of exitance; the dotted ray marks the mirror direction.
Both are for the parameters in the column *default*, or those named beside the pictures. Representations of measured
data (tables, harmonics, wavelets, products) are matte or nearly so by default and show their worth with a measurement
in them: [representations](representations.md).

"""


def slug(model: type[Brdf]) -> str:
    return model.__name__.lower()


def text() -> str:
    """The page."""
    lines = [HEAD, "| model | isotropic | reciprocal | keeps energy | source |", "|---|---|---|---|---|"]
    for model in ordered():
        flags = [_yes(getattr(model, flag)) for flag in ("isotropic", "reciprocal", "conserves_energy")]
        lines.append(f"| [{model.__name__}](#{slug(model)}) | {' | '.join(flags)} | {model.source} |")
    lines.append("")
    lines.append(
        "*no* under reciprocal or energy: not for all parameters within their bounds, or left to a sum's parts."
    )
    for model in ordered():
        lines += ["", *section(model)]
    return "\n".join(lines) + "\n"


def ordered() -> list[type[Brdf]]:
    return sorted(MODELS.values(), key=lambda model: model.__name__)


def _yes(flag: bool) -> str:
    return "yes" if flag else "no"


def section(model: type[Brdf]) -> list[str]:
    module = sys.modules[model.__module__]
    file = model.__module__.replace(".", "/") + ".py"
    name = slug(model)
    lines = [
        f"## {model.__name__}",
        "",
        f"![ball](reflectance/{name}.png) ![lobes](reflectance/{name}_lobes.png)",
        "",
    ]
    if model.example:
        shown_with = ", ".join(f"{key} = {_value(value)}" for key, value in model.example.items())
        lines += [f"Pictures with {shown_with}.", ""]
    lines += [inspect.cleandoc(module.__doc__ or ""), ""]
    if own := (model.__doc__ or "").strip():
        generated = own.startswith(f"{model.__name__}(")  # what dataclass writes where there is none
        lines += [] if generated else [inspect.cleandoc(own), ""]
    lines += [f"Source: {model.source} File: `{file}`.", ""]
    lines += ["| parameter | symbol | default | bounds | unit | meaning |", "|---|---|---|---|---|---|"]
    default = model()
    for key, about in parameters(model).items():
        entry = " (one a lobe)" if about.per_lobe else ""
        value = _value(getattr(default, key))
        bounds = f"[{about.low:g}, {about.high:g}]"
        lines.append(
            f"| `{key}`{entry} | {about.symbol} | {value} | {bounds} | {about.unit} | {about.meaning} |"
        )
    for key, rule in settings(model).items():
        bounds = f"[{rule.low}, {rule.high}]"
        lines.append(
            f"| `{key}` | {rule.symbol} | {getattr(default, key)} | {bounds} | whole | {rule.meaning} |"
        )
    for key, content in tables(model).items():
        size = f"{len(getattr(default, key))} rows"
        lines.append(
            f"| `{key}` (table) | {content.symbol} | {size} | | {content.unit} | {content.meaning} |"
        )
    return lines


def _value(value: object) -> str:
    array = np.asarray(value, float)
    if array.ndim and array.size and array.shape[-1] == 3 and (array == array[..., :1]).all():
        array = array[..., 0]
    return str(np.round(array, 6).tolist())


def lobe_plot(brdf: Brdf, path: Path) -> None:
    """f in the plane of incidence, polar, logarithmic over three decades."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(3.6, 2.4), dpi=100)
    axes: Any = figure.add_axes((0.08, -0.33, 0.84, 1.5), projection="polar")
    theta_o = np.radians(np.linspace(-89, 89, 713))
    wo = np.stack([np.sin(theta_o), 0 * theta_o, np.cos(theta_o)], axis=-1)
    curves = []
    for degrees in (15, 45, 70):
        theta = np.radians(degrees)
        wi = np.array([-np.sin(theta), 0, np.cos(theta)])
        curves.append((degrees, brdf.evaluate(wi, wo).mean(axis=-1)))
    top = max(float(np.nanmax(f)) for _, f in curves) or 1.0
    floor = np.log10(top) - 3
    for (degrees, f), color in zip(curves, ("#1b6ca8", "#d9822b", "#4c9a4c"), strict=True):
        radius = np.maximum(np.log10(np.maximum(f, 1e-30)) - floor, 0)
        axes.plot(theta_o, radius, color=color, linewidth=1.3, label=f"{degrees}°")
        axes.plot([np.radians(degrees)] * 2, [0, 3], color=color, linewidth=0.8, linestyle=":")
    axes.set_theta_zero_location("N")
    axes.set_theta_direction(-1)
    axes.set_thetamin(-90)
    axes.set_thetamax(90)
    axes.set_ylim(0, 3)
    axes.set_yticks([0, 1, 2, 3], [f"{10 ** (floor + k):.0e}" for k in range(4)], fontsize=6)
    axes.tick_params(labelsize=6)
    figure.text(0.02, 0.94, "f in 1/sr", fontsize=7)
    figure.legend(fontsize=6, loc="upper right", frameon=False, borderaxespad=0.1)
    figure.savefig(path, metadata={"Software": None})


def pictures(folder: Path) -> None:
    from PIL import Image as Pillow

    from realtime.renderers.rasterizer import Rasterizer

    folder.mkdir(parents=True, exist_ok=True)
    with Rasterizer() as rasterizer:
        for model in ordered():
            brdf = model(**model.example)
            image = rasterizer.render(sphere_scene(brdf), sphere_camera(BALL))
            Pillow.fromarray(shown(image.pixels, 1.0)).save(folder / f"{slug(model)}.png", optimize=True)
            lobe_plot(brdf, folder / f"{slug(model)}_lobes.png")
            print(f"  {model.__name__}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("docs"))
    parser.add_argument("--text-only", action="store_true", help="leave the pictures as they are")
    options = parser.parse_args()
    if not options.text_only:
        pictures(options.out / "reflectance")
    page = options.out / "reflectance.md"
    beside = written_beside(page)
    beside.write_text(text(), encoding="utf8")
    os.replace(beside, page)


if __name__ == "__main__":
    main()
