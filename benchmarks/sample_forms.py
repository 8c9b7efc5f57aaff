"""The sample captures in other forms, to diagnose: 8 bits, grey, sRGB-encoded, four of them, no tolerances declared, by
a mosaic of colours, raw, interpolated, through a colour matrix, as a picture (8 bits by sRGB's curve), and as JPEGs: of
that picture, with a scene file that says so or not, and of the 8 bits as they are; and by other curves, 8 bits: powers,
that of Rec. 709, and sRGB's with a steeper middle, as pictures are toned.

python benchmarks/sample_forms.py CASE OUT    # CASE: a folder of the sample captures, with captures.json
brightfield diagnose OUT/eight/captures.json --no-verify --out OUT/eight/out
"""

import argparse
import json
import shutil
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from pxr import Sdf, Usd, UsdGeom

BLACK, HIGHEST = 64, 4095  # DN of the sample's sensor
FEW = (0, 2, 4, 6)
SATURATING = np.array([[1.5, -0.4, -0.1], [-0.25, 1.45, -0.2], [-0.05, -0.5, 1.55]])  # of red, green, blue
QUALITY = 95


def eight(dn: np.ndarray) -> np.ndarray:
    """The highest 8 of 12 bits."""
    return (dn >> 4).astype(np.uint8)


def grey(dn: np.ndarray) -> np.ndarray:
    return np.rint(dn.mean(axis=2)).astype(np.uint16)


def by_curve(curve: Callable[[np.ndarray], np.ndarray]) -> Callable[[np.ndarray], np.ndarray]:
    """Black taken off, a curve of [0, 1], 8 bits."""

    def encoded(dn: np.ndarray) -> np.ndarray:
        x = np.clip((dn.astype(float) - BLACK) / (HIGHEST - BLACK), 0, 1)
        return np.rint(255 * curve(x)).astype(np.uint8)

    return encoded


def iec_61966(x: np.ndarray) -> np.ndarray:
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def bt_709(x: np.ndarray) -> np.ndarray:
    return np.where(x < 0.018, 4.5 * x, 1.099 * x**0.45 - 0.099)


def toned(x: np.ndarray) -> np.ndarray:
    y = iec_61966(x)
    return 0.6 * y + 0.4 * y * y * (3 - 2 * y)


srgb = by_curve(iec_61966)


def raw(dn: np.ndarray) -> np.ndarray:
    """What pixels behind an RGGB mosaic measure, of 12 bits. OpenCV's order of channels is blue, green, red."""
    out = dn[..., 1].copy()
    out[::2, ::2], out[1::2, 1::2] = dn[::2, ::2, 2], dn[1::2, 1::2, 0]
    return out


def interpolated(dn: np.ndarray) -> np.ndarray:
    """The same, bilinear."""
    return np.asarray(cv2.demosaicing(raw(dn), cv2.COLOR_BayerRGGB2BGR))


def colours(dn: np.ndarray) -> np.ndarray:
    """Interpolated, then further apart: rows of the matrix have the sum 1."""
    linear = (interpolated(dn).astype(float) - BLACK) @ SATURATING[::-1, ::-1].T + BLACK
    return np.clip(np.rint(linear), 0, HIGHEST).astype(np.uint16)


def picture(dn: np.ndarray) -> np.ndarray:
    """That by sRGB's curve, of 8 bits."""
    return srgb(colours(dn))


KINDS = {
    int: Sdf.ValueTypeNames.Int,
    str: Sdf.ValueTypeNames.Token,
    list: Sdf.ValueTypeNames.FloatArray,
    bool: Sdf.ValueTypeNames.Bool,
}
SAID = {  # of the cameras that ``jpeg`` is taken by
    "blackLevel": 0,
    "mosaic": "RGGB",
    "demosaic": "bilinear",
    "colorCorrection": SATURATING.ravel().tolist(),
    "response": "sRGB",
    "outputBitDepth": 8,
    "jpegQuality": QUALITY,
    "jpegSubsampling": True,
}


FORMS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "eight": eight, "grey": grey, "srgb": srgb, "raw": raw, "interpolated": interpolated, "colours": colours,
    "picture": picture, "jpeg": picture, "declared": picture, "compressed": eight,
    "gamma_0.45": by_curve(lambda x: x**0.45), "gamma_0.7": by_curve(lambda x: x**0.7), "rec709": by_curve(bt_709),
    "toned": by_curve(toned),
}  # fmt: skip
PACKED = ("jpeg", "declared", "compressed")  # files of QUALITY, colour at half the resolution


def say(scene: Path) -> None:
    """Cameras of the scene file have all that ``SAID`` says."""
    stage = Usd.Stage.Open(str(scene))
    for prim in stage.Traverse():
        if prim.IsA(UsdGeom.Camera):
            for name, value in SAID.items():
                prim.CreateAttribute(f"sensor:{name}", KINDS[type(value)]).Set(value)
    stage.Save()


def written(case: Path, folder: Path, image: str, form: str) -> str:
    """An image of the case in a form, into ``folder``; its name there."""
    there = Path(image).with_suffix(".jpg") if form in PACKED else Path(image)
    quality = [cv2.IMWRITE_JPEG_QUALITY, QUALITY] if form in PACKED else []
    cv2.imwrite(
        str(folder / there), FORMS[form](cv2.imread(str(case / image), cv2.IMREAD_UNCHANGED)), quality
    )
    return str(there)


def main() -> None:
    p = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    p.add_argument("case", type=Path)
    p.add_argument("out", type=Path)
    args = p.parse_args()
    head = json.loads((args.case / "captures.json").read_text())
    for name in (*FORMS, "few", "undeclared"):
        folder = args.out / name
        shutil.copytree(args.case, folder, dirs_exist_ok=True)
        own = dict(head)
        if name == "few":
            own["captures"] = [head["captures"][k] for k in FEW]
        elif name == "undeclared":
            own.pop("tolerances", None)
        else:
            own["captures"] = [
                {**c, "image": written(args.case, folder, c["image"], name)} for c in head["captures"]
            ]
        if name == "declared":
            say(folder / head["scene"])
        (folder / "captures.json").write_text(json.dumps(own, indent=1))
        print(folder / "captures.json")


if __name__ == "__main__":
    main()
