"""The material library: published fits to real materials, and every model of the catalogue with its ``example``.

``presets.csv``: one Lafortune lobe for each of 50 materials of the MERL data base, Ngan, Durand, Matusik: Experimental
analysis of BRDF models. EGSR 2005, supplement (assets/lafortune_fits/README.md tells where the numbers are from).
"""

import csv
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from analysis.fit.unknowns import from_published
from composer.demo.station import ALUMINIUM, ANODISED
from composer.editor.commands import AddMaterial
from interchange.brdf import BY_NAME, Brdf
from interchange.brdf.lafortune import Lafortune
from interchange.parameter import parameters

PUBLISHED = Path(__file__).with_name("presets.csv")
TYPICAL, MEASURED, MODELS = (
    "Typical surfaces (Lafortune)",
    "Measured materials (Lafortune)",
    "Models of the catalogue",
)

# lobes in the shape that fits of such surfaces take (Ngan et al. 2005), not measurements: to start with
COMMON = {
    "aluminium, machined": ALUMINIUM,
    "aluminium, anodised black": ANODISED,
    "steel, ground": Lafortune((0.06,) * 3, ((0.9, 0.88, 0.84),), ((-0.97, -0.97, 0.985),), (40.0,)),
    "plastic, black": Lafortune((0.02,) * 3, ((0.25,) * 3,), ((-0.98, -0.98, 0.99),), (60.0,)),
    "plastic, white": Lafortune((0.7,) * 3, ((0.25,) * 3,), ((-0.98, -0.98, 0.99),), (60.0,)),
    "rubber": Lafortune((0.035,) * 3, ((0.03,) * 3,), ((-0.9, -0.9, 0.95),), (4.0,)),
    "paper": Lafortune((0.78, 0.77, 0.74)),
}


@dataclass(frozen=True)
class Preset:
    """``command`` puts the material into a scene."""

    group: str
    name: str
    brdf: Brdf
    source: str

    @property
    def command(self) -> AddMaterial:
        values = {name: getattr(self.brdf, name) for name in parameters(self.brdf)}
        words = self.name.replace("-", " ").replace("_", " ").replace(",", " ").split()
        model = type(self.brdf).__name__
        own = model if self.group == MODELS else "".join(w.capitalize() for w in words)
        return AddMaterial(model, own, {} if self.group == MODELS else values)


@cache
def presets() -> tuple[Preset, ...]:
    """The typical surfaces, the measured materials, then the models, these by name."""
    about = "Typical, not measured; lobes in the shape of the fits of Ngan, Durand, Matusik: EGSR 2005"
    found = [Preset(TYPICAL, name, brdf, about) for name, brdf in COMMON.items()]
    with PUBLISHED.open(encoding="utf8", newline="") as stream:
        for row in csv.DictReader(stream):
            rho_d = tuple(float(row[f"rho_d_{c}"]) for c in "rgb")
            rho_s = tuple(float(row[f"rho_s_{c}"]) for c in "rgb")
            brdf = from_published(rho_d, rho_s, float(row["Cxy"]), float(row["Cz"]), float(row["n"]))  # type: ignore[arg-type]
            about = "One Lafortune lobe, Ngan, Durand, Matusik: EGSR 2005, of MERL's measurement"
            found.append(Preset(MEASURED, row["material"].replace("_", "-"), brdf, about))
    for name in sorted(BY_NAME):
        kind = BY_NAME[name]
        found.append(Preset(MODELS, name, kind(**dict(kind.example)), kind.source))
    return tuple(found)


def preset(name: str) -> Preset:
    """By name; StopIteration where there is none."""
    return next(p for p in presets() if p.name == name)
