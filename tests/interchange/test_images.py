"""Image files: every sample comes back as it was written, textures are linear, damaged files end in a sentence."""

import struct
import zipfile
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image as Pillow

from interchange.formats import exr, images, png
from interchange.formats.document import open_file
from interchange.image import Image
from interchange.problems import BrightfieldError, FileError

DAMAGED = Path(__file__).parents[2] / "assets" / "damaged_images"
H, W = 23, 31


def noise(dtype: type, planes: int = 1) -> np.ndarray:
    rng = np.random.default_rng(planes)
    if np.dtype(dtype).kind == "f":
        return rng.standard_normal((H, W, planes)).astype(dtype)
    return rng.integers(0, np.iinfo(dtype).max, (H, W, planes), dtype, endpoint=True)


def chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png_file(
    bits: int, color: int, rows: bytes, *extra: tuple[bytes, bytes], cut: int | None = None
) -> bytes:
    header = struct.pack(">IIBBBBB", W, H, bits, color, 0, 0, 0)
    chunks = [(b"IHDR", header), *extra, (b"IDAT", zlib.compress(rows)[:cut]), (b"IEND", b"")]
    return png.SIGNATURE + b"".join(chunk(*c) for c in chunks)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("planes", [1, 2, 3, 4])
def test_png_gives_back_every_number(dtype: type, planes: int, tmp_path: Path) -> None:
    array = noise(dtype, planes)
    images.write_png(tmp_path / "a.png", array)
    picture = images.load(tmp_path / "a.png")
    assert picture.array.dtype == dtype
    np.testing.assert_array_equal(picture.array, array)
    assert picture.channels == ("Y", "YA", "RGB", "RGBA")[planes - 1]
    other = cv2.imread(str(tmp_path / "a.png"), cv2.IMREAD_UNCHANGED)
    if planes == 3:
        np.testing.assert_array_equal(other[..., ::-1], array)
    assert [p.name for p in tmp_path.iterdir()] == ["a.png"]


def test_png_reads_what_another_program_wrote_with_any_filter(tmp_path: Path) -> None:
    smooth = np.cumsum(np.ones((64, 64, 3), np.uint8), axis=1, dtype=np.uint8) + noise(np.uint8)[0, 0]
    Pillow.fromarray(smooth).save(tmp_path / "a.png", optimize=True)
    np.testing.assert_array_equal(images.read(tmp_path / "a.png"), smooth)


@pytest.mark.parametrize("bits", [1, 2, 4])
def test_png_of_few_bits_is_widened(bits: int, tmp_path: Path) -> None:
    values = np.random.default_rng(bits).integers(0, 2**bits, (H, W))
    spread = (values[..., None] >> np.arange(bits - 1, -1, -1) & 1).astype(np.uint8).reshape(H, -1)
    rows = b"".join(b"\0" + r.tobytes() for r in np.packbits(spread, axis=1))
    (tmp_path / "grey.png").write_bytes(png_file(bits, 0, rows))
    picture = images.load(tmp_path / "grey.png")
    assert picture.bits == bits
    np.testing.assert_array_equal(picture.array[..., 0], values * (255 // (2**bits - 1)))
    table = np.random.default_rng(9).integers(0, 256, (2**bits, 3), np.uint8)
    (tmp_path / "palette.png").write_bytes(png_file(bits, 3, rows, (b"PLTE", table.tobytes())))
    picture = images.load(tmp_path / "palette.png")
    assert picture.about["palette"] == 2**bits
    np.testing.assert_array_equal(picture.array, table[values])
    alpha = bytes([7])
    transparent = png_file(bits, 3, rows, (b"PLTE", table.tobytes()), (b"tRNS", alpha))
    (tmp_path / "alpha.png").write_bytes(transparent)
    expected = np.dstack([table[values], np.where(values == 0, 7, 255)])
    np.testing.assert_array_equal(images.read(tmp_path / "alpha.png"), expected)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.float64])
@pytest.mark.parametrize("planes", [1, 3])
@pytest.mark.parametrize("packing", [1, 5, 8, 32773])
def test_tiff_gives_back_every_number(dtype: type, planes: int, packing: int, tmp_path: Path) -> None:
    array = noise(dtype, planes)
    path = tmp_path / "a.tif"
    assert cv2.imwrite(str(path), array[..., ::-1], [cv2.IMWRITE_TIFF_COMPRESSION, packing])
    found = images.read(path)
    assert found.dtype == dtype
    np.testing.assert_array_equal(found, array)


def classic_tiff(order: str, tags: dict[int, tuple[str, list[int]]], strips: list[bytes]) -> bytes:
    """A TIFF by hand: what other programs write and OpenCV does not."""
    kinds = {"H": 3, "I": 4}
    head = struct.pack(order + "2sHI", b"II" if order == "<" else b"MM", 42, 8)
    tags = {**tags, 273: ("I", [0] * len(strips)), 279: ("I", [len(s) for s in strips])}
    extra_at = 8 + 2 + 12 * len(tags) + 4
    sizes = [struct.calcsize(order + f"{len(v)}{k}") for k, v in (tags[t] for t in sorted(tags))]
    at = extra_at + sum(s for s in sizes if s > 4)
    tags[273] = ("I", list(at + np.cumsum([0, *map(len, strips)])[:-1]))
    entries, extra = b"", b""
    for tag in sorted(tags):
        kind, values = tags[tag]
        data = struct.pack(order + f"{len(values)}{kind}", *values)
        place = data.ljust(4, b"\0") if len(data) <= 4 else struct.pack(order + "I", extra_at + len(extra))
        extra += data if len(data) > 4 else b""
        entries += struct.pack(order + "HHI", tag, kinds[kind], len(values)) + place
    return head + struct.pack(order + "H", len(tags)) + entries + bytes(4) + extra + b"".join(strips)


@pytest.mark.parametrize("order", ["<", ">"])
def test_tiff_of_either_byte_order_in_planes_with_predictor(order: str, tmp_path: Path) -> None:
    array = noise(np.uint16, 3)
    differences = np.diff(array, axis=1, prepend=np.uint16(0)).astype(array.dtype)
    planes = [zlib.compress(differences[..., c].astype(f"{order}u2").tobytes()) for c in range(3)]
    tags = {256: [W], 257: [H], 258: [16] * 3, 259: [8], 262: [2], 277: [3], 278: [H], 284: [2], 317: [2]}
    data = classic_tiff(order, {t: ("H", v) for t, v in tags.items()}, planes)
    (tmp_path / "a.tif").write_bytes(data)
    np.testing.assert_array_equal(images.read(tmp_path / "a.tif"), array)


def test_tiff_white_is_zero_and_palette(tmp_path: Path) -> None:
    array = noise(np.uint8)
    tags = {256: [W], 257: [H], 258: [8], 262: [0], 278: [10]}
    strips = [array[y : y + 10].tobytes() for y in range(0, H, 10)]
    (tmp_path / "w.tif").write_bytes(classic_tiff("<", {t: ("H", v) for t, v in tags.items()}, strips))
    np.testing.assert_array_equal(images.read(tmp_path / "w.tif"), 255 - array)
    table = np.random.default_rng(1).integers(0, 2**16, (3, 256))
    tags = {**tags, 262: [3], 320: list(table.ravel())}
    (tmp_path / "p.tif").write_bytes(classic_tiff(">", {t: ("H", v) for t, v in tags.items()}, strips))
    np.testing.assert_array_equal(images.read(tmp_path / "p.tif"), table.T[array[..., 0]])


def test_what_has_no_exact_numbers_is_refused(tmp_path: Path) -> None:
    Pillow.fromarray(noise(np.uint8, 4), "CMYK").save(tmp_path / "a.jpg")
    with pytest.raises(FileError, match="CMYK colours have no exact RGB"):
        images.read(tmp_path / "a.jpg")
    Pillow.fromarray(noise(np.uint8, 4), "CMYK").save(tmp_path / "a.tif")
    with pytest.raises(FileError, match="only grey, RGB and palette"):
        images.read(tmp_path / "a.tif")
    (tmp_path / "t.png").write_bytes(b"no image at all")
    with pytest.raises(FileError, match="does not begin like PNG"):
        images.read(tmp_path / "t.png")
    with pytest.raises(BrightfieldError, match="uint8 or uint16"):
        images.write_png(tmp_path / "f.png", np.ones((4, 4)))


def test_jpeg_is_near_and_says_so(tmp_path: Path) -> None:
    smooth = np.add.outer(np.arange(64), np.arange(80)).astype(np.uint8)
    for name, array in (("grey", smooth), ("rgb", np.repeat(smooth[..., None], 3, axis=2))):
        Pillow.fromarray(array).save(tmp_path / f"{name}.jpg", quality=95)
        picture = open_file(tmp_path / f"{name}.jpg")
        assert np.abs(picture.array.squeeze().astype(int) - array).max() <= 3  # quantisation at this quality
        assert "lossy" in picture.about["note"]


def test_radiance_hdr(tmp_path: Path) -> None:
    values = np.exp(noise(np.float32, 3))
    cv2.imwrite(str(tmp_path / "a.hdr"), values)
    found = images.read(tmp_path / "a.hdr")
    # 8 bits of mantissa are shared by the three channels: half a step of 2^-8 of the largest, cut or rounded
    assert (np.abs(found - values[..., ::-1]).max(axis=2) <= values.max(axis=2) / 127).all()


def png_with(dtype: type, planes: int, path: Path, extra: tuple[bytes, bytes] | None = None) -> np.ndarray:
    array = noise(dtype, planes)
    images.write_png(path, array)
    if extra:
        data = path.read_bytes()
        path.write_bytes(data[:33] + chunk(*extra) + data[33:])  # after the header chunk
    return array


@pytest.mark.parametrize(
    ("dtype", "planes", "space", "extra", "decoded"),
    [
        (np.uint8, 3, "auto", None, True),
        (np.uint8, 4, "auto", None, True),
        (np.uint8, 1, "auto", None, False),
        (np.uint8, 2, "auto", None, False),
        (np.uint16, 3, "auto", None, False),
        (np.uint8, 3, "raw", None, False),
        (np.uint16, 1, "sRGB", None, True),
        (np.uint16, 3, "auto", (b"sRGB", b"\0"), True),
        (np.uint8, 3, "auto", (b"gAMA", struct.pack(">I", 100_000)), False),
    ],
)
def test_texture_color_space(
    dtype: type, planes: int, space: str, extra: tuple[bytes, bytes] | None, decoded: bool, tmp_path: Path
) -> None:
    array = png_with(dtype, planes, tmp_path / "a.png", extra) / np.iinfo(dtype).max
    found = images.texture(tmp_path / "a.png", space, channels="rgba")
    assert found.dtype == np.float32
    color = array[..., : 3 if planes > 2 else 1]
    expected = images.decode_srgb(color) if decoded else color
    np.testing.assert_allclose(found[..., :3], np.broadcast_to(expected, (H, W, 3)), rtol=1e-6, atol=1e-9)
    alpha = array[..., -1] if planes in (2, 4) else np.ones((H, W))
    np.testing.assert_allclose(found[..., 3], alpha, rtol=1e-6)


def test_texture_scale_bias_and_channels(tmp_path: Path) -> None:
    array = png_with(np.uint8, 4, tmp_path / "a.png") / 255
    normal = images.texture(tmp_path / "a.png", "raw", (2, 2, 2, 1), (-1, -1, -1, 0), "rgb")
    np.testing.assert_allclose(normal, 2 * array[..., :3] - 1, atol=1e-6)
    green = images.texture(tmp_path / "a.png", "raw", (1, 3, 1, 1), (0, 0.5, 0, 0), "g")
    np.testing.assert_allclose(green[..., 0], 3 * array[..., 1] + 0.5, rtol=1e-6)
    with pytest.raises(FileError, match='must be auto, sRGB or raw; got "srgb"'):
        images.texture(tmp_path / "a.png", "srgb")


def test_texture_from_exr_and_usdz(tmp_path: Path) -> None:
    values = noise(np.float32, 3)
    exr.write(tmp_path / "a.exr", Image(values))
    np.testing.assert_array_equal(images.texture(tmp_path / "a.exr"), values)
    array = png_with(np.uint8, 3, tmp_path / "a.png")
    with zipfile.ZipFile(tmp_path / "a.usdz", "w") as archive:
        archive.write(tmp_path / "a.png", "0/a.png")
    np.testing.assert_array_equal(images.read(f"{tmp_path}/a.usdz[0/a.png]"), array)
    with pytest.raises(FileError, match="archive"):
        images.read(f"{tmp_path}/a.usdz[0/b.png]")


def test_srgb_is_the_standard() -> None:
    # IEC 61966-2-1: the two branches meet at 0.04045; sRGB grey 119/255 is linear 0.18447
    assert images.decode_srgb(np.array(119 / 255)) == pytest.approx(0.184475, abs=1e-6)
    x = np.linspace(0, 1, 1001)
    np.testing.assert_allclose(images.encode_srgb(images.decode_srgb(x)), x, atol=1e-7)
    edge = np.array([0.04045 - 1e-9, 0.04045 + 1e-9])
    assert np.ptp(images.decode_srgb(edge)) < 1e-7


def test_a_picture_for_the_screen_keeps_the_order_and_marks_what_is_no_number() -> None:
    radiance = np.linspace(0, 4, 256).reshape(16, 16, 1)
    radiance[3, 4] = np.nan
    picture = images.to_display(radiance, exposure=0.25)
    assert picture.shape == (16, 16, 3)
    assert tuple(picture[3, 4]) == (255, 0, 255)
    grey = np.delete(picture[..., 1].ravel(), 3 * 16 + 4).astype(int)
    assert grey[0] == 0
    assert grey[-1] == 255
    assert (np.diff(grey) >= 0).all()
    assert images.to_display(np.zeros((4, 4, 3))).max() == 0
    assert images.to_display(1e-9 * np.ones((4, 4, 3))).min() == 255


def refused(path: Path) -> bool:
    try:
        images.read(path)
    except FileError as error:
        found = error
    else:
        return False
    assert "\n" not in str(found)
    return True


def test_a_bomb_is_refused_at_once(tmp_path: Path) -> None:
    header = chunk(b"IHDR", struct.pack(">IIBBBBB", 2_000_000_000, 2_000_000_000, 16, 6, 0, 0, 0))
    body = chunk(b"IDAT", zlib.compress(bytes(1 << 20))) + chunk(b"IEND", b"")
    (tmp_path / "a.png").write_bytes(png.SIGNATURE + header + body)
    with pytest.raises(FileError, match="must fit into 2 GiB"):
        images.read(tmp_path / "a.png")
    header = chunk(b"IHDR", struct.pack(">IIBBBBB", 20_000, 20_000, 8, 0, 0, 0, 0))
    (tmp_path / "b.png").write_bytes(png.SIGNATURE + header + chunk(b"IDAT", bytes(99)) + chunk(b"IEND", b""))
    with pytest.raises(FileError, match="cannot fill its size"):
        images.read(tmp_path / "b.png")
    tags = {t: ("I", [v]) for t, v in {256: 2**31, 257: 2**31, 258: 8, 262: 1}.items()}
    (tmp_path / "c.tif").write_bytes(classic_tiff("<", tags, [b"123"]))
    with pytest.raises(FileError, match="must fit into 2 GiB"):
        images.read(tmp_path / "c.tif")


@pytest.mark.parametrize("ending", [".png", ".tif", ".jpg", ".hdr", ".bmp"])
def test_a_file_cut_off_anywhere_is_refused(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"a{ending}"
    cv2.imwrite(str(path), noise(np.float32 if ending == ".hdr" else np.uint8, 3))
    data = path.read_bytes()
    for length in np.linspace(0, len(data) - 8, 25, dtype=int):  # a BMP ends with padding
        path.write_bytes(data[:length])
        assert refused(path), length


@pytest.mark.parametrize("ending", [".png", ".tif", ".jpg", ".bmp"])
@given(at=st.floats(0, 1), value=st.binary(min_size=1, max_size=8))
@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_overwritten_bytes_end_in_a_sentence_or_an_image(
    ending: str, at: float, value: bytes, tmp_path: Path
) -> None:
    path = tmp_path / f"a{ending}"
    cv2.imwrite(str(path), noise(np.uint8, 3))
    data = bytearray(path.read_bytes())
    start = int(at * (len(data) - 1))
    data[start : start + len(value)] = value
    path.write_bytes(data)
    changed = bytes(data)
    if not refused(path) and ending == ".png":
        array = images.read(path)  # a checksum guards every chunk that is used
        np.testing.assert_array_equal(array, png_pixels(changed))


def png_pixels(data: bytes) -> np.ndarray:
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)[..., ::-1]


@pytest.mark.parametrize("path", sorted(DAMAGED.glob("*.png")), ids=lambda p: p.name)
def test_files_that_crashed_other_readers(path: Path) -> None:
    assert refused(path)


def test_a_texture_has_colour_or_grey(tmp_path: Path) -> None:
    exr.write(tmp_path / "a.exr", Image(noise(np.float32, 6)))
    with pytest.raises(FileError, match="1 to 4 channels"):
        images.texture(tmp_path / "a.exr")


def test_an_image_of_many_megabytes(tmp_path: Path) -> None:
    array = np.random.default_rng(5).integers(0, 256, (1500, 2000, 3), np.uint8)
    images.write_png(tmp_path / "a.png", array)
    np.testing.assert_array_equal(images.read(tmp_path / "a.png"), array)
