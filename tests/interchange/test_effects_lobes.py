"""What gloss, anisotropy and body colour do to the lobes of a reflectance model."""

from dataclasses import replace

import numpy as np
import pytest

from interchange.brdf import MODELS as BRDFS
from interchange.brdf.base import Brdf
from interchange.brdf.ggx import Ggx
from interchange.brdf.lafortune import Lafortune
from interchange.brdf.lobes import body_off, width_factors
from interchange.brdf.phong import Phong
from interchange.brdf.ward import Ward
from interchange.effects.anisotropy import Anisotropy
from interchange.effects.gloss import Gloss
from interchange.material import Material
from interchange.mesh import Mesh
from interchange.scene import Body, Scene

WI = np.array([[0.1, 0.2, 0.97], [-0.5, 0.1, 0.86], [0.6, -0.2, 0.77]])
WI /= np.linalg.norm(WI, axis=-1, keepdims=True)
WO = np.array([-0.3, 0.2, 0.93]) / np.linalg.norm([-0.3, 0.2, 0.93])


@pytest.mark.parametrize("name", [n for n, m in BRDFS.items() if m.matte and n != "oren_nayar"])
def test_the_body_colour_is_what_a_model_is_linear_in(name):
    """f(ρ) - f(0) ∝ ρ for every model that declares it; Oren and Nayar's has light between facets beside, ρ²."""
    brdf = BRDFS[name](**BRDFS[name].example)
    brdf = replace(brdf, **{brdf.matte: (0.3, 0.4, 0.5)})
    dark = body_off(brdf)
    full = replace(brdf, **{brdf.matte: np.asarray(getattr(brdf, brdf.matte)) / 2})
    f, half, none = (b.evaluate(WI, WO) for b in (brdf, full, dark))
    assert f - none == pytest.approx(2 * (half - none), rel=1e-9, abs=1e-12)
    assert (f > none).all()


@pytest.mark.parametrize("name", [n for n, m in BRDFS.items() if m.width])
def test_declared_widths_are_widths(name):
    """Wider lobes fall off more slowly, beside the mirror spike that some have, and factors undo each other."""
    brdf = BRDFS[name](**BRDFS[name].example)
    factors = width_factors(brdf, 1.6, 1.6)
    wide = replace(brdf, **{n: np.asarray(getattr(brdf, n)) * f for n, f in factors.items()})
    turn = np.radians([4.0, 8.0])
    wi = np.stack([-np.sin(0.5 + turn), 0 * turn, np.cos(0.5 + turn)], -1)
    wo = np.array([np.sin(0.5), 0, np.cos(0.5)])
    f, g = (body_off(b).evaluate(wi, wo).mean(-1) for b in (brdf, wide))
    assert g[1] / g[0] > f[1] / f[0]
    for n, f in width_factors(brdf, 1 / 1.6, 1 / 1.6).items():
        assert f * factors[n] == pytest.approx(1)


def _albedo(brdf: Brdf) -> float:
    """Of the lobes alone, at 20 degrees."""
    wo = np.array([np.sin(0.35), 0, np.cos(0.35)])
    alone = body_off(brdf)
    t = (np.arange(400) + 0.5) / 400 * np.pi / 2
    p = (np.arange(400) + 0.5) / 400 * 2 * np.pi
    theta, phi = np.meshgrid(t, p, indexing="ij")
    wi = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)
    f = alone.evaluate(wi, wo)[..., 0]
    return float((f * np.sin(theta) * np.cos(theta)).sum() * (np.pi / 800) * (2 * np.pi / 400))


@pytest.mark.parametrize(
    "brdf",
    [Ward(alpha=0.12), Ggx(alpha_x=0.2, alpha_y=0.2), Phong(n=60.0),
     Lafortune((0.1,) * 3, ((0.6,) * 3,), ((-1, -1, 1),), (60.0,))],
    ids=lambda b: type(b).__name__,
)  # fmt: skip
def test_gloss_keeps_the_light_of_a_lobe_and_level_scales_it(brdf):
    """Within 4 %: what a lobe loses below the horizon and to masking."""
    body = Body("/b", Mesh(np.zeros((3, 3)), np.zeros((1, 3), int), np.zeros((3, 3))), Material("/m", brdf))
    scene = Scene((body,))
    wide = Gloss(width=1.3).on_scene(scene).bodies[0].material.brdf
    strong = Gloss(level=1.5).on_scene(scene, "m").bodies[0].material.brdf
    assert _albedo(wide) == pytest.approx(_albedo(brdf), rel=0.04)
    alone = body_off(brdf).evaluate(WI, WO)
    assert strong.evaluate(WI, WO) - brdf.evaluate(WI, WO) == pytest.approx(0.5 * alone, rel=1e-9)
    mirror = WO * [-1, -1, 1]
    assert wide.evaluate(mirror, WO)[0] < brdf.evaluate(mirror, WO)[0]


@pytest.mark.parametrize("brdf", [Ward(alpha=0.12), Phong(n=60.0), Ggx(alpha_x=0.1, alpha_y=0.1)])
def test_anisotropy_stretches_a_lobe_along_the_tangent(brdf):
    body = Body("/b", Mesh(np.zeros((3, 3)), np.zeros((1, 3), int), np.zeros((3, 3))), Material("/m", brdf))
    changed = Anisotropy(1.8).on_scene(Scene((body,))).bodies[0].material.brdf
    wo, off = np.array([0.0, 0.0, 1.0]), np.radians(12.0)
    along, across = np.array([[np.sin(off), 0, np.cos(off)], [0, np.sin(off), np.cos(off)]])
    assert changed.evaluate(along, wo)[0] > brdf.evaluate(along, wo)[0]
    assert changed.evaluate(across, wo)[0] < brdf.evaluate(across, wo)[0]
    assert changed.evaluate(wo, wo)[0] == pytest.approx(brdf.evaluate(wo, wo)[0], rel=0.02)


@pytest.mark.parametrize(
    ("brdf", "one", "half"),
    [
        (
            Lafortune((0.1,) * 3, ((0.6,) * 3,), ((-1, -1, 1),), (20.0,)),
            Anisotropy(split=0.1),
            Anisotropy(cross=0.1),
        ),
        (Ggx(alpha_x=0.2, alpha_y=0.2), Anisotropy(1.5), Anisotropy(diagonal=float(np.log(1.5)))),
    ],
    ids=["Lafortune", "GGX"],
)
def test_a_grain_may_run_any_way(brdf, one, half):
    """Both parts alike are a lobe root two times as long along 22.5 degrees; against it, along 112.5 degrees."""
    mesh = Mesh(np.eye(3), np.array([[0, 1, 2]]), np.tile([0.0, 0.0, 1.0], (3, 1)))
    body = Body("/b", mesh, Material("/m", brdf))

    def seen(effect, angle):
        """Of light from a direction that is turned by ``angle`` from the body's x axis."""
        (b,) = effect.on_scene(Scene((body,))).bodies
        t = b.mesh.tangents[0]
        frame = np.stack([t, np.cross([0.0, 0.0, 1.0], t), [0.0, 0.0, 1.0]])
        c, s = np.cos(angle), np.sin(angle)
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        return b.material.brdf.evaluate(frame @ turn @ WI, frame @ turn @ WO)

    quarter = np.radians(45.0)
    for angle in np.radians([0.0, 20.0, 70.0]):
        assert seen(half, angle + quarter) == pytest.approx(seen(one, angle))
        assert seen(one, angle) != pytest.approx(seen(one, angle + quarter), rel=1e-3)
    both = {n: getattr(half, n) or getattr(one, n) for n in ("diagonal", "cross", "split")}
    both["ratio"] = one.ratio
    assert Anisotropy(**both).grain == pytest.approx(quarter / 2)
    against = {"ratio": 1 / one.ratio, **{n: -both[n] for n in ("diagonal", "cross", "split")}}
    for angle in np.radians([10.0, 50.0]):
        assert seen(Anisotropy(**against), angle) == pytest.approx(
            seen(Anisotropy(**both), angle + 2 * quarter)
        )


def test_a_round_lobe_is_known_again_from_its_peak_and_width():
    """Ward's own lobe at 30 degrees, to the grid of the search (5 %)."""
    from interchange.effects.shine import _equivalent

    for alpha in (0.03, 0.1, 0.25):
        found, rho = _equivalent(Ward((0.3,) * 3, (0.2,) * 3, alpha))
        assert found == pytest.approx(alpha, rel=0.05)
        assert rho == pytest.approx([0.2] * 3, rel=0.12)
