"""What binned captures tell (analysis.gap.processed.binned), in the sensor's own pixels and electrons."""

from dataclasses import replace

from analysis.gap.finding import Estimate, Finding
from analysis.gap.measures.edges import EdgeOffsets, Edges
from analysis.gap.processed.binned import Binning
from interchange.captures import Captures
from interchange.effects.parts import called


def notes(captures: Captures, by: Binning) -> list[str]:
    """Of captures that were binned, and of those that could have been."""
    if not by.undeclared:
        return [_note(captures, by)] if by.n > 1 else []
    names = " and ".join(called(name) for name in by.undeclared)
    (mosaic, demosaic), *_ = by.undeclared.values()
    said = (
        f"The captures of {names} were interpolated from a mosaic of colours ({mosaic}), and the scene file says that "
        f"every pixel measures all three"
    )
    if by.colours:
        way = demosaic.replace("_", " ")
        said += (
            f": they are taken as they are, and the corrected scene says so ({way} is the nearest to them)."
        )
        return [said, _note(captures, by)]
    return [
        f"{said}: two of three numbers have less noise than the sensor. --bin 2 takes what its pixels measured alone."
    ]


def _note(captures: Captures, by: Binning) -> str:
    h, w = captures.captures[0].pixels.shape[:2]
    n = by.n
    behind = " behind a mosaic of colours, each channel by the pixels of its own filter" if by.colours else ""
    alone = "" if by.colours else "; --bin 1 takes each pixel by itself"
    codes = f" What single codes show was not looked for{alone}." if by.averaged > 1 else ""
    return (
        f"Captures of {w} x {h} px were diagnosed by means over {n} x {n} pixels (--bin {n}){behind}. Numbers of "
        f"effects and edges are told in the sensor's own pixels and electrons; sizes of structures and a --metric in "
        f"those means.{codes}"
    )


def of_own_pixels(finding: Finding, by: Binning) -> Finding:
    """A finding of binned captures in the sensor's own pixels and electrons."""
    values = {k: (x.value, x.unit) for k, x in finding.parameters.items()}
    own = by.of_own_pixels(finding.name, values)

    def told(name: str, x: Estimate) -> Estimate:
        return Estimate(own[name], x.sigma / by.factor(finding.name, name.rpartition(" ")[2], x.unit), x.unit)

    return replace(finding, parameters={name: told(name, x) for name, x in finding.parameters.items()})


def edges_of_own_pixels(edges: Edges, by: Binning) -> Edges:
    def told(x: EdgeOffsets) -> EdgeOffsets:
        return replace(x, mean=by.n * x.mean, rms=by.n * x.rms, floor=by.n * x.floor)

    return Edges(told(edges.as_written), told(edges.before), told(edges.after))
