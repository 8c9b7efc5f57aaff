"""A COLLADA file, 1.4 or 1.5, as a USD stage."""

from pathlib import Path
from typing import Any

import numpy as np
from pxr import Sdf, Usd, UsdGeom

from interchange.formats.collada.extra import own_extra
from interchange.formats.collada.findings import Findings
from interchange.formats.collada.library import UP, Library
from interchange.formats.collada.light import set_intensities
from interchange.formats.collada.scene_graph import SceneGraph
from interchange.formats.usd_author import free_path, new_stage
from interchange.problems import Problem

MOST_FRAMES = 1_000_000
ABOUT = (
    "author",
    "authoring_tool",
    "comments",
    "copyright",
    "created",
    "keywords",
    "modified",
    "revision",
    "subject",
)
NOT_DRAWN = ("physics", "kinematics", "force_fields", "articulated", "joints", "formulas")


def read(path: Path) -> tuple[Usd.Stage, list[Problem]]:
    """The stage, and what was left out of it. Raises FileError with every error of the file.

    The file's unit is kept, and its up axis where USD knows it (Y, Z; an x-up scene is turned to z up). Several
    visual scenes are consecutive frames: each is visible at its own time code, the one that the file shows also
    by default.
    """
    find = Findings(str(path))
    lib = Library(path, find)
    unit, up = lib.unit_and_up(lib.main)
    find.check()
    stage = new_stage(unit, "Y" if up == "Y_UP" else "Z")
    stage_frame = UP["Y_UP" if up == "Y_UP" else "Z_UP"] @ np.diag([unit, unit, unit, 1.0])
    graph = SceneGraph(stage, lib, stage_frame)
    _note_libraries(lib)
    scenes, shown = _visual_scenes(lib)
    find.check()
    if len(scenes) == 1:
        graph.author(scenes[0], _root(stage, scenes[0], graph))
        _set_default_prim(stage, scenes[0])
    for frame, scene in enumerate(scenes if len(scenes) > 1 else []):
        root = free_path(stage, "/World", scene.get("id") or scene.get("name") or "scene")
        prim = UsdGeom.Xform.Define(stage, root)
        prim.GetPrim().SetCustomDataByKey("collada:visual_scene", True)
        visibility = prim.CreateVisibilityAttr("inherited" if scene is shown else "invisible")
        for time in range(len(scenes)):
            visibility.Set("inherited" if time == frame else "invisible", time)
        graph.author(scene, root)
    find.check()
    graph.materials.unused()
    graph.undo_scales()
    set_intensities(stage, graph.lamps, lib)
    _set_frames(stage, graph, len(scenes), shown)
    graph.animations.report_unused()
    _keep_about(stage, lib.main.find("asset"))
    find.check()
    return stage, find.problems


def _visual_scenes(lib: Library) -> tuple[list[Any], Any]:
    """All visual scenes in their order, and the one that the file shows."""
    scenes = lib.main.findall("library_visual_scenes/visual_scene")
    instance = lib.main.find("scene/instance_visual_scene")
    shown = None
    if instance is not None:
        shown = lib.resolve(instance.get("url"), instance, "visual_scene")
        if shown is not None and shown not in scenes:
            scenes = [*scenes, shown]
    if not scenes:
        lib.find.loss("The file has no visual scene; there is nothing to see.")
    elif shown is None and lib.main.find("scene/instance_visual_scene") is None:
        shown = scenes[0]
        lib.find.note("The file names no visual scene to show; its first one is taken.")
    if len(scenes) > 1 and shown is not None:
        where = scenes.index(shown)
        lib.find.note(
            f"The {len(scenes)} visual scenes are the frames 0 to {len(scenes) - 1}; the file shows {where}."
        )
    return scenes, shown


def _root(stage: Usd.Stage, scene: Any, graph: SceneGraph) -> str:
    """The prim that holds a scene's nodes: /World, or what this program wrote ("" for the top)."""
    given = _written_default(scene)
    if given is None:
        return "/World"
    name, holds = given.get("name", ""), given.get("holds")
    if name and not Sdf.Path.IsValidIdentifier(name):
        graph.lib.find.error(f'"{name}" is no name of a prim.', given)
        return "/World"
    stage.RemovePrim("/World")
    root = f"/{name}" if holds == "all" and name else ""
    if root:
        stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, root).GetPrim())
    graph.materials.scope = f"{root}/Materials"
    return root


def _set_default_prim(stage: Usd.Stage, scene: Any) -> None:
    given = _written_default(scene)
    if (
        given is not None
        and (prim := stage.GetPrimAtPath(f"/{given.get('name', '')}"))
        and not prim.IsPseudoRoot()
    ):
        stage.SetDefaultPrim(prim)


def _written_default(scene: Any) -> Any:
    extra = own_extra(scene)
    return None if extra is None else extra.find("default_prim")


def _note_libraries(lib: Library) -> None:
    for child in lib.main:
        if any(word in child.tag for word in NOT_DRAWN) and len(child):
            lib.find.note(f"<{child.tag}> is left out; it is not drawn.", child)
    for child in lib.main.iterfind("scene/*"):
        if child.tag not in ("instance_visual_scene", "extra"):
            lib.find.loss(f"<{child.tag}> is left out; it is not drawn.", child)


def _set_frames(stage: Usd.Stage, graph: SceneGraph, scenes: int, shown: Any) -> None:
    find, moving = graph.lib.find, graph.animations.range
    if scenes > 1:
        stage.SetStartTimeCode(0)
        stage.SetEndTimeCode(scenes - 1)
        stage.SetTimeCodesPerSecond(1)
        if moving is not None:
            find.loss("Frames of animations and frames of several visual scenes share their time codes.")
        return
    extra = None if shown is None else own_extra(shown)
    if extra is not None and extra.find("start_time_code") is not None:
        try:
            moving = float(extra.findtext("start_time_code")), float(extra.findtext("end_time_code", "nan"))
        except ValueError:
            find.error("start_time_code and end_time_code must be numbers.", extra)
            return
    if moving is None:
        return
    stage.SetTimeCodesPerSecond(graph.animations.fps)
    if (
        extra is not None
        and extra.find("frames_per_second") is not None
        and extra.find("start_time_code") is None
    ):
        return  # written here, from a stage that did not say where it starts and ends
    first, last = np.floor(moving[0] + 1e-3), np.ceil(moving[1] - 1e-3)
    if not last - first < MOST_FRAMES:
        find.error(
            f"An animation may be {MOST_FRAMES} frames long; this one lasts from {first:g} to {last:g}."
        )
        return
    stage.SetStartTimeCode(first)
    stage.SetEndTimeCode(max(first, last))


def _keep_about(stage: Usd.Stage, asset: Any) -> None:
    """Who made the file and when, in the stage's customLayerData."""
    if asset is None:
        return
    about = {
        e.tag: " ".join((e.text or "").split()) for e in asset.iter(*ABOUT, "title") if (e.text or "").strip()
    }
    layer = stage.GetRootLayer()
    layer.customLayerData = {**layer.customLayerData, "collada": about}
