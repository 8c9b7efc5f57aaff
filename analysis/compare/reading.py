"""An image file as an Image with its quantity: only images of one quantity and one scale compare."""

from pathlib import Path

import numpy as np

from interchange.formats import exr, images
from interchange.image import Image, Quantity, same_quantity
from interchange.problems import BrightfieldError


def read(path: Path | str) -> Image:
    """EXR as it says (radiance where it says nothing), pictures of whole numbers as DN; ``made_by["bits"]`` a sample.

    (H, W, 1) or (H, W, 3); an alpha channel is left out. Raises FileError where the file is no image.
    """
    path = Path(path)
    if path.suffix.lower() == ".exr":
        image = exr.read(path)
        if not np.isfinite(image.pixels).all():
            raise BrightfieldError(f"Every pixel must be a finite number to be compared. ({path})")
        return Image(image.pixels, image.quantity, image.camera, {**image.made_by, "bits": 0})
    picture = images.load(path)
    colours = picture.array[..., : 3 if picture.array.shape[2] >= 3 else 1]
    if not np.issubdtype(colours.dtype, np.integer):
        return Image(colours.astype(np.float32), Quantity.RADIANCE, made_by={"bits": 0})
    return Image(colours.astype(np.float32), Quantity.DN, made_by={"bits": 8 * picture.array.dtype.itemsize})


def read_pair(a: Path | str, b: Path | str) -> tuple[Image, Image]:
    """Raises BrightfieldError unless quantity, bits and size are the same."""
    first, second = read(a), read(b)
    if first.pixels.shape[:2] == second.pixels.shape[:2] and first.quantity is second.quantity:
        one, other = first.made_by["bits"], second.made_by["bits"]
        if one != other:
            raise BrightfieldError(
                f"DN compare only with the same bits a sample; {Path(a).name} has {one} and {Path(b).name} {other}."
            )
        if first.pixels.shape[2] != second.pixels.shape[2]:
            raise BrightfieldError(
                f"Images compare only with the same channels; {Path(a).name} has {first.pixels.shape[2]} and "
                f"{Path(b).name} {second.pixels.shape[2]}."
            )
    same_quantity(first, second)
    return first, second
