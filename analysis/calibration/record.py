"""A calibration as plain data, for ``calib.json``: everything that another program needs, uncertainty included."""

import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from analysis.calibration.calibration import Calibration
from analysis.calibration.cross_validation import CrossValidation
from interchange.distortion import NAMES


def record(calibration: Calibration, validations: dict[str, CrossValidation]) -> dict[str, Any]:
    """``cameras``: one a camera, with K, distortion, pose on the rig (camera_from_rig), parameters with σ and their
    covariance; ``images``: rms a view; ``outliers``; ``cross_validation`` by camera."""
    o = calibration.observations
    cameras = []
    for c, name in enumerate(o.cameras):
        camera = calibration.camera(c)
        places = [*calibration.bundle.of_camera(c), *calibration.bundle.of_pose(c)]
        cameras.append(
            {
                "name": name,
                "resolution": list(o.resolutions[c]),
                "model": calibration.model.lens.value,
                "K": camera.K.tolist(),
                "distortion": dict(zip(NAMES[calibration.model.lens], camera.lens.distortion, strict=False)),
                "camera_from_rig": camera.camera_from_world.tolist(),
                "parameters": [
                    {"name": n, "value": v, "sigma": s if np.isfinite(s) else None}
                    for n, v, s in calibration.parameters(c)
                ],
                "covariance": calibration.covariance[np.ix_(places, places)].tolist(),
            }
        )
    images = [
        {
            "image": v.image,
            "camera": o.cameras[v.camera],
            "points": int(v.used.sum()),
            "rms_px": float(np.sqrt((r[v.used] ** 2).sum(-1).mean())) if v.used.any() else None,
        }
        for v, r in zip(o.views, calibration.residuals, strict=True)
    ]
    return {
        "board": {"kind": o.board.name, "columns": o.board.columns, "rows": o.board.rows, "size_m": o.board.size},
        "rms_px": calibration.rms,
        "sigma_px": calibration.sigma,
        "points": calibration.used_points,
        "distance_m": calibration.distance,
        "cameras": cameras,
        "images": images,
        "missed": list(o.missed),
        "outliers": [
            {"image": x.image, "point": x.point, "pixel": list(x.pixel), "residual_px": x.residual}
            for x in calibration.outliers
        ],
        "cross_validation": {
            name: {
                "chi2": v.chi2, "degrees": v.degrees, "probability": v.probability, "ratio": v.ratio,
                "rms_px": v.rms, "agrees": v.agrees,
            }
            for name, v in validations.items()
        },
    }  # fmt: skip


def write(path: Path, data: dict[str, Any]) -> None:
    """As JSON, beside and renamed."""
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    beside.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    os.replace(beside, path)
