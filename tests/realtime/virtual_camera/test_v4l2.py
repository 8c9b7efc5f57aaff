"""Video4Linux: through a loopback device where the kernel has one; else one clear error, and the kernel's layout."""

import shutil
import struct
import subprocess
from pathlib import Path

import cv2
import numpy as np
import pytest

from interchange.problems import BrightfieldError
from realtime.virtual_camera.camera import VirtualCamera
from realtime.virtual_camera.transports import v4l2

HEADER = Path("/usr/include/linux/videodev2.h")
PROGRAM = """
#include <linux/videodev2.h>
#include <stdio.h>
#include <string.h>
int main() {
  struct v4l2_format f;
  memset(&f, 0, sizeof f);
  f.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
  f.fmt.pix.width = 64; f.fmt.pix.height = 48; f.fmt.pix.pixelformat = V4L2_PIX_FMT_Y12;
  f.fmt.pix.field = V4L2_FIELD_NONE; f.fmt.pix.bytesperline = 128; f.fmt.pix.sizeimage = 6144;
  f.fmt.pix.colorspace = V4L2_COLORSPACE_SRGB;
  unsigned long numbers[] = {VIDIOC_QUERYCAP, VIDIOC_S_FMT, sizeof(struct v4l2_capability)};
  fwrite(numbers, sizeof numbers, 1, stdout);
  fwrite(&f, sizeof f, 1, stdout);
}
"""


def test_without_a_device_there_is_one_clear_error(empty, live, monkeypatch, tmp_path):
    monkeypatch.setattr(v4l2, "DEVICES", tmp_path)
    (tmp_path / "video0").write_text("no device")
    with (
        pytest.raises(BrightfieldError, match="there is none"),
        live.streaming(empty, live.Flat(), v4l2.V4l2),
    ):
        pass


@pytest.mark.skipif(
    not (HEADER.exists() and shutil.which("cc")), reason="no C compiler with the kernel's headers"
)
def test_numbers_and_layout_are_the_kernels(empty, live, tmp_path):
    (tmp_path / "layout.c").write_text(PROGRAM)
    subprocess.run(["cc", "layout.c", "-o", "layout"], cwd=tmp_path, check=True)
    said = subprocess.run([tmp_path / "layout"], capture_output=True, check=True).stdout
    query, format, size = struct.unpack_from("3L", said)
    assert (query & 0xFFFFFFFF, format & 0xFFFFFFFF) == (v4l2.QUERY_CAPABILITY, v4l2.SET_FORMAT)
    assert size == v4l2.CAPABILITY.size
    sensor = live.UNIT.__class__(resolution=(64, 48), bit_depth=12)
    scene = empty.__class__(empty.bodies, (), (live.camera_above(sensor=sensor),))
    with VirtualCamera(scene, draw=live.Pattern(), format="Mono12") as camera:
        assert v4l2.format_of(camera.take()) == said[24:]


@pytest.mark.skipif(not v4l2.loopbacks(), reason="the kernel has no v4l2loopback device here")
def test_opencv_opens_the_device(empty, live):
    with live.streaming(empty, live.Flat(), v4l2.V4l2, frame_rate=50):
        capture = cv2.VideoCapture(str(v4l2.loopbacks()[0]), cv2.CAP_V4L2)
        pictures = [capture.read()[1] for _ in range(5)]
        capture.release()
    assert all(np.ptp(p) <= 2 for p in pictures)
