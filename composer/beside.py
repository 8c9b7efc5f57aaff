"""What is written beside a frame: one image a lamp, and a PNG to look at."""

from pathlib import Path

from interchange.formats import exr
from interchange.formats.images import to_display, write_png
from interchange.image import Image


def split_lamps(file: Path) -> list[Path]:
    """Write each lamp's layer of a frame as an image of its own: ``frame.Led00.exr`` beside ``frame.exr``."""
    image = exr.read(file)
    written = []
    for name, pixels in image.passes.items():
        if name.startswith("light:"):
            lamp = name.removeprefix("light:").rsplit("/", 1)[-1]
            out = file.with_suffix(f".{lamp}.exr")
            exr.write(out, Image(pixels, image.quantity, image.camera, {**image.made_by, "light": name}))
            written.append(out)
    return written


def write_preview(file: Path) -> Path:
    """A PNG beside a frame, for looking at."""
    out = file.with_suffix(".png")
    write_png(out, to_display(exr.read(file).pixels))
    return out
