"""OpenEXR: what is written comes back, other software reads it, and damaged files end in one sentence."""

import os
import struct
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from interchange.camera import Camera, Lens, Projection, Sensor
from interchange.formats import exr
from interchange.formats.document import open_file
from interchange.formats.exr_header import read_header
from interchange.formats.exr_pixels import read_channels
from interchange.image import Image, Quantity
from interchange.problems import BrightfieldError, FileError

os.environ["OPENCV_IO_ENABLE_OPENEXR"] = "1"
DAMAGED = Path(__file__).parents[2] / "assets" / "damaged_images"
H, W = 37, 53  # neither a multiple of ZIP's 16 rows nor even


@pytest.fixture
def image() -> Image:
    rng = np.random.default_rng(1)

    def noise(*shape: int) -> np.ndarray:
        return rng.standard_normal((H, W, *shape)).astype(np.float32)

    depth, position = noise(), noise(3)
    depth[3:9] = np.inf
    position[3:9] = np.nan
    ids = rng.integers(-1, 7, (H, W)).astype(np.int32)
    pose = np.eye(4)
    pose[:3, 3] = 0.1, 1 / 3, np.pi
    camera = Camera(
        name="/World/Camera0",
        world_from_camera=pose,
        lens=Lens(16e-3, 4.0, 0.3, (0.1, -0.02, 1e-3, -1e-4, 0.0, 0.0, 1 / 7, 0.0), Projection.PERSPECTIVE),
        sensor=Sensor(
            (W, H), (3.45e-6, 3.5e-6), 123.4, 1e4, 10, 5.5, 2.5, prnu=0.01, dsnu=1.5, dark_current=3.0
        ),
        principal_point=(26.25, 17.5),
        t_exp=1 / 60,
    )
    return Image(
        pixels=noise(3),
        quantity=Quantity.IRRADIANCE,
        camera=camera,
        made_by={"renderer": "realtime", "settings": {"samples": 4}, "seed": np.int64(3), "residual": 1e-3},
        passes={
            "depth": depth,
            "position": position,
            "normal": noise(3),
            "object_id": ids,
            "material_id": ids[::-1].copy(),
            "motion": noise(2),
            "direct": noise(3),
            "indirect": noise(3),
            "lit:/World/Lights/Ring/Led_0": noise(),
            "light:/World/Lights/Ring/Led_0": noise(3),
            "light:/World/Lights/Größe": noise(3),
            "light:/" + "x" * 400: noise(3),
        },
        object_names=("/World/Part", "/World/Größe"),
        material_names=("/World/Materials/metal",),
    )


def test_what_is_written_comes_back(image: Image, tmp_path: Path) -> None:
    exr.write(tmp_path / "a.exr", image)
    back = open_file(tmp_path / "a.exr")
    assert back.pixels.dtype == np.float32
    np.testing.assert_array_equal(back.pixels, image.pixels)
    assert list(back.passes) == list(image.passes)
    for name, values in image.passes.items():
        assert back.passes[name].dtype == values.dtype
        np.testing.assert_array_equal(back.passes[name], values)
    assert back.quantity is Quantity.IRRADIANCE
    assert back.made_by == {**image.made_by, "seed": 3}
    assert (back.object_names, back.material_names) == (image.object_names, image.material_names)
    a, b = image.camera, back.camera
    assert a is not None
    assert b is not None
    np.testing.assert_array_equal(a.world_from_camera, b.world_from_camera)
    for name in ("name", "lens", "sensor", "principal_point", "clip", "t_exp"):
        assert getattr(a, name) == getattr(b, name)
    assert list(tmp_path.iterdir()) == [tmp_path / "a.exr"]  # nothing beside


@pytest.mark.parametrize("planes", [1, 2, 3, 4, 31])
def test_any_number_of_planes_comes_back(planes: int, tmp_path: Path) -> None:
    pixels = np.arange(4 * 5 * planes, dtype=np.float32).reshape(4, 5, planes)
    exr.write(tmp_path / "a.exr", Image(pixels))
    np.testing.assert_array_equal(exr.read(tmp_path / "a.exr").pixels, pixels)


def test_channel_names_are_the_contract(image: Image, tmp_path: Path) -> None:
    exr.write(tmp_path / "a.exr", image)
    names = {c.name: c.kind for c in read_header(tmp_path / "a.exr").channels}
    for name in ("R", "depth.Z", "position.X", "normal.Z", "motion.Y", "direct.G", "indirect.B"):
        assert names[name] == "float"
    assert names["object_id.I"] == names["material_id.I"] == "uint"
    assert {"lit:/World/Lights/Ring/Led_0.V", "light:/World/Lights/Ring/Led_0.R"} <= set(names)
    assert read_channels(tmp_path / "a.exr")["object_id.I"].max() == 0xFFFFFFFF


def test_openexr_and_opencv_read_the_same_numbers(image: Image, tmp_path: Path) -> None:
    import cv2

    exr.write(tmp_path / "a.exr", image)
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        theirs = {name: c.pixels.copy() for name, c in file.channels().items()}
    ours = read_channels(tmp_path / "a.exr")
    assert set(ours) == set(theirs)
    for name, values in theirs.items():
        np.testing.assert_array_equal(ours[name], values)
    rgb = cv2.imread(str(tmp_path / "a.exr"), cv2.IMREAD_UNCHANGED)[..., ::-1]
    np.testing.assert_array_equal(rgb, image.pixels)


@pytest.mark.parametrize("compression", ["NO", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "DWAA"])
@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.uint32])
def test_every_packing_gives_what_the_library_gives(compression: str, dtype: type, tmp_path: Path) -> None:
    values = (np.random.default_rng(2).random((H, W)) * 100).astype(dtype)
    header = {"compression": getattr(OpenEXR, f"{compression}_COMPRESSION"), "type": OpenEXR.scanlineimage}
    path = tmp_path / "a.exr"
    OpenEXR.File(header, {"Y": values, "A": values[::-1].copy()}).write(str(path))
    with OpenEXR.File(str(path), separate_channels=True) as file:
        expected = {name: c.pixels.copy() for name, c in file.channels().items()}
    found = read_channels(path)
    for name in ("Y", "A"):
        np.testing.assert_array_equal(found[name], expected[name])
    if compression in ("NO", "RLE", "ZIPS", "ZIP", "PIZ"):
        np.testing.assert_array_equal(found["Y"], values)


def test_tiles_and_the_first_of_several_parts(tmp_path: Path) -> None:
    values = np.random.default_rng(3).random((70, 90)).astype(np.float32)
    tiles = OpenEXR.TileDescription()
    tiles.xSize = tiles.ySize = 32
    tiles.mode = OpenEXR.ONE_LEVEL
    OpenEXR.File({"type": OpenEXR.tiledimage, "tiles": tiles}, {"Y": values}).write(str(tmp_path / "t.exr"))
    np.testing.assert_array_equal(exr.read(tmp_path / "t.exr").pixels[..., 0], values)
    parts = [
        OpenEXR.Part({"name": name, "type": OpenEXR.scanlineimage}, {"Y": values + i})
        for i, name in enumerate(("left", "right"))
    ]
    OpenEXR.File(parts).write(str(tmp_path / "m.exr"))
    image = exr.read(tmp_path / "m.exr")
    np.testing.assert_array_equal(image.pixels[..., 0], values)
    assert image.made_by["parts"] == ["left", "right"]


def test_a_foreign_file_is_radiance_and_says_that_nobody_said_so(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    names = ["R", "G", "B", "A", "Z", "ViewLayer.Normal.X", "ViewLayer.Normal.Y", "ViewLayer.Normal.Z"]
    planes = {name: rng.random((H, W)).astype(np.float16) for name in names}
    header = {"type": OpenEXR.scanlineimage, "software": "other"}
    OpenEXR.File(header, dict(planes)).write(str(tmp_path / "f.exr"))
    image = exr.read(tmp_path / "f.exr")
    np.testing.assert_array_equal(image.pixels, np.stack([planes[c] for c in "RGB"], -1).astype(np.float32))
    assert image.quantity is Quantity.RADIANCE
    assert "does not say" in image.made_by["note"]
    assert image.made_by["software"] == "other"
    assert set(image.passes) == {"alpha", "Z", "ViewLayer.Normal"}
    assert image.passes["ViewLayer.Normal"].shape == (H, W, 3)


def test_the_data_window_lies_in_the_display_window(tmp_path: Path) -> None:
    header = {
        "type": OpenEXR.scanlineimage,
        "dataWindow": ((-2, 3), (5, 8)),
        "displayWindow": ((0, 0), (9, 9)),
    }
    values = np.arange(6 * 8, dtype=np.float32).reshape(6, 8)
    OpenEXR.File(header, {"Y": values}).write(str(tmp_path / "w.exr"))
    image = exr.read(tmp_path / "w.exr")
    expected = np.zeros((10, 10), np.float32)
    expected[3:9, 0:6] = values[:, 2:]
    np.testing.assert_array_equal(image.pixels[..., 0], expected)


def test_what_is_no_image_is_refused(tmp_path: Path) -> None:
    plane = np.ones((4, 4), np.float32)
    OpenEXR.File({"type": OpenEXR.scanlineimage}, {"depth.Z": plane}).write(str(tmp_path / "z.exr"))
    with pytest.raises(FileError, match=r"R, G, B or Y; this file has depth\.Z"):
        exr.read(tmp_path / "z.exr")
    OpenEXR.File({"type": OpenEXR.scanlineimage, "brightfield": "{}"}, {"Y": plane}).write(
        str(tmp_path / "j.exr")
    )
    with pytest.raises(FileError, match="brightfield"):
        exr.read(tmp_path / "j.exr")
    with pytest.raises(BrightfieldError, match="must have the image's size"):
        exr.write(tmp_path / "b.exr", Image(np.ones((4, 4, 3)), passes={"depth": np.ones((5, 4))}))
    with pytest.raises(FileError, match="cannot be written"):
        exr.write(tmp_path / "nowhere" / "b.exr", Image(np.ones((4, 4, 3))))


def damaged(path: Path) -> FileError | None:
    """The error of a damaged file, or None where it still reads; anything else fails the test."""
    try:
        exr.read(path)
    except FileError as error:
        found = error
    else:
        return None
    assert "\n" not in str(found)
    return found


@pytest.mark.parametrize("compression", ["ZIP", "PIZ"])
def test_a_file_cut_off_anywhere_is_refused(compression: str, image: Image, tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    header = {"compression": getattr(OpenEXR, f"{compression}_COMPRESSION"), "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {c: image.pixels[..., i].copy() for i, c in enumerate("RGB")}).write(str(path))
    data = path.read_bytes()
    for length in np.linspace(0, len(data) - 1, 20, dtype=int):
        path.write_bytes(data[:length])
        assert damaged(path) is not None, length


@given(at=st.floats(0, 1), value=st.binary(min_size=1, max_size=8))
@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_overwritten_bytes_end_in_a_sentence_or_an_image(at: float, value: bytes, tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    exr.write(path, Image(np.linspace(0, 1, 20 * 18 * 3).reshape(20, 18, 3)))
    data = bytearray(path.read_bytes())
    start = int(at * (len(data) - 1))
    data[start : start + len(value)] = value
    path.write_bytes(data)
    damaged(path)


def test_a_header_that_asks_for_terabytes_is_refused_at_once(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    exr.write(path, Image(np.ones((4, 4, 3))))
    data = path.read_bytes()
    for name in (b"dataWindow", b"displayWindow"):
        box = data.index(name) + len(name) + 1 + len(b"box2i\0") + 4
        huge = data[:box] + struct.pack("<4i", 0, 0, 900_000, 900_000) + data[box + 16 :]
        path.write_bytes(huge)
        error = damaged(path)
        assert error is not None
        assert "must fit into" in str(error)


@pytest.mark.parametrize("path", sorted(DAMAGED.glob("*.exr")), ids=lambda p: p.name[:30])
def test_files_that_crashed_other_readers(path: Path) -> None:
    error = damaged(path)
    assert error is not None
    assert "Not a usable OpenEXR file" in str(error)
