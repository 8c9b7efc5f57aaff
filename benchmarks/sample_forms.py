"""The sample captures in other forms, to diagnose: 8 bits, grey, sRGB-encoded, four of them, no tolerances declared.

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

BLACK, HIGHEST = 64, 4095  # DN of the sample's sensor
FEW = (0, 2, 4, 6)


def eight(dn: np.ndarray) -> np.ndarray:
    """The highest 8 of 12 bits."""
    return (dn >> 4).astype(np.uint8)


def grey(dn: np.ndarray) -> np.ndarray:
    return np.rint(dn.mean(axis=2)).astype(np.uint16)


def srgb(dn: np.ndarray) -> np.ndarray:
    """Black taken off, IEC 61966-2-1, 8 bits."""
    x = np.clip((dn.astype(float) - BLACK) / (HIGHEST - BLACK), 0, 1)
    y = np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)
    return np.rint(255 * y).astype(np.uint8)


FORMS: dict[str, Callable[[np.ndarray], np.ndarray]] = {"eight": eight, "grey": grey, "srgb": srgb}


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
            for c in head["captures"]:
                image = cv2.imread(str(args.case / c["image"]), cv2.IMREAD_UNCHANGED)
                cv2.imwrite(str(folder / c["image"]), FORMS[name](image))
        (folder / "captures.json").write_text(json.dumps(own, indent=1))
        print(folder / "captures.json")


if __name__ == "__main__":
    main()
