"""A camera is streamed from the editor: what an edit changes is in the frames that a client reads."""

import io
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from composer.commands.edit import edit_from
from composer.editor.live_camera import LiveCamera
from composer.editor.workspace import Workspace


@pytest.fixture
def workspace() -> Workspace:
    made = Workspace()
    made.run(
        [
            "add_solid kind=box name=Part size=[0.05,0.05,0.05]",
            "add_lamp kind=sphere position=[0.1,-0.1,0.4] intensity=2",
            "add_camera name=Top position=[0,0,0.4] resolution=[64,48] pixel_pitch=4e-5 exposure=0.01",
        ]
    )
    return made


@pytest.fixture
def live(workspace: Workspace) -> Iterator[LiveCamera]:
    with LiveCamera(workspace, "Top", port=0, samples=1) as camera:
        yield camera


def fetched(live: LiveCamera, what: str) -> bytes:
    root = live.lines[0].split(".mjpg")[0]
    end = time.monotonic() + 60
    while True:
        try:
            with urllib.request.urlopen(root + what, timeout=30) as answer:
                return bytes(answer.read())
        except urllib.error.HTTPError as error:  # no frame has been taken yet
            if error.code != 503 or time.monotonic() > end:
                raise
            time.sleep(0.05)


def waited(read: Callable[[], bool], seconds: float = 60.0) -> bool:
    """Until it holds; frames that were under way before an edit may still come."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if read():
            return True
        time.sleep(0.02)
    return False


def frame(live: LiveCamera) -> np.ndarray:
    return np.asarray(np.load(io.BytesIO(fetched(live, ".npy")))).astype(float)


def test_an_edit_and_its_undoing_are_in_the_stream(workspace: Workspace, live: LiveCamera) -> None:
    first = frame(live)
    black = 64 + 5  # DN of the sensor's black level, and its noise
    middle = np.s_[20:28, 28:36]
    assert first[middle].mean() > 2 * black, "the part is lit"
    workspace.do("place path=/World/Part position=[0.5,0,0]")
    assert waited(lambda: frame(live)[middle].mean() < black), "it is out of view"
    workspace.undo()
    assert waited(lambda: abs(frame(live)[middle].mean() / first[middle].mean() - 1) < 0.05)


def test_lines_that_come_in_are_edits(workspace: Workspace, capsys: pytest.CaptureFixture[str]) -> None:
    lines = ["rename path=/World/Part name=Block\n", "undo\n", "ad_lamp\n", "redo\n", "\n"]
    edit_from(lines, workspace)
    assert [b.name for b in workspace.scene.bodies] == ["/World/Block"]
    assert 'Did you mean "add_lamp"?' in capsys.readouterr().err


def test_exposure_follows_the_document(workspace: Workspace, live: LiveCamera) -> None:
    bright = frame(live).mean()
    workspace.do("set_parameter path=/World/Top name=t_exp value=0.002")  # a fifth of the light
    assert waited(lambda: frame(live).mean() < 0.6 * bright)


@pytest.mark.parametrize(
    ("edit", "told"),
    [
        ("delete paths=/World/Top", "no camera /World/Top any more"),
        ("set_parameter path=/World/Top name=sensor.resolution value=[32,24]", "is another one"),
    ],
)
def test_a_stream_that_lost_its_camera_ends_and_says_so(
    workspace: Workspace, live: LiveCamera, edit: str, told: str
) -> None:
    workspace.do(edit)
    assert told in live.problem
    assert not live.lines
    assert workspace.watchers == []
