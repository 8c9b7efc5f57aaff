"""What a sweep leaves beside its images: the manifest, COCO and BOP, and a summary.

| file               | holds                                                                                      |
|--------------------|--------------------------------------------------------------------------------------------|
| ``manifest.parquet`` | a row a frame: files, every number that was set, weight, what is seen of each defect       |
| ``coco.json``      | boxes and masks of objects and defects                                                     |
| ``bop/``           | poses, models (interchange.formats.bop)                                                    |
| ``sweep.json``     | how many samples, which constraint rejected how many, seconds                              |
| ``plan.yaml``      | the plan as it was read                                                                    |
"""

import json
import os
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from analysis.sweep.plan import Plan
from interchange.formats import bop, coco, parquet
from interchange.formats.atomic import written_beside
from interchange.formats.document import open_scene
from offline.batch import Report


def write_datasets(
    plan: Plan, design: Any, records: Sequence[dict[str, Any]], folder: Path, report: Report
) -> dict[str, Any]:
    """Returns the summary."""
    weights = [float(w) for w in design.weights]
    about = {
        "brightfield.program": _version(),
        "brightfield.scene": str(plan.scene),
        "brightfield.plan": plan.text,
        "brightfield.units": json.dumps(dict(plan.units), ensure_ascii=False),
    }
    parquet.write(folder / "manifest.parquet", [row(plan, r, weights[r["sample"]]) for r in records], about)
    if "coco" in plan.writes:
        coco.write(
            folder / "coco.json", [_picture(r, weights) for r in records], _categories(plan), plan.file.name
        )
    if "bop" in plan.writes and records:
        entries: dict[int, dict[int, Any]] = {}
        for record in records:
            number = plan.cameras.index(record["camera"])
            entries.setdefault(number, {})[record["frame"]] = record["bop"]
        bop.write_scenes(folder / "bop", entries)
        scene = open_scene(plan.scene).scene(plan.times[0])
        camera = scene.camera(plan.cameras[0])
        camera = camera.resized(plan.width) if plan.width else camera
        bop.write_models(folder / "bop", scene, camera, plan.objects)
    summary = {
        "plan": plan.file.name,
        "samples": len(design.rows),
        "drawn": design.drawn,
        "rejected": dict(design.rejected),
        "frames": len(records),
        "found_finished": len(report.skipped),
        "failed": [list(f) for f in report.failed],
        "sum_of_weights": sum(weights),
        "effective_samples": sum(weights) ** 2 / sum(w * w for w in weights) if any(weights) else 0.0,
        "seconds": round(report.seconds, 3),
    }
    _text(folder / "sweep.json", json.dumps(summary, indent=1, ensure_ascii=False) + "\n")
    _text(folder / "plan.yaml", plan.text)
    return summary


def row(plan: Plan, record: dict[str, Any], weight: float) -> dict[str, Any]:
    """A frame's line of the manifest."""
    out: dict[str, Any] = {
        "frame": record["frame"],
        "sample": record["sample"],
        "weight": weight,
        "camera": record["camera"],
        "time": record["time"],
        "width": record["size"][0],
        "height": record["size"][1],
        "renderer": record["renderer"],
        "samples": plan.rendering.samples,
        "seed": plan.seed,
        "job": record["job"],
        "mean_dn": record["mean_dn"],
        "saturated_share": record["saturated_share"],
        "seconds": record["seconds"],
        **{f"file.{k}": v for k, v in record["files"].items() if not k.startswith("mask")},
        **record["values"],
    }
    for seen in record["instances"]:
        out[f"pixels.{seen['name']}"] = seen["pixels"]
        out[f"box.{seen['name']}"] = seen["box"]
    return out


def _picture(record: dict[str, Any], weights: Sequence[float]) -> coco.Picture:
    shown = [
        coco.Annotated(
            i["name"] if i["kind"] == "object" else i["kind"],
            i["box"],
            i["pixels"],
            i["rle"],
            {
                "name": i["name"],
                "visible_share": i["pixels"] / i["pixels_whole"] if i["pixels_whole"] else 0.0,
            },
        )
        for i in record["instances"]
    ]
    width, height = record["size"]
    return coco.Picture(
        record["frame"],
        record["files"]["image"],
        (width, height),
        shown,
        {"weight": weights[record["sample"]], "camera": record["camera"], "time": record["time"]},
    )


def _categories(plan: Plan) -> list[tuple[str, str]]:
    kinds = dict.fromkeys(d.kind for d in plan.defects)
    return [*((name, "object") for name in plan.objects), *((kind, "defect") for kind in kinds)]


def _version() -> str:
    try:
        return version("brightfield")
    except PackageNotFoundError:
        return "not installed"


def _text(path: Path, text: str) -> None:
    beside = written_beside(path)
    beside.write_text(text, encoding="utf-8")
    os.replace(beside, path)
