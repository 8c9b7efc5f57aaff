"""`brightfield series focus IMAGES`: a focus bracket as one sharp image, and which frame is sharpest where."""

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from composer.series_files import write_colors, write_map
from interchange.problems import BrightfieldError


def options(p: argparse.ArgumentParser) -> None:
    p.add_argument("images", type=Path, nargs="+", metavar="IMAGE", help="in the order of focus")
    p.add_argument(
        "--smoothness", type=float, default=0.5, help="0: each pixel's sharpest frame; large: one for all"
    )
    p.add_argument("--window", type=float, default=3.0, metavar="PX", help="of the local contrast")
    p.add_argument("--aligned", action="store_true", help="take the images as they are, do not align them")


def run(args: argparse.Namespace) -> dict[str, Any]:
    from analysis.series.focus import fine_contrast, stack
    from interchange.formats import images

    if args.smoothness < 0 or args.window <= 0:
        raise BrightfieldError("--smoothness must be 0 or more, --window greater than 0.")
    frames = [images.read(path) for path in args.images]
    found = stack([f.astype(np.float32) for f in frames], args.smoothness, args.window, args.aligned)
    rows, columns = (np.flatnonzero(found.inside.any(axis=a)) for a in (1, 0))
    if not len(rows):
        raise BrightfieldError("The images must show one place in all; after alignment none is in every one.")
    seen = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    top = float(np.iinfo(frames[0].dtype).max) if frames[0].dtype.kind == "u" else float(found.image.max())
    write_map(args.out / "fused.exr", found.image[seen])
    write_colors(args.out / "fused.png", np.clip(_rgb(found.image[seen]) / top, 0, 1))
    write_map(args.out / "frame.exr", found.frame[seen])
    write_colors(args.out / "frame.png", _scale_of_colors(found.frame[seen] / (len(frames) - 1)))
    nearest = np.rint(found.frame[seen]).astype(int)
    own = [float(c[seen].mean()) for c in found.contrast]
    fused = fine_contrast(found.image.mean(axis=2), args.window)[seen]
    best = fine_contrast(frames[int(np.argmax(own))].astype(np.float32).mean(axis=2), args.window)[seen]
    return {
        "images": [p.name for p in args.images],
        "scales": [round(float(s), 5) for s in found.scales],
        "share_of_each": [round(float((nearest == k).mean()), 4) for k in range(len(frames))],
        "best_single_image": args.images[int(np.argmax(own))].name,
        "contrast_over_best_single": float(fused.mean() / best.mean()),
        "size_px": [len(columns), len(rows)],
    }


def _rgb(image: np.ndarray) -> np.ndarray:
    return np.repeat(image, 3, axis=2) if image.shape[2] == 1 else image[..., :3]


def _scale_of_colors(share: np.ndarray) -> np.ndarray:
    """(H, W, 3): dark blue is the first frame, yellow the last."""
    from matplotlib import colormaps

    return np.asarray(colormaps["viridis"](np.clip(share, 0, 1))[..., :3])
