"""Strobes: an exposure's share of a flash, by row, and what files and panels know of it."""

from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pxr import Usd

from analysis.sweep.address import knob, set_values
from composer.editor.fields import of_light
from composer.editor.workspace import Workspace
from interchange.camera import Camera, Sensor
from interchange.exposure import expose
from interchange.formats.document import open_scene
from interchange.formats.usd_author import author_scene
from interchange.formats.usd_changes import Frame, author_changes
from interchange.formats.usd_edit_values import set_light
from interchange.formats.usd_read import SceneReader
from interchange.image import Image, Quantity
from interchange.lamps.exposed import STROBED, banded, exposed, shares, steady
from interchange.light import Light, LightKind
from interchange.parameter import ParameterError, parameters
from interchange.problems import BrightfieldError, FileError
from interchange.scene import Scene
from interchange.strobe import Strobe

LAMP = Light("/World/lamp", LightKind.SPHERE, (3.0, 2.0, 1.0))
FLASH = Strobe(1e-3, 2e-4, 5e-3, 8.0)


@given(start=st.floats(-1, 1), duration=st.floats(1e-6, 1), t0=st.floats(-1, 1), t_exp=st.floats(0.01, 1))
def test_a_share_is_the_overlap(start: float, duration: float, t0: float, t_exp: float) -> None:
    overlap = max(0.0, min(start + duration, t0 + t_exp) - max(start, t0))
    assert float(Strobe(start, duration).share(t_exp, t0)) == pytest.approx(overlap / t_exp, abs=1e-9)


def test_flashes_that_repeat_add_up() -> None:
    strobe = Strobe(0.001, 0.0002, period=0.001, overdrive=5.0)
    assert float(strobe.share(0.010, 0.0)) == pytest.approx(1.0)  # 20 % of the time, five times as bright
    single = sum(float(Strobe(0.001 * k, 0.0002, overdrive=5.0).share(0.0033, 0.0005)) for k in range(-3, 9))
    assert float(strobe.share(0.0033, 0.0005)) == pytest.approx(single)


def test_a_lamp_without_a_flash_is_always_on() -> None:
    scene = Scene(lights=(LAMP,))
    assert exposed(scene, Camera(t_exp=0.0)) == (scene, {})
    assert steady(scene) is scene
    assert steady(Scene(lights=(replace(LAMP, strobe=FLASH),))).lights[0].strobe == Strobe()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"duration": -1.0}, r"Strobe.duration \(T, .*\) must lie in \[0, 1e\+06\] s; got -1 s"),
        ({"duration": 0.2, "period": 0.1}, "must be 0 or hold the duration, 0.2 s; got 0.1 s"),
        ({"duration": 1.0, "start": np.nan}, "Strobe.start"),
    ],
)
def test_what_no_lamp_can_do_is_refused(given: dict[str, float], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        Strobe(**given)


def test_rows_of_a_rolling_shutter_see_parts_of_a_flash() -> None:
    camera = Camera(sensor=Sensor((4, 10), line_time=1e-3), t_exp=2e-3)
    assert shares(Strobe(4e-3, 1e-3), camera, 0.0) == pytest.approx([0, 0, 0, 0.5, 0.5, 0, 0, 0, 0, 0])
    later = shares(Strobe(4e-3, 1e-3), camera, 2e-3)
    assert later == pytest.approx([0, 0.5, 0.5, 0, 0, 0, 0, 0, 0, 0][:10])
    triggered = Strobe(4e-3, 1e-3, triggered=True)
    assert shares(triggered, camera, 7.0) == pytest.approx(shares(Strobe(4e-3, 1e-3), camera, 0.0))


def test_a_global_shutter_makes_a_steady_lamp_of_a_flash() -> None:
    scene = Scene(lights=(replace(LAMP, strobe=FLASH), LAMP), seconds=5e-3)
    lit, rows = exposed(scene, Camera(t_exp=1.1e-3))
    assert rows == {}
    assert lit.lights[0].intensity == pytest.approx(
        [8 * x / 11 for x in LAMP.intensity]
    )  # half a flash of 1.1 ms
    assert lit.lights[1] is LAMP
    with pytest.raises(BrightfieldError, match="lights an exposure above 0 s; got 0 s"):
        exposed(scene, Camera(t_exp=0.0))


def test_bands_are_the_rows_shares_of_each_lamps_light() -> None:
    camera = Camera(sensor=Sensor((3, 40), line_time=1e-4), t_exp=1e-3)
    other = replace(LAMP, name="/World/other", strobe=Strobe(2e-3, 1e-3, overdrive=3.0))
    scene = Scene(lights=(replace(LAMP, strobe=FLASH), other, replace(LAMP, name="/World/steady")))
    lit, rows = exposed(scene, camera)
    rng = np.random.default_rng(0)
    whole = {x.name: rng.random((40, 3, 3)) for x in scene.lights}  # by a steady lamp
    passes = {
        f"light:{x.name}": (whole[x.name] * max(x.intensity) / 3).astype(np.float32) for x in lit.lights
    }
    image = banded(Image(sum(passes.values()), passes=passes), rows, ["light"])
    expected = {x.name: whole[x.name] * shares(x.strobe, camera, 0.0)[:, None, None] for x in scene.lights}
    assert image.pixels == pytest.approx(sum(expected.values()), abs=1e-5)
    for name, plane in expected.items():
        assert image.passes[f"light:{name}"] == pytest.approx(plane, abs=1e-5)
    assert banded(Image(image.pixels, passes=passes), rows, []).passes == {}
    twice = replace(scene, lights=(scene.lights[0], scene.lights[0]))
    with pytest.raises(BrightfieldError, match="need a name each; /World/lamp"):
        exposed(twice, camera)


def test_an_image_is_exposed_as_its_flashes_were_drawn() -> None:
    camera = Camera(sensor=Sensor((4, 4)), t_exp=1e-3)
    about = {STROBED: {"seconds": 0.0, "t_exp_s": 1e-3, "line_time_s": 0.0}}
    image = Image(np.ones((4, 4, 3), np.float32), camera=camera, made_by=about)
    assert expose(image).quantity is Quantity.DN
    with pytest.raises(BrightfieldError, match=r"an exposure of 0.001 s; got 0.002 s\. Render it with that"):
        expose(image, t_exp=2e-3)
    with pytest.raises(BrightfieldError, match="a line time of 0 s; got 1e-05 s"):
        expose(image, replace(camera, sensor=Sensor((4, 4), line_time=1e-5)))


def test_a_smaller_image_is_read_out_in_the_same_time() -> None:
    camera = Camera(sensor=Sensor((80, 60), line_time=1e-4))
    small = camera.resized(20)
    assert small.sensor.resolution == (20, 15)
    assert small.sensor.line_time == pytest.approx(4e-4)


TEXT = """#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = 1
    upAxis = "Z"
    timeCodesPerSecond = 50
)
def Xform "World" {{
    def SphereLight "lamp" {{
        float inputs:intensity = 4
        bool inputs:normalize = 1
        {strobe}
        custom string vendor:note = "kept"
    }}
}}
"""


def written(folder: Path, *lines: str) -> Path:
    file = folder / "scene.usda"
    file.write_text(TEXT.format(strobe="\n".join(f"custom {line}" for line in lines)))
    return file


def test_a_scene_file_holds_strobes(tmp_path: Path) -> None:
    file = written(tmp_path, "double lamp:strobe:duration = 0.0002", "double lamp:strobe:period = 0.005")
    scene = open_scene(file).scene(25.0)
    assert scene.lights[0].strobe == Strobe(0, 2e-4, 5e-3)
    assert scene.seconds == 0.5  # by 50 time codes a second
    saved = tmp_path / "saved.usda"
    open_scene(file).save(saved)
    text = saved.read_text()
    assert open_scene(saved).scene(25.0).lights[0].strobe == Strobe(0, 2e-4, 5e-3)
    assert 'vendor:note = "kept"' in text
    assert "lamp:strobe:overdrive" not in text


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (
            "double lamp:strobe:duration = -1",
            r"/World/lamp.lamp:strobe:duration: Strobe.duration .* got -1 s",
        ),
        ("double lamp:strobe:lenght = 1", "lamp:strobe:lenght is not known."),
        ("double lamp:strobe:start = 1", "A strobe needs lamp:strobe:duration"),
        ('string lamp:strobe:duration = "long"', "Strobe.duration .* must be numbers"),
    ],
)
def test_a_strobe_that_cannot_be_is_one_clear_error(tmp_path: Path, line: str, message: str) -> None:
    with pytest.raises(FileError, match=message):
        open_scene(written(tmp_path, line)).scene()


def test_every_number_of_a_strobe_survives_a_scene_file() -> None:
    flash = Strobe(-1e-3, 2e-4, 5e-3, 8.0, triggered=True)
    lights = (replace(LAMP, strobe=FLASH), replace(LAMP, name="/World/other", strobe=flash))
    read = SceneReader(author_scene(Scene(lights=lights)), "scene.usda").scene(0.0)
    assert [x.strobe for x in read.lights] == [FLASH, flash]


def test_frames_keep_their_time() -> None:
    frames = [Scene(lights=(replace(LAMP, strobe=FLASH),), seconds=0.02 + k / 120) for k in range(3)]
    reader = SceneReader(author_scene(frames[0], frames=frames[1:]), "scene.usda")
    camera = Camera(t_exp=2e-3)
    for k, frame in enumerate(frames):
        ours, theirs = (exposed(s, camera)[0].lights[0].intensity for s in (frame, reader.scene(float(k))))
        assert theirs == pytest.approx(ours, rel=1e-6)
    with pytest.raises(BrightfieldError, match=r"equal steps of Scene\.seconds"):
        author_scene(frames[0], frames=[frames[2], frames[1]])


def test_strobes_are_changed_in_place(tmp_path: Path) -> None:
    stage = Usd.Stage.Open(str(written(tmp_path, "double lamp:strobe:duration = 0.0002")))
    old = SceneReader(stage, "scene.usda").scene(0.0)
    new = set_values(old, {"lamp.strobe.start": 0.01})
    assert author_changes(stage, [Frame(0.0, old, new)]) == []
    assert SceneReader(stage, "scene.usda").scene(0.0).lights[0].strobe == Strobe(0.01, 2e-4)
    for name, value in (("overdrive", 4.0), ("triggered", True)):
        set_light(stage, old.lights[0], f"strobe.{name}", value, None)
    changed = SceneReader(stage, "scene.usda").scene(0.0).lights[0]
    assert changed.strobe == Strobe(0.01, 2e-4, 0.0, 4.0, True)
    with pytest.raises(ParameterError, match=r"Strobe\.duration"):
        set_light(stage, changed, "strobe.duration", -1.0, None)


def test_panels_and_plans_know_what_a_strobe_declares() -> None:
    shown = {f.name: f for f in of_light(LAMP)}
    scene = Scene(lights=(replace(LAMP, strobe=FLASH),))
    for name, about in parameters(Strobe).items():
        field = shown[f"strobe.{name}"]
        assert (field.low, field.high, field.symbol) == (about.low, about.high, about.symbol)
        assert knob(scene, f"lamp.strobe.{name}").value == getattr(FLASH, name)
    with pytest.raises(BrightfieldError, match=r"/World/lamp: Strobe\.period"):
        set_values(scene, {"lamp.strobe.period": 1e-4})


def test_the_editor_gives_a_lamp_a_strobe(tmp_path: Path) -> None:
    from composer.editor.commands import SetParameter

    workspace = Workspace()
    workspace.open(written(tmp_path))
    workspace.do(SetParameter("/World/lamp", "strobe.period", 0.005))
    workspace.do(SetParameter("/World/lamp", "strobe.duration", 2e-4))
    assert workspace.scene.lights[0].strobe == Strobe(0, 2e-4, 5e-3)


def moving(t_exp: float, flash: Strobe | None, **about: object) -> Image:
    """An edge at column 60 that moves right at 2000 px/s, as at the middle of the exposure."""
    sensor = Sensor((128, 6), frame_rate=100.0, responsivity=1.0)
    pixels = np.repeat((np.arange(128) >= 60)[None, :, None].astype(np.float32), 6, axis=0).repeat(3, axis=2)
    motion = np.broadcast_to(np.float32([20.0, 0.0]), (6, 128, 2))
    shutter = {"seconds": 0.0, "t_exp_s": t_exp, "line_time_s": 0.0, "bands": False, **about}
    made_by = {STROBED: {**shutter, "flash": flash and asdict(flash)}}
    return Image(
        pixels, camera=Camera(sensor=sensor, t_exp=t_exp), made_by=made_by, passes={"motion": motion}
    )


@pytest.mark.parametrize("start", [0.0, 4e-3, 9e-3])
def test_a_flash_freezes_what_moves(start: float) -> None:
    """10 ms at 2 px/ms blur over 20 px; a flash of 1 ms over 2 px, where the edge is then."""
    row = expose(moving(1e-2, Strobe(start, 1e-3)), until=Quantity.IRRADIANCE).pixels[3, :, 0]
    middle = 60 + 2e3 * (start + 0.5e-3 - 5e-3)
    assert 128 - row.sum() == pytest.approx(middle, abs=0.05)
    assert np.count_nonzero((row > 0.02) & (row < 0.98)) <= 4
    steady = expose(moving(1e-2, Strobe()), until=Quantity.IRRADIANCE).pixels[3, :, 0]
    assert np.count_nonzero((steady > 0.02) & (steady < 0.98)) >= 18


def test_light_of_several_times_is_no_single_blur() -> None:
    with pytest.raises(BrightfieldError, match="lamps that light it at different times"):
        expose(moving(1e-2, None), until=Quantity.IRRADIANCE)
    with pytest.raises(BrightfieldError, match="bands of a flash"):
        expose(moving(1e-2, Strobe(0, 1e-3), bands=True), until=Quantity.IRRADIANCE)
    with pytest.raises(
        BrightfieldError, match=r"must get one flash; 0\.01 s get several, one every 0\.002 s"
    ):
        expose(moving(1e-2, Strobe(0, 1e-3, 2e-3)), until=Quantity.IRRADIANCE)


@given(
    start=st.floats(-1, 1), duration=st.floats(1e-3, 0.5), gap=st.floats(0.6, 1), t0=st.floats(-3, 3),
    t_exp=st.floats(0.01, 0.5),
)  # fmt: skip
def test_light_comes_while_a_flash_is_on(
    start: float, duration: float, gap: float, t0: float, t_exp: float
) -> None:
    flash = Strobe(start, duration, duration + gap)
    low, high = flash.lit(t_exp, t0)
    assert float(high - low) == pytest.approx(float(flash.share(t_exp, t0)), abs=1e-9)
    if high - low > 1e-6:  # else it is as long as times are rounded
        assert float(flash.share((high - low) * t_exp, t0 + low * t_exp)) == pytest.approx(1, abs=1e-6)


def test_a_diagnosis_takes_each_captures_own_share(tmp_path: Path) -> None:
    from analysis.gap.compared.conditions import conditions
    from interchange.captures import Capture, Captures

    lamp = replace(LAMP, strobe=Strobe(0, 2e-4, 5e-3, 8.0))
    file = tmp_path / "scene.usda"
    stage = author_scene(Scene(lights=(lamp,), cameras=(Camera("/World/eye", sensor=Sensor((8, 6))),)))
    stage.GetRootLayer().Export(str(file))
    seconds = (1e-4, 1e-3, 1e-2)
    taken = tuple(Capture(f"{s}.png", "/World/eye", 0, s, np.ones((6, 8, 3), np.float32)) for s in seconds)
    found = conditions(Captures(file, file, taken), open_scene(file))
    brightness = {c.camera.t_exp: c.scene.lights[0].intensity[0] / 3 for c in found}
    assert brightness == pytest.approx({1e-4: 8.0, 1e-3: 1.6, 1e-2: 0.32}, rel=1e-6)
    text = file.read_text().replace(
        'def Camera "eye"\n    {', 'def Camera "eye"\n    {\n        custom double sensor:lineTime = 1e-3'
    )
    assert "lineTime" in text
    file.write_text(text)
    with pytest.raises(BrightfieldError, match="alike in all rows of a capture"):
        conditions(Captures(file, file, taken), open_scene(file))


def test_a_plan_of_captures_refuses_flashes(tmp_path: Path) -> None:
    from analysis.gap.capture_plan import _candidates

    file = tmp_path / "scene.usda"
    stage = author_scene(Scene(lights=(replace(LAMP, strobe=FLASH),), cameras=(Camera("/World/eye"),)))
    stage.GetRootLayer().Export(str(file))
    with pytest.raises(BrightfieldError, match="always on get all; /World/lamp flashes"):
        _candidates(open_scene(file), None, {}, tmp_path, lambda *_: None)
