"""What a sweep wrote, read back by pycocotools, pandas, and a reader of BOP's format that shares nothing with the
writer.

bop_toolkit is no package of a registry; the reader below follows its bop_datasets_format.md, with trimesh for models.
"""

import json
from pathlib import Path

import numpy as np
import pandas
import pytest
import trimesh
from PIL import Image as Pillow
from pycocotools import mask as coco_masks
from pycocotools.coco import COCO

from analysis.sweep.datasets import write_datasets
from analysis.sweep.design import design
from analysis.sweep.job import is_done, read_record, work
from analysis.sweep.placing import scene_of
from analysis.sweep.plan_file import read
from analysis.sweep.run import jobs_of
from interchange.formats import exr
from interchange.formats.document import open_scene
from interchange.formats.rle import decode, encode
from offline.batch import Report
from realtime.renderers.rasterizer import Rasterizer

EXAMPLES = Path(__file__).parents[3] / "docs/examples"
PLAN = f"""
scene: {EXAMPLES / "station.usda"}
sampling: {{method: sobol, count: 4, seed: 3}}
renderer: {{name: realtime, samples: 2}}
objects: [Plate, Plug]
width: 96
times: [0, 5]
parameters:
  Led0.intensity: {{range: [0.02, 0.1], unit: W/sr}}
  Camera.own.rz: {{range: [-20, 20], unit: deg}}
  Plate.pose.rz: {{range: [-15, 15], unit: deg}}
  Plug.pose.tx: {{samples: {{0: 0, 5: -4}}, unit: mm}}
defects:
  - kind: stain
    on: Plate
    present: {{values: [0, 1], shares: [0.5, 0.5], nature: [0.9, 0.1]}}
    x: {{range: [-12, 0], unit: mm}}
    y: {{samples: {{0: -8, 5: 8}}, unit: mm}}
    radius: {{value: 3, unit: mm}}
  - {{kind: missing_part, on: Plug, present: {{values: [0, 1], shares: [0.5, 0.5]}}}}
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sweep")
    (folder / "plan.yaml").write_text(PLAN, encoding="utf-8")
    plan = read(folder / "plan.yaml")
    found = design(plan)
    jobs = jobs_of(plan, found.rows, folder / "out", open_scene(plan.scene).digest)
    for job in jobs:
        work(job)
        assert is_done(job)
    records = [read_record(job) for job in jobs]
    write_datasets(plan, found, records, folder / "out", Report((), ()))
    return plan, found, jobs, folder / "out"


def test_the_manifest_has_a_row_a_frame_and_all_that_was_set(made):
    plan, found, _, out = made
    table = pandas.read_parquet(out / "manifest.parquet")
    assert len(table) == 8
    for k, axis in enumerate(plan.axes):
        np.testing.assert_allclose(table[axis.address], np.repeat(found.rows[:, k], 2))
    np.testing.assert_allclose(table["weight"], np.repeat(found.weights, 2))
    assert list(table["Plug.pose.tx"]) == [0, -4] * 4
    there = table["defects.stain[0].present"] == 1
    assert set(found.weights) == {1.8, 0.2}  # 0.9 / 0.5 and 0.1 / 0.5
    np.testing.assert_allclose(table["weight"], np.where(there, 0.2, 1.8))
    assert (table["pixels.defects.stain[0]"].notna() == there).all()
    for column in ("file.exr", "file.image", "file.depth"):
        assert all((out / f).is_file() for f in table[column])


def test_a_row_of_the_manifest_makes_its_image_again(made):
    plan, _, _, out = made
    table = pandas.read_parquet(out / "manifest.parquet")
    row = table[table["defects.stain[0].present"] == 1].iloc[-1]
    document = open_scene(plan.scene)
    values = {a: row[a] for a in plan.units if a in row and not pandas.isna(row[a])}
    scene, placed = scene_of(document.scene(row["time"]), values, plan.defects)
    with Rasterizer() as rasterizer:
        again = rasterizer.render(
            scene, scene.camera(row["camera"]).resized(int(row["width"])), samples=int(row["samples"])
        )
    np.testing.assert_array_equal(again.pixels, exr.read(out / row["file.exr"]).pixels)
    assert placed


def test_pycocotools_reads_masks_boxes_and_categories(made):
    _, _, jobs, out = made
    coco = COCO(str(out / "coco.json"))
    names = {c["id"]: c["name"] for c in coco.loadCats(coco.getCatIds())}
    assert set(names.values()) == {"/World/Plate", "/World/Plug", "stain", "missing_part"}
    seen = set()
    for job in jobs:
        (info,) = coco.loadImgs([job.frame])
        assert Pillow.open(out / info["file_name"]).size == (info["width"], info["height"])
        image = exr.read(out / f"exr/{job.frame:06d}.exr")
        ids = image.passes["object_id"]
        for a in coco.loadAnns(coco.getAnnIds(imgIds=[job.frame])):
            mask = coco.annToMask(a).astype(bool)
            rle = coco.annToRLE(a)
            assert a["area"] == coco_masks.area(rle) == mask.sum()
            np.testing.assert_array_equal(a["bbox"], coco_masks.toBbox(rle))
            kind = names[a["category_id"]]
            seen.add(kind)
            if kind == "missing_part":
                continue
            fits = [
                k
                for k, n in enumerate(image.object_names)
                if n.split("|")[0] == kind or f"{kind}_0" in n.split("|")
            ]
            np.testing.assert_array_equal(mask, np.isin(ids, fits))
    assert seen == set(names.values())


def test_a_defect_that_moves_is_seen_where_it_is_at_each_time(made):
    """16 mm on the plate, which lies 0.196 m under a lens of 16 mm; its pixels are 30 µm · 160 / 96 wide."""
    plan, _, _, out = made
    table = pandas.read_parquet(out / "manifest.parquet")
    there = table[table["defects.stain[0].present"] == 1]
    for _, pair in there.groupby("sample"):
        assert list(pair["defects.stain[0].y"]) == [-8, 8]
        (x0, y0), (x1, y1) = (np.array(b[:2]) + np.array(b[2:]) / 2 for b in pair["box.defects.stain[0]"])
        assert np.hypot(x1 - x0, y1 - y0) == pytest.approx(16e-3 / 0.196 * 16e-3 / 50e-6, abs=1.5)
    assert plan.moving


def test_run_lengths_are_cocos_own(made):
    rng = np.random.default_rng(0)
    for shape in ((1, 1), (3, 7), (20, 11)):
        for share in (0.0, 0.3, 1.0):
            mask = rng.random(shape) < share
            rle = encode(mask)
            np.testing.assert_array_equal(decode(rle), mask)
            compressed = coco_masks.frPyObjects(rle, *shape)
            np.testing.assert_array_equal(coco_masks.decode(compressed).astype(bool), mask)
    with pytest.raises(ValueError, match="add up"):
        decode({"size": [2, 2], "counts": [3]})


def test_bops_poses_and_models_project_onto_its_masks(made):
    _, _, jobs, out = made
    root = out / "bop"
    scene = root / "test/000000"
    cameras, truth, info = (
        json.loads((scene / f"{n}.json").read_text()) for n in ("scene_camera", "scene_gt", "scene_gt_info")
    )
    assert set(cameras) == set(truth) == set(info) == {str(j.frame) for j in jobs}
    models = {k: trimesh.load(root / f"models/obj_{k:06d}.ply", process=False) for k in (1, 2)}
    told = json.loads((root / "models/models_info.json").read_text())
    assert told["1"]["diameter"] == pytest.approx(np.linalg.norm([40, 30, 4]))  # mm
    assert (told["2"]["size_x"], told["2"]["size_z"]) == pytest.approx((8, 6))
    for image in cameras:
        K, scale = np.reshape(cameras[image]["cam_K"], (3, 3)), cameras[image]["depth_scale"]
        depth = np.asarray(Pillow.open(scene / f"depth/{int(image):06d}.png")) * scale
        rows, columns = np.indices(depth.shape)
        for k, pose in enumerate(truth[image]):
            R, t = np.reshape(pose["cam_R_m2c"], (3, 3)), np.array(pose["cam_t_m2c"])
            assert np.linalg.det(R) == pytest.approx(1)
            corners = models[pose["obj_id"]].vertices @ R.T + t
            px = corners @ K.T
            px = px[:, :2] / px[:, 2:]
            hull = px[_hull(px)]
            level = _outside(hull, columns, rows)
            names = [scene / f"{w}/{int(image):06d}_{k:06d}.png" for w in ("mask", "mask_visib")]
            whole, seen = (np.asarray(Pillow.open(n)) == 255 for n in names)
            sure = np.abs(level) > 1e-3  # px: single precision of the renderer
            np.testing.assert_array_equal(whole[sure], (level < 0)[sure])
            assert (seen <= whole).all()
            about = info[image][k]
            assert (about["px_count_all"], about["px_count_visib"]) == (whole.sum(), seen.sum())
            assert about["visib_fract"] == pytest.approx(seen.sum() / max(whole.sum(), 1))
            x, y, w, h = about["bbox_visib"]
            ys, xs = np.nonzero(seen)
            assert (x, y, x + w - 1, y + h - 1) == (xs.min(), ys.min(), xs.max(), ys.max())
            near, far = corners[:, 2].min(), corners[:, 2].max()
            assert (depth[seen] > near - scale).all()
            assert (depth[seen] < far + scale).all()


def _hull(points):
    from scipy.spatial import ConvexHull

    return ConvexHull(points).vertices


def _outside(polygon, x, y):
    """Largest signed distance from the sides of a convex polygon, px: below 0 inside."""
    a, b = polygon, np.roll(polygon, -1, axis=0)
    if np.sum(a[:, 0] * b[:, 1] - b[:, 0] * a[:, 1]) < 0:
        a, b = b, a
    n = np.stack([(b - a)[:, 1], -(b - a)[:, 0]], axis=1)
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    return np.max((x[..., None] - a[:, 0]) * n[:, 0] + (y[..., None] - a[:, 1]) * n[:, 1], axis=-1)


def test_a_frame_is_done_only_if_its_record_is_of_this_very_job(made):
    from dataclasses import replace

    _, _, jobs, out = made
    job = jobs[2]
    assert is_done(job)
    assert not is_done(replace(job, seed=job.seed + 1))
    assert not is_done(replace(job, values=(*job.values[:-1], ("Plug.pose.tx", 0.5))))
    assert is_done(job.with_threads(7))  # how many threads decides nothing
    record = Path(job.out).read_text()
    Path(job.out).write_text(record[: len(record) // 2])  # a disk that was full
    assert not is_done(job)
    Path(job.out).write_text(record)
    image = out / read_record(job)["files"]["image"]
    content = image.read_bytes()
    image.unlink()
    assert not is_done(job)
    image.write_bytes(content)
    assert is_done(job)


def test_a_folder_keeps_to_one_plan_which_may_grow(made):
    from dataclasses import replace

    from analysis.sweep.job import of_another

    plan, _, jobs, out = made
    more = replace(plan, count=8)
    assert of_another(out, jobs_of(more, design(more).rows, out, jobs[0].digest)) == 0
    assert of_another(out, jobs[:5]) == 3
    assert of_another(out, jobs_of(plan, design(plan).rows, out, "another scene")) == 8


def test_a_frame_that_fails_is_told_and_those_handed_out_with_it_go_on(made, tmp_path):
    from dataclasses import replace

    from offline.batch import _each

    _, _, jobs, _ = made
    two = [replace(j, folder=str(tmp_path), writes=("exr",)) for j in jobs[:2]]
    (tmp_path / f"exr/{two[0].frame:06d}.exr").mkdir(parents=True)  # where its image is to go
    first, second = _each(work, two)
    assert "cannot be written" in first
    assert second > 0
    assert [is_done(j) for j in two] == [False, True]


def test_path_tracing_makes_the_same_truth(made, tmp_path):
    """Ids at the pixels' centres; edges that pass within single precision of one may fall to either side."""
    from dataclasses import replace

    from analysis.sweep.job import BENCH
    from analysis.sweep.plan import Rendering

    _, _, jobs, out = made
    job = next(j for j in jobs if dict(j.values)["defects.stain[0].present"] == 1)
    traced = replace(job, rendering=Rendering("offline", 2, 1), folder=str(tmp_path), writes=("exr",))
    try:
        work(traced)
    finally:
        BENCH.cycles.close()
        BENCH.cycles = None
    record = read_record(traced)
    assert record["renderer"] == "cycles"
    for ours, theirs in zip(read_record(job)["instances"], record["instances"], strict=True):
        assert ours["name"] == theirs["name"]
        differ = decode(ours["rle"]) ^ decode(theirs["rle"])
        assert differ.sum() <= 0.01 * max(ours["pixels"], 100)
    a, b = (exr.read(f / f"exr/{job.frame:06d}.exr").pixels for f in (out, tmp_path))
    assert b.mean() == pytest.approx(a.mean(), rel=0.1)  # the rasteriser lacks reflected light
