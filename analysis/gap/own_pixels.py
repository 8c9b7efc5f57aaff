"""What binned captures tell (analysis.gap.binned), in the sensor's own pixels and electrons."""

from dataclasses import replace

from analysis.gap import binned
from analysis.gap.diagnosis import Edges, Estimate, Finding
from analysis.gap.edges import EdgeOffsets
from interchange.captures import Captures


def note(captures: Captures, n: int) -> str:
    h, w = captures.captures[0].pixels.shape[:2]
    return (
        f"Captures of {w} x {h} px were diagnosed by means over {n} x {n} pixels (--bin {n}). Numbers of effects and "
        f"edges are told in the sensor's own pixels and electrons; sizes of structures and a --metric in those means. "
        f"What single codes show, quantisation and JPEG, was not looked for; --bin 1 takes each pixel by itself."
    )


def of_own_pixels(finding: Finding, n: int) -> Finding:
    """A finding of binned captures in the sensor's own pixels and electrons."""
    values = {k: (x.value, x.unit) for k, x in finding.parameters.items()}
    own = binned.of_own_pixels(finding.name, values, n)

    def told(name: str, x: Estimate) -> Estimate:
        by = float(n) ** -binned.power(finding.name, name.rpartition(" ")[2], x.unit)
        return Estimate(own[name], x.sigma * by, x.unit)

    return replace(finding, parameters={name: told(name, x) for name, x in finding.parameters.items()})


def edges_of_own_pixels(edges: Edges, n: int) -> Edges:
    def told(x: EdgeOffsets) -> EdgeOffsets:
        return replace(x, mean=n * x.mean, rms=n * x.rms, floor=n * x.floor)

    return Edges(told(edges.as_written), told(edges.before), told(edges.after))
