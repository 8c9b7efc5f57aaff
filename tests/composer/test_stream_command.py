"""`brightfield stream`: from a scene file to frames, and one clear error for each thing that cannot be."""

import re

import pytest

from composer.cli import main

SCENE = """#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = 1
    upAxis = "Z"
)
def Xform "World" {
    def Mesh "Part" {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(-0.02, -0.02, 0), (0.02, -0.02, 0), (0.02, 0.02, 0), (-0.02, 0.02, 0)]
    }
    def DistantLight "Sun" {
        float inputs:intensity = 100
        float inputs:angle = 0
    }
    def Camera "Top" {
        float focalLength = 250
        float horizontalAperture = 64
        float verticalAperture = 48
        float2 clippingRange = (0.01, 10)
        double3 xformOp:translate = (0, 0, 0.5)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        custom int2 sensor:resolution = (64, 48)
        custom float sensor:responsivity = 1000
        float exposure:time = 0.001
    }
}
"""


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "scene.usda"
    path.write_text(SCENE)
    return str(path)


def test_a_stream_says_where_it_is_ends_and_tells_how_it_went(scene, capsys):
    assert main(["stream", scene, "--port", "0", "--as", "mjpeg", "shm", "--frames", "3", "--fps", "20"]) == 0
    out, err = capsys.readouterr()
    assert re.search(r"http://127\.0\.0\.1:\d+/Top\.mjpg", out)
    assert "shm:brightfield-Top" in out
    assert "Top: 3 frames" in err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--as", "mjpg"], 'No transport is called "mjpg". Did you mean "mjpeg"?'),
        (["--camera", "Topp"], 'No camera is called "Topp". Did you mean "Top"?'),
        (["--format", "Mono14"], 'No pixel format is called "Mono14"'),
        (["--fps", "0"], "must lie in"),
        (["--frames", "-1"], "--frames must not be negative"),
        (["--port", "65536"], "--port must lie in [0, 65535]"),
        (["--conveyor", "/World/Prat"], 'which the scene does not have. Did you mean "/World/Part"?'),
        (["--address", "192.0.2.1", "--port", "0"], "Nothing can be served at 192.0.2.1"),
        (["--maps", "motion"], "A frame can carry"),
    ],
)
def test_what_cannot_be_streamed_is_one_clear_error(scene, capsys, words, message):
    assert main(["stream", scene, "--frames", "1", *words]) == 2
    err = capsys.readouterr().err
    assert message in err
    assert err.startswith("brightfield: ")
