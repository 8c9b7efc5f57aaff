"""The claim put to the test: the simulator renders the held-out captures anew from the corrected scene *file*.

The diagnosis predicts χ after correction from sensitivities. Here the written file is opened again, its cameras and
scenes rendered by the same renderer, and χ is measured with the same pixels and the same σ as before.

Calibration's errors within the tolerances are in no scene file, so both sides get them alike: the numbers that were
fitted for them beside the effects (registration, lamps, albedos, flat field within their tolerances) are put onto the
new rendering as they were put onto the old one. They were fitted to other captures than those that are measured here. χ
of the corrected file as it is, without them, is told too.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from analysis.gap.compared.conditions import Condition
from analysis.gap.light.radiance import Render, render_all
from analysis.gap.measures.shrinkage import Yardstick
from analysis.gap.search.model import Model
from interchange.formats.document import Document, open_scene

WITHIN = 0.1


@dataclass(frozen=True)
class Verification:
    """χ of the held-out captures: ``claimed`` by the diagnosis for what the corrected file carries, ``rendered`` anew
    from it, and ``as_written`` of that file without calibration's errors taken out. ``lacks``: effects that were found
    and are not in the file."""

    claimed: float
    rendered: float
    as_written: float
    lacks: tuple[str, ...] = ()

    @property
    def holds(self) -> bool:
        return abs(self.rendered / self.claimed - 1) <= WITHIN

    @property
    def sentence(self) -> str:
        """What to warn of; "" where the claim holds."""
        if self.holds:
            return ""
        return (
            f"The claim does not hold within {100 * WITHIN:.0f} %: the corrected scene, rendered anew, gives chi "
            f"{self.rendered:.2f} where {self.claimed:.2f} was predicted."
        )


def verified(
    scene: Path,
    held_out: Sequence[Condition],
    registration: Model,
    by: Yardstick,
    claimed: float,
    lacks: Sequence[str],
    render: Render,
    settings: dict[str, Any],
    cache: Path,
    told: Callable[[str, float], None] = lambda what, share: None,
    taken_as: Callable[[Document], Document] = lambda document: document,
) -> Verification:
    """``scene``: the corrected file, which ``lacks`` effects; ``registration``: calibration's errors alone;
    ``claimed``: χ that is predicted of what the file has; ``taken_as``: what the captures' cameras are taken for."""
    document = taken_as(open_scene(scene))
    found = []
    for condition in held_out:
        new = document.scene(condition.captures[0].time)
        camera = new.camera(condition.camera.name)
        own = condition.camera.sensor
        sensor = replace(
            camera.sensor,
            gain_dB=own.gain_dB,
            output_bit_depth=own.output_bit_depth,
            # which may have been taken back (analysis.gap.processed.matrices, analysis.gap.processed.declared)
            color_correction=own.color_correction,
            mosaic=own.mosaic,
        )
        camera = replace(camera, t_exp=condition.camera.t_exp, sensor=sensor)
        found.append(replace(condition, scene=new, camera=camera, rendered=None))
    rendered = render_all(
        [(c.scene, c.camera) for c in found],
        render,
        settings,
        cache,
        lambda k, n: told("verification", k / n),
    )
    corrected = [replace(c, rendered=r) for c, r in zip(found, rendered, strict=True)]
    return Verification(
        claimed=claimed,
        rendered=by.chi2([registration.simulated(c) for c in corrected]) ** 0.5,
        as_written=by.chi2([c.simulated().dn for c in corrected]) ** 0.5,
        lacks=tuple(lacks),
    )
