"""All forms by stage. Who writes the diagnosis does not read this folder."""

from collections.abc import Callable
from typing import Any

from benchmarks.blind.apart import lens, outside, sensor, surface


def _named(*forms: Callable[..., Any]) -> dict[str, Callable[..., Any]]:
    return {f"apart {f.__name__}": f for f in forms}


STAGES: dict[str, dict[str, Callable[..., Any]]] = {
    "layer": _named(surface.narrow, surface.wings, surface.window, surface.patches),
    "flow": _named(lens.fov, lens.zones),
    "fine": _named(lens.blades, lens.curved, lens.vibration, lens.settling),
    "optics": _named(lens.rim, lens.bell, lens.barrel, outside.rings, outside.mist),
    "sensor": _named(sensor.shutter, sensor.leak, sensor.drain, sensor.taps, outside.transfer),
    "readout": _named(sensor.running_out, sensor.bent),
    "series": _named(outside.lag, outside.mains),
}
COLORED = ("apart zones",)
SKY = ("apart window",)
