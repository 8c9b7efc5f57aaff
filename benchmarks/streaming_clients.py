"""Consumers of the streaming benchmark, each in a process of its own: KIND PLACE prints a line when the picture's
middle turns bright or dark, with the time (ns since 1970) at which the pixels were there."""

import ctypes
import sys
import time

import cv2
import numpy as np


def middle(picture: np.ndarray) -> bool:
    height, width = picture.shape[:2]
    return bool(picture[height // 2 - 2 : height // 2 + 2, width // 2 - 2 : width // 2 + 2].mean() > 45)


def opencv(place: str):
    capture = cv2.VideoCapture(place, cv2.CAP_FFMPEG)
    while True:
        there, picture = capture.read()
        if not there:
            return
        yield picture


def shared(place: str):
    from realtime.virtual_camera.reader import SharedReader

    for frame in SharedReader(place, timeout=20):
        yield frame.pixels


def aravis(place: str):
    """``place``: address of the device. Through libaravis 0.8, which knows nothing of us."""
    library, Pointer = ctypes.CDLL("libaravis-0.8.so.0"), ctypes.c_void_p

    def call(name, result, *arguments):
        function = getattr(library, name)
        kinds = {int: ctypes.c_uint64, bytes: ctypes.c_char_p}
        function.restype, function.argtypes = result, [kinds.get(type(a), Pointer) for a in arguments]
        return function(*arguments)

    nothing = Pointer()
    camera = Pointer(call("arv_camera_new", Pointer, place.encode(), nothing))
    stream = Pointer(call("arv_camera_create_stream", Pointer, camera, nothing, nothing, nothing))
    payload = call("arv_camera_get_payload", ctypes.c_uint, camera, nothing)
    region = [ctypes.c_int() for _ in range(4)]
    call("arv_camera_get_region", None, camera, *(Pointer(ctypes.addressof(r)) for r in region), nothing)
    for _ in range(8):
        call(
            "arv_stream_push_buffer", None, stream, Pointer(call("arv_buffer_new_allocate", Pointer, payload))
        )
    call("arv_camera_start_acquisition", None, camera, nothing)
    while True:
        buffer = Pointer(call("arv_stream_timeout_pop_buffer", Pointer, stream, 5_000_000))
        if not buffer.value:
            return
        if call("arv_buffer_get_status", ctypes.c_int, buffer) == 0:
            size = ctypes.c_size_t()
            data = call("arv_buffer_get_image_data", Pointer, buffer, Pointer(ctypes.addressof(size)))
            shape = region[3].value, region[2].value
            yield np.frombuffer(
                (ctypes.c_uint8 * (shape[0] * shape[1])).from_address(data), np.uint8
            ).reshape(shape)
        call("arv_stream_push_buffer", None, stream, buffer)


if __name__ == "__main__":
    read = {"mjpeg": opencv, "rtsp": opencv, "shm": shared, "gige": aravis}[sys.argv[1]]
    before = None
    for shown in read(sys.argv[2]):
        now, bright = time.time_ns(), middle(shown)
        if bright != before:
            print(int(bright), now, flush=True)
        before = bright
