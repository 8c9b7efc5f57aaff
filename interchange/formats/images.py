"""Image files of integers and floats: PNG, TIFF, JPEG, BMP, TGA, Radiance HDR; textures; screen pictures.

``read`` gives the file's own numbers, which are DN where a camera wrote it. ``texture`` gives linear values
as UsdUVTexture defines them. ``to_display`` makes 8 bits for the eye, never for measuring.
"""

import io
import os
import re
import warnings
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from interchange.formats import exr, png, tiff
from interchange.formats.atomic import written_beside
from interchange.formats.base import Format, Options
from interchange.formats.isolation import isolated
from interchange.formats.png import MAX_BYTES, DamagedImage, Decoded
from interchange.problems import BrightfieldError, FileError, Problem, Where

COLOR_SPACES = ("auto", "sRGB", "raw")
ARCHIVED = re.compile(r"(.+\.usdz)\[(.+)\]", re.IGNORECASE)
PILLOW = {".jpg": "JPEG", ".jpeg": "JPEG", ".bmp": "BMP", ".tga": "TGA"}


@dataclass(frozen=True, eq=False)
class Picture:
    """``array`` (h, w, C) uint8, uint16, uint32 or float, row 0 on top; ``channels``: Y, YA, RGB or RGBA.

    ``bits`` a sample has in the file (1, 2 and 4 are widened to 8, so that the top value is always 255).
    ``srgb``: whether the file says that it is sRGB-encoded; None where it says nothing.
    """

    array: np.ndarray
    channels: str
    bits: int
    format: str
    srgb: bool | None = None
    about: dict[str, str | int | float] = field(default_factory=dict)
    file: str = ""


def read(path: Path | str) -> np.ndarray:
    """The exact samples (h, w, C) of an image file, channels in the order Y, YA, RGB or RGBA."""
    return load(path).array


def load(path: Path | str) -> Picture:
    """An image file, or a member of a USDZ archive ("a.usdz[b.png]"), with what it says of itself.

    Raises FileError for damaged files, for pixels beyond 2 GiB and for what has no exact RGB (CMYK).
    """
    path = Path(path)
    data = _bytes(path)
    kind = _kind(data, path)
    try:
        match kind:
            case "PNG":
                found = png.decode(data)
            case "TIFF":
                found = tiff.decode(data, path)
            case "Radiance HDR":
                found = _radiance(data, path)
            case _:
                found = _pillow(data, kind)
    except DamagedImage as error:
        raise FileError(Problem(f"Not a usable {kind} file: {error}.", Where(str(path)))) from None
    return Picture(found.array, found.channels, found.bits, kind, found.srgb, found.about, str(path))


def _bytes(path: Path) -> bytes:
    where = Where(str(path))
    try:
        if not (member := ARCHIVED.fullmatch(str(path))):
            return path.read_bytes()
        with zipfile.ZipFile(member[1]) as archive:
            if archive.getinfo(member[2]).file_size > MAX_BYTES:
                raise FileError(Problem(f"The file must fit into {MAX_BYTES >> 30} GiB.", where))
            return archive.read(member[2])
    except OSError as error:
        raise FileError(Problem(f"The file cannot be read: {error.strerror}.", where)) from None
    except (KeyError, zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError) as error:
        raise FileError(Problem(f"The archive cannot be read: {error}", where)) from None


def _kind(data: bytes, path: Path) -> str:
    if data.startswith(png.SIGNATURE):
        return "PNG"
    if tiff.is_tiff(data):
        return "TIFF"
    if data.startswith((b"#?RADIANCE", b"#?RGBE")):
        return "Radiance HDR"
    return "JPEG" if data.startswith(b"\xff\xd8") else PILLOW.get(path.suffix.lower().rstrip("]"), "image")


def _pillow(data: bytes, kind: str) -> Decoded:
    from PIL import Image as Pillow
    from PIL import UnidentifiedImageError

    if kind == "image":
        raise DamagedImage("it does not begin like PNG, TIFF, JPEG, BMP, TGA or HDR")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Pillow.DecompressionBombWarning)  # at twice its size: an error
            image = Pillow.open(io.BytesIO(data), formats=[kind])
            modes = {"1": "L", "L": "L", "P": "RGBA" if "transparency" in image.info else "RGB"}
            mode = modes.get(image.mode, image.mode)
            channels = {"L": "Y", "LA": "YA", "RGB": "RGB", "RGBA": "RGBA"}.get(mode)
            if channels is None:
                raise DamagedImage(f"{image.mode} colours have no exact RGB; save it as RGB or grey")
            array = np.asarray(image.convert(mode) if mode != image.mode else image)
    except UnidentifiedImageError:
        raise DamagedImage("its header is damaged") from None
    except Pillow.DecompressionBombError:
        raise DamagedImage("it has more pixels than an image of its kind may") from None
    except (OSError, ValueError, SyntaxError, IndexError, TypeError, EOFError) as error:
        raise DamagedImage(str(error).rstrip(".") or "it is damaged") from None
    about: dict[str, str | int | float] = {}
    if kind == "JPEG":
        about["note"] = "lossy: its DN are near what the sensor gave, not equal"
        if (turn := image.getexif().get(274, 1)) != 1:
            about["orientation"] = int(turn)
    return Decoded(array[..., None] if array.ndim == 2 else array, channels, 8, None, about)


def _radiance(data: bytes, path: Path) -> Decoded:
    lines = data[:65536].split(b"\n\n", 1)
    words = lines[-1].split(b"\n", 1)[0].split() if len(lines) == 2 else []
    if len(words) != 4 or words[0] not in (b"-Y", b"+Y") or not (words[1].isdigit() and words[3].isdigit()):
        raise DamagedImage("its resolution line is missing")
    height, width = int(words[1]), int(words[3])
    if not 0 < height * width * 12 <= MAX_BYTES:
        raise DamagedImage(f"pixels must fit into {MAX_BYTES >> 30} GiB; it is {width} x {height} px")
    from interchange.formats.native import opencv

    array = isolated(opencv.decode, path, data, memory_bytes=(1 << 30) + 48 * width * height)
    if array.shape != (height, width, 3):
        raise DamagedImage("its pixels do not unpack")
    return Decoded(array, "RGB", 32, False, {})


def write_png(path: Path | str, array: np.ndarray) -> None:
    """Write (h, w), (h, w, 1), (h, w, 2), (h, w, 3) or (h, w, 4), uint8 or uint16, beside and renamed.

    The numbers in the file are those of the array. Raises BrightfieldError for any other array.
    """
    _write_integers(Path(path), array, "PNG", png.encode, 4)


def write(path: Path | str, array: np.ndarray) -> None:
    """Write (h, w), (h, w, 1) or (h, w, 3), uint8 or uint16, as PNG or TIFF by the name, beside and renamed.

    The numbers in the file are those of the array. Raises BrightfieldError for any other array or name.
    """
    path = Path(path)
    if array.ndim == 3 and array.shape[2] not in (1, 3):
        raise BrightfieldError(f"An image of DN must have 1 or 3 channels; got {array.shape[2]}. ({path})")
    match path.suffix.lower():
        case ".png":
            _write_integers(path, array, "PNG", png.encode, 3)
        case ".tif" | ".tiff":
            _write_integers(path, array, "TIFF", tiff.encode, 3)
        case _:
            raise BrightfieldError(
                f"Integers are written to a file that ends in .png, .tif or .tiff; got {path}."
            )


def _write_integers(
    path: Path, array: np.ndarray, kind: str, encode: Callable[[np.ndarray], bytes], most: int
) -> None:
    shape_ok = array.ndim in (2, 3) and array.size > 0 and (array.ndim == 2 or array.shape[2] <= most)
    if not shape_ok or array.dtype not in (np.uint8, np.uint16):
        raise BrightfieldError(
            f"A {kind} must have 1 to {most} channels of uint8 or uint16; got {array.shape} {array.dtype}. ({path})"
        )
    beside = written_beside(path)
    try:
        beside.write_bytes(encode(array))
        os.replace(beside, path)
    except OSError as error:
        raise FileError(Problem(f"The file cannot be written: {error.strerror}.", Where(str(path)))) from None
    finally:
        beside.unlink(missing_ok=True)


def decode_srgb(encoded: np.ndarray) -> np.ndarray:
    """Linear values of sRGB-encoded ones, both in [0, 1]. IEC 61966-2-1:1999."""
    return np.where(encoded <= 0.04045, encoded / 12.92, ((np.maximum(encoded, 0) + 0.055) / 1.055) ** 2.4)


def encode_srgb(linear: np.ndarray) -> np.ndarray:
    """sRGB-encoded values of linear ones, both in [0, 1]. IEC 61966-2-1:1999."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 0) ** (1 / 2.4) - 0.055)


def texture(
    path: Path | str,
    color_space: str = "auto",
    scale: tuple[float, ...] = (1.0, 1.0, 1.0, 1.0),
    bias: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0),
    channels: str = "rgb",
) -> np.ndarray:
    """Linear values (h, w, C) float32 of a texture file, as UsdUVTexture's output ``channels`` gives them.

    Integers become [0, 1]; R, G, B are decoded from sRGB where ``color_space`` is "sRGB", or "auto" and the
    file says so or, saying nothing, has 8 bits and three or four channels; then ``scale`` and ``bias``.
    ``channels``: one or more of r, g, b, a. Grey stands for r, g and b; a missing a is 1. Raises FileError.
    """
    path = Path(path)
    if color_space not in COLOR_SPACES:
        message = f'sourceColorSpace must be auto, sRGB or raw; got "{color_space}".'
        raise FileError(Problem(message, Where(str(path))))
    if not channels or set(channels) - set("rgba"):
        raise BrightfieldError(f'A texture\'s channels must be out of r, g, b, a; got "{channels}".')
    names, planes, srgb = _planes(path)
    decode = color_space == "sRGB" or (color_space == "auto" and srgb)
    picked = []
    for c in channels:
        source = c.upper() if c.upper() in names else "Y" if c != "a" else ""
        i = "rgba".index(c)
        if source:
            plane = planes[names.index(source)]
            picked.append(_linear(plane, decode and c != "a", scale[i], bias[i]))
        else:
            picked.append(np.full(planes[0].shape, scale[i] + bias[i], np.float32))
    return np.stack(picked, axis=-1)


def _planes(path: Path) -> tuple[str, list[np.ndarray], bool]:
    """Names of the planes (Y, YA, RGB, RGBA), the planes, and whether "auto" takes them as sRGB."""
    if path.suffix.lower() == ".exr":
        image = exr.read(path)
        planes = list(np.moveaxis(image.pixels, -1, 0))
        names, srgb = {1: "Y", 3: "RGB"}.get(len(planes), ""), False
        if names and "alpha" in image.passes:
            names, planes = f"{names}A", [*planes, image.passes["alpha"]]
    else:
        picture = load(path)
        planes = list(np.moveaxis(picture.array, -1, 0))
        names = picture.channels if len(picture.channels) == len(planes) else ""
        eight_bit_color = names.startswith("RGB") and picture.array.dtype == np.uint8
        srgb = picture.srgb if picture.srgb is not None else eight_bit_color
    if not names:
        message = f"A texture must have 1 to 4 channels (grey or RGB, alpha); this has {len(planes)}."
        raise FileError(Problem(message, Where(str(path))))
    return names, planes, srgb


def _linear(plane: np.ndarray, decode: bool, scale: float, bias: float) -> np.ndarray:
    """float32 values of one plane; whole numbers of 8 and 16 bits go through a table of all their values."""
    by_table = plane.dtype in (np.uint8, np.uint16)
    if plane.dtype.kind == "u":
        top = int(np.iinfo(plane.dtype).max)
        values = (np.arange(top + 1) if by_table else plane) / top
    else:
        values = plane.astype(np.float64)
    linear = ((decode_srgb(values) if decode else values) * scale + bias).astype(np.float32)
    return linear[plane] if by_table else linear


def to_display(radiance: np.ndarray, exposure: float | None = None) -> np.ndarray:
    """An 8 bit sRGB picture (h, w, 3) of radiance (h, w, 1) or (h, w, 3), for looking at only.

    Linear times ``exposure``, clipped at 1, sRGB-encoded. Without an exposure the 99.5th percentile of the
    brightest channel becomes 1. Values that are not finite are drawn magenta.
    """
    values = np.asarray(radiance, np.float64)
    values = values[..., None] if values.ndim == 2 else values
    finite = np.isfinite(values).all(axis=-1)
    if exposure is None:
        brightest = values.max(axis=-1)[finite]
        top = float(np.percentile(brightest, 99.5)) if brightest.size else 0.0
        if top <= 0:
            top = float(brightest.max(initial=0.0))
        exposure = 1.0 / top if top > 0 else 1.0
    shown = encode_srgb(np.clip(np.nan_to_num(values) * exposure, 0, 1))
    picture = np.rint(255 * np.broadcast_to(shown, (*shown.shape[:2], 3))).astype(np.uint8)
    picture[~finite] = (255, 0, 255)
    return picture


class Images(Format):
    name = "image"
    extensions = (".png", ".tif", ".tiff", ".jpg", ".jpeg", ".bmp", ".tga", ".hdr")
    holds = "image"

    def recognises(self, head: bytes) -> bool:
        return tiff.is_tiff(head) or head.startswith((png.SIGNATURE, b"\xff\xd8\xff", b"#?RADIANCE"))

    def read(self, path: Path, options: Options) -> Picture:
        return load(path)
