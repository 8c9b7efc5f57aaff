"""Ambient light on an even plate, which shows it as evenly as a dark current; 40 x 30 px, no renderer."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.gap.compared.conditions import Condition
from analysis.gap.compared.state import State
from analysis.gap.evidence.likelihood import Evidence, Hypothesis
from analysis.gap.light.radiance import Rendered
from analysis.gap.terms.base import Term
from analysis.gap.terms.chain import black_of_channels, dark_current
from analysis.gap.terms.light import light_terms
from analysis.gap.terms.normal_equations import equations, total_of
from interchange.camera import Camera, Sensor
from interchange.captures import Capture, Tolerances
from interchange.exposure import expose
from interchange.image import Image
from interchange.light import Light, LightKind
from interchange.scene import Scene

H, W = 30, 40
PAINT = np.array([0.52, 0.5, 0.47], np.float32)
SHOTS = ((1.0, 1.0), (1.0, 0.4), (1.0, 0.1), (0.5, 1.0), (0.0, 1.0))  # of the lamp, s
AMBIENT, DARK = ("ambient_light", ""), ("black_level", "sensor")


def _best(tint: tuple[float, float, float], leak: float, window: float) -> tuple[Hypothesis, Hypothesis]:
    """Of 2 % of ambient light of a ``tint``, and a dark current ``leak`` e-/s: the hypothesis of light, and that of a
    dark current. ``window``: how much of what leans along x the plate shows."""
    rng = np.random.default_rng(3)
    sensor = Sensor(
        (W, H), (5e-6, 5e-6), responsivity=8000.0, full_well=1e4, black_level=64, read_noise=5, bit_depth=12
    )
    y, x = np.mgrid[:H, :W] / W
    lamp = (PAINT / (1 + x**2 + y**2)[..., None]).astype(np.float32)
    even = np.broadcast_to(PAINT, (H, W, 3)).astype(np.float32)
    shares = {"x": window * (x - 0.5), "y": window * (y - 0.375), "z": np.full((H, W), 2 / 3)}
    leaning = {axis: share[..., None].repeat(3, axis=2).astype(np.float16) for axis, share in shares.items()}
    full = Scene(lights=(Light("/A", LightKind.DISTANT, (1.0,) * 3),))
    parts = []
    for k, (power, t_exp) in enumerate(SHOTS):
        camera = Camera("/Top", sensor=sensor, t_exp=t_exp)
        rest = np.zeros((H, W, 3), np.float32)
        scene = replace(full, lights=tuple(replace(light, intensity=(power,) * 3) for light in full.lights))
        shown = Rendered(full, camera, {"/A": lamp}, {"/A": np.ones(3)}, rest, even, {}, {}, leaning=leaning)
        there = Image(shown.radiance(scene) + 0.02 * np.array(tint, np.float32) * even)
        leaking = replace(camera, sensor=replace(sensor, dark_current=leak))
        shots = np.stack([expose(there, leaking, rng=rng).pixels for _ in range(4)])
        captures = tuple(Capture(f"{k}_{i}.png", "/Top", 0, t_exp, s, bits=16) for i, s in enumerate(shots))
        mask = np.ones((H, W), bool)
        parts.append(
            Condition(captures, scene, camera, shots.mean(axis=0), shots.var(axis=0), mask, rendered=shown)
        )
    t = Tolerances()
    off = Term("black_level", "", "black_level", "DN", t.black_level_dn, lambda s: np.ones_like(s.signal))
    terms = [off, *light_terms(parts, t), *black_of_channels(parts, t), *dark_current(parts, t)]
    total = total_of([equations(State(c), terms, np.zeros(len(terms))) for c in parts])
    evidence = Evidence(total, terms)
    light, dark = (evidence.best((c,), {}) for c in (AMBIENT, DARK))
    return light, dark


@pytest.mark.parametrize("window", [1e-3, 0.03, 0.3])
def test_light_of_a_rooms_color_is_light_whatever_of_a_window_shows(window: float) -> None:
    """Nearly as much in each channel of the paint as a dark current would be. As wide as its own share tells, and as
    usual as a black level that is off, the lean cost 12 in log Z."""
    light, dark = _best((0.97, 0.98, 1.02), 0.0, window)
    assert light.score > dark.score


def test_what_is_alike_in_all_channels_is_a_dark_current() -> None:
    """Of 300 e-/s, of which all channels have 120 DN."""
    light, dark = _best((0.0, 0.0, 0.0), 300.0, 1e-3)
    assert dark.score > light.score + 5
