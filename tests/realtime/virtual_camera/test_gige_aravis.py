"""GigE Vision by Aravis, a client that knows nothing of us."""

import ctypes
import ctypes.util
import json
from dataclasses import replace

import numpy as np
import pytest

from interchange.problems import BrightfieldError
from realtime.virtual_camera.transports.gige import Gige
from tests.realtime.virtual_camera.test_gige import device

LIBRARY = ctypes.util.find_library("aravis-0.8")
Pointer = ctypes.c_void_p


class Aravis:
    """Just enough of libaravis 0.8 to be a client."""

    def __init__(self):
        self.library = ctypes.CDLL(LIBRARY)
        self.glib = ctypes.CDLL("libgobject-2.0.so.0")
        self.glib.g_object_unref.argtypes = [Pointer]

    def call(self, name, result, *arguments, fails=True):
        function = getattr(self.library, name)
        kinds = {int: ctypes.c_int, float: ctypes.c_double, bytes: ctypes.c_char_p}
        function.argtypes = [kinds.get(type(a), Pointer) for a in arguments] + [Pointer] * fails
        function.restype = result
        error = Pointer()
        got = function(*arguments, *([ctypes.byref(error)] if fails else []))
        if error.value:  # struct GError: domain, code, message
            pytest.fail(f"{name}: {ctypes.c_char_p.from_address(error.value + 8).value.decode()}")
        return got


@pytest.mark.skipif(LIBRARY is None, reason="libaravis-0.8-0 is not installed: nothing to be read by")
def test_aravis_finds_two_cameras_sets_their_features_and_reads_them(empty, live):
    sensor = replace(live.UNIT, bit_depth=12)
    cameras = tuple(live.camera_above(n, sensor) for n in ("/World/Top", "/World/Side"))
    try:
        served = device(replace(empty, cameras=cameras), live.Flat(), Gige.port, frame_rate=10)
        transport = served.__enter__()
    except BrightfieldError as error:
        pytest.skip(f"the port of GigE Vision is taken on this machine: {error}")
    try:
        arv = Aravis()
        arv.call("arv_update_device_list", None, fails=False)
        count = arv.call("arv_get_n_devices", ctypes.c_uint, fails=False)
        ids = {arv.call("arv_get_device_id", ctypes.c_char_p, k, fails=False).decode() for k in range(count)}
        assert {f"Brightfield-VirtualCamera-{d.serial}" for d in transport.devices} <= ids
        target = transport.devices[1]
        camera = Pointer(
            arv.call("arv_camera_new", Pointer, f"Brightfield-VirtualCamera-{target.serial}".encode())
        )
        arv.call("arv_camera_set_pixel_format_from_string", None, camera, b"Mono12")
        arv.call("arv_camera_set_region", None, camera, 0, 0, 32, 16)
        arv.call("arv_camera_set_exposure_time", None, camera, 2000.0)
        arv.call("arv_camera_set_gain", None, camera, 6.0)
        arv.call("arv_camera_set_frame_rate", None, camera, 20.0)
        arv.call("arv_camera_set_chunk_mode", None, camera, 1)
        settings = target.camera.settings
        assert (settings.format.name, settings.region) == ("Mono12", (0, 0, 32, 16))
        assert (settings.t_exp, settings.gain_dB, settings.frame_rate) == (0.002, 6.0, 20.0)
        assert arv.call("arv_camera_get_exposure_time", ctypes.c_double, camera) == 2000.0
        stream = Pointer(arv.call("arv_camera_create_stream", Pointer, camera, Pointer(), Pointer()))
        payload = arv.call("arv_camera_get_payload", ctypes.c_uint, camera)
        for _ in range(8):
            new = arv.library.arv_buffer_new_allocate
            new.restype, new.argtypes = Pointer, [ctypes.c_size_t]
            arv.call("arv_stream_push_buffer", None, stream, Pointer(new(payload)), fails=False)
        arv.call("arv_camera_start_acquisition", None, camera)
        parser = Pointer(arv.call("arv_camera_create_chunk_parser", Pointer, camera, fails=False))
        pop = arv.library.arv_stream_timeout_pop_buffer
        pop.restype, pop.argtypes = Pointer, [Pointer, ctypes.c_uint64]
        numbers = []
        for _ in range(5):
            buffer = Pointer(pop(stream, 10_000_000))
            assert buffer.value
            assert arv.call("arv_buffer_get_status", ctypes.c_int, buffer, fails=False) == 0
            read = arv.library.arv_buffer_get_image_data
            read.restype, read.argtypes = Pointer, [Pointer, Pointer]
            size = ctypes.c_size_t()
            samples = np.frombuffer(ctypes.string_at(read(buffer, ctypes.byref(size)), 32 * 16 * 2), "<u2")
            assert np.ptp(samples) == 0
            number = arv.call(
                "arv_chunk_parser_get_integer_value", ctypes.c_int64, parser, buffer, b"ChunkFrameID"
            )
            text = arv.call(
                "arv_chunk_parser_get_string_value", ctypes.c_char_p, parser, buffer, b"ChunkTruth"
            )
            truth = json.loads(text)
            assert truth["number"] == number
            assert truth["exposure_s"] == 0.002
            # twice the time, 6 dB, 12 bits for 8
            possible = [min(live.level(k) * 2 * 10**0.3 * 4095 / 255, 4095) for k in range(8)]
            assert min(abs(samples[0] - p) for p in possible) <= 0.51
            numbers.append(number)
            arv.call("arv_stream_push_buffer", None, stream, buffer, fails=False)
        assert numbers == sorted(set(numbers))
        arv.call("arv_camera_stop_acquisition", None, camera)
        arv.call("arv_camera_set_trigger", None, camera, b"Software")
        assert target.camera.settings.triggered
        for thing in (parser, stream, camera):
            arv.glib.g_object_unref(thing)
    finally:
        served.__exit__(None, None, None)
