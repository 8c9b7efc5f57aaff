from pathlib import Path

import numpy as np
import pytest

from analysis.sweep.address import groups_of, knob, set_values
from interchange.formats.document import open_scene
from interchange.parameter import Kind
from interchange.problems import BrightfieldError

STATION = Path(__file__).parents[3] / "docs/examples/station.usda"


@pytest.fixture(scope="module")
def scene():
    return open_scene(STATION).scene()


def addresses(scene):
    """Every declared number of one camera, one lamp, one object and one material."""
    for prim in ("Camera", "Led0", "Plate", "steel"):
        path, groups = groups_of(scene, prim)
        for part, group in groups.items():
            for name, about in group.declared.items():
                word = f"{path}.{part}.{name}" if part else f"{path}.{name}"
                yield word + (".x" if about.kind is Kind.VECTOR else ""), group


def test_every_declared_number_can_be_set_to_what_its_declaration_allows(scene):
    """An effect is what changes the scene; the numbers that the scene itself holds read back as they were set."""
    tried, left = 0, []
    for address, group in addresses(scene):
        about = knob(scene, address).about
        low, high = max(about.low, -10.0), min(about.high, 10.0)
        value = low + 0.37 * (high - low) if low < high else about.low
        try:
            changed = set_values(scene, {address: value})
        except BrightfieldError as error:
            left.append((address.split(".")[0], str(error)))  # a lens that cannot be, say
            continue
        tried += 1
        part = address.split(".")[1] if address.count(".") > 1 else ""
        if part in ("", "lens", "sensor") or "carried" in getattr(group.put, "__qualname__", ""):
            assert knob(changed, address).value == pytest.approx(value, rel=1e-6), address
        else:
            assert changed is not scene
    assert tried > 100
    assert len(left) < 0.1 * tried, left
    assert all(prim in told for prim, told in left)


def test_a_lamp_keeps_its_colour_and_its_neighbours(scene):
    changed = set_values(scene, {"Led0.intensity": 0.1})
    old, new = (next(x for x in s.lights if x.name.endswith("Led0")) for s in (scene, changed))
    np.testing.assert_allclose(np.array(new.intensity) / np.array(old.intensity), 0.1 / max(old.intensity))
    assert all(a is b for a, b in zip(scene.lights[1:], changed.lights[1:], strict=True))
    assert changed.bodies is scene.bodies  # what stays is the same object: renderers keep it


def test_poses_are_moved_along_the_worlds_axes_or_the_things_own(scene):
    there = scene.camera().world_from_camera
    moved = set_values(scene, {"Camera.pose.tx": 10, "Camera.pose.tz": -5}).camera().world_from_camera
    np.testing.assert_allclose(moved[:3, 3] - there[:3, 3], [10e-3, 0, -5e-3], atol=1e-12)
    own = set_values(scene, {"Camera.own.tz": 7}).camera().world_from_camera
    np.testing.assert_allclose(own[:3, 3] - there[:3, 3], 7e-3 * there[:3, 2], atol=1e-12)
    turned = set_values(scene, {"Camera.pose.rz": 300}).camera().world_from_camera
    np.testing.assert_allclose(turned[:3, 3], there[:3, 3], atol=1e-12)
    c, s = np.cos(0.3), np.sin(0.3)
    np.testing.assert_allclose(
        turned[:3, :3], np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ there[:3, :3], atol=1e-12
    )


def test_an_object_turns_about_the_middle_of_its_box(scene):
    def middle(s):
        body = next(b for b in s.bodies if b.name.endswith("Plug"))
        return (body.mesh.vertices @ body.world_from_body[:3, :3].T + body.world_from_body[:3, 3]).mean(
            axis=0
        )

    np.testing.assert_allclose(middle(set_values(scene, {"Plug.pose.rz": 700})), middle(scene), atol=1e-9)


def test_one_channel_and_one_lobe_have_addresses(scene):
    red = set_values(scene, {"steel.diffuse.R": 0.4})
    brdf = next(b.material.brdf for b in red.bodies if b.material.name.endswith("steel"))
    assert brdf.diffuse[0] == 0.4
    assert brdf.diffuse[1] < 0.2
    assert knob(scene, "/World/Materials/steel.diffuse.B").letter == "B"


@pytest.mark.parametrize(
    ("address", "told"),
    [
        ("Lamp0.intensity", 'no camera, lamp, object or material "Lamp0"'),
        ("Led0.intensty", 'Did you mean "intensity"'),
        ("Camera.poze.tx", 'Did you mean "pose"'),
        ("Camera.pose.tx[2]", "is no list"),
        ("Camera.pose.tx.R", "it is one number"),
        ("steel", "must be PRIM.NAME"),
        ("Camera", "must be PRIM.NAME"),
        ("Plate.alpha", "Plate has no number of its own"),
    ],
)
def test_what_an_address_says_wrongly_is_told(scene, address, told):
    with pytest.raises(BrightfieldError, match=told.replace("[", r"\[")):
        knob(scene, address)


def test_a_number_out_of_bounds_is_told_with_its_prim(scene):
    with pytest.raises(
        BrightfieldError, match=r"/World/Materials/steel: Ggx.alpha_x .* must lie in \[0.001, 1\]"
    ):
        set_values(scene, {"steel.alpha_x": 3})
