"""The panel of what is selected, generated from declared parameters."""

from itertools import groupby
from typing import Any

import numpy as np
from imgui_bundle import imgui

from composer.editor.commands import AssignMaterial, Place, SetBrdf, SetParameter
from composer.editor.fields import Field, Widget, fields_of, shown_value, with_lobe
from composer.editor.poses import split
from composer.editor.window.places import mark
from composer.editor.window.state import State
from composer.editor.window.tree import ICONS
from interchange.brdf import BY_NAME

OPEN = ("Transform", "Emission", "Shape", "Exposure", "Lens")


class Properties:
    def __init__(self, state: State) -> None:
        self.state = state

    def gui(self) -> None:
        workspace = self.state.workspace
        if not workspace.selection:
            imgui.text_disabled("Nothing is selected.")
            imgui.text_disabled("Click a thing in the scene or in the tree.")
            return
        path = workspace.selection[-1]
        kind = workspace.kind(path)
        if kind is None:
            return
        icon, color = ICONS[kind]
        imgui.text_colored(imgui.ImVec4(*color), icon)
        imgui.same_line()
        imgui.text(path.rsplit("/", 1)[-1])
        imgui.same_line()
        more = len(workspace.selection) - 1
        imgui.text_disabled(f"{kind}" + (f", and {more} more" if more else ""))
        if imgui.is_item_hovered():
            imgui.set_tooltip(path)
        imgui.begin_child("##properties")
        imgui.push_id(path)
        if kind in ("mesh", "group", "light", "camera") and _header("Transform", True):
            self._transform(path)
        if kind == "mesh" or kind == "group":
            self._surface(path)
        else:
            self._fields(path, self._thing(path, kind))
        imgui.pop_id()
        imgui.end_child()

    def _thing(self, path: str, kind: str) -> Any:
        scene = self.state.workspace.scene
        if kind == "light":
            return next((x for x in scene.lights if x.name == path), None)
        if kind == "camera":
            return next((c for c in scene.cameras if c.name == path), None)
        return self.state.workspace.material(path)

    # transform

    def _transform(self, path: str) -> None:
        state = self.state
        pose = state.workspace.pose(path)
        if state.dragged is not None and path in state.dragged.paths:
            pose = state.dragged.by @ pose
        position, degrees, scale = (np.round(v, 9) + 0.0 for v in split(pose))  # no -0.000
        if _begin_rows("transform"):
            new = self._row3("Position", "mm", position * 1e3, 0.2, "%.3f", path, "position")
            if new is not None:
                self._edit(path, "position", Place(path, position=_triple(new / 1e3)))
            new = self._row3("Rotation", "°", degrees, 0.25, "%.3f", path, "rotation")
            if new is not None:
                self._edit(path, "rotation", Place(path, rotation=_triple(new)))
            if state.workspace.kind(path) != "camera":
                new = self._row3("Scale", "", scale, 0.005, "%.4f", path, "scale")
                if new is not None and (np.abs(new) > 1e-6).all():
                    self._edit(path, "scale", Place(path, scale=_triple(new)))
            imgui.end_table()

    def _row3(
        self, label: str, unit: str, value: np.ndarray, speed: float, text: str, path: str, name: str
    ) -> np.ndarray | None:
        _label(label, unit, "Drag, or double-click to type" if name == "position" else "")
        imgui.set_next_item_width(-1)
        changed, new = imgui.drag_float3(f"##{name}", [float(v) for v in value], speed, 0, 0, text)
        mark(f"property {name}")
        self._release(path, name)
        return np.asarray(new, np.float64) if changed else None

    def _edit(self, path: str, name: str, command: Any) -> None:
        state = self.state
        if state.do(command, continuing=state.held == (path, name)):
            state.held = (path, name)

    def _release(self, path: str, name: str) -> None:
        if self.state.held == (path, name) and not imgui.is_item_active():
            self.state.held = None

    # what a body shows

    def _surface(self, path: str) -> None:
        state, workspace = self.state, self.state.workspace
        bodies = [
            b for b in workspace.scene.bodies if b.name == path or b.name.startswith((path + "/", path + "["))
        ]
        if _header("Geometry", True) and _begin_rows("geometry"):
            bounds = workspace.bounds([path])
            if bounds is not None:
                size = (bounds[1] - bounds[0]) * 1e3
                _text_row("Size", "{:.4g} × {:.4g} × {:.4g} mm".format(*size))
            _text_row("Triangles", f"{sum(len(b.mesh.faces) for b in bodies):,}".replace(",", " "))
            if len(bodies) != 1:
                _text_row("Surfaces", str(len(bodies)))
            imgui.end_table()
        if not _header("Material", True):
            return
        shown = list(dict.fromkeys(b.material.name for b in bodies))
        now = shown[0] if len(shown) == 1 else ("several" if shown else "none")
        materials = [n.path for top in workspace.outline for n in top.below() if n.kind == "material"]
        imgui.set_next_item_width(-1)
        if imgui.begin_combo("##material", now.rsplit("/", 1)[-1]):
            for material in materials:
                if imgui.selectable(material.rsplit("/", 1)[-1], material == now)[0]:
                    paths = tuple(p for p in workspace.selection if workspace.kind(p) in ("mesh", "group"))
                    state.do(AssignMaterial(paths, material))
                if imgui.is_item_hovered():
                    imgui.set_tooltip(material)
            imgui.end_combo()
        if len(shown) == 1 and workspace.kind(shown[0]) == "material":
            imgui.push_id(shown[0])
            self._fields(shown[0], workspace.material(shown[0]))
            imgui.pop_id()
        elif not shown:
            imgui.text_disabled("No surface is shown.")
        else:
            imgui.text_disabled("Drop a material here, or choose one in Materials.")

    # parameters

    def _fields(self, path: str, thing: Any) -> None:
        if thing is None:
            imgui.text_disabled("It is not shown in the scene.")
            return
        if hasattr(thing, "brdf"):
            self._model(path, thing)
        for group, members in groupby(fields_of(thing), key=lambda f: f.group):
            rows = list(members)
            opened = group in OPEN or (hasattr(thing, "brdf") and group != "Beside the BRDF")
            if not _header(group, opened) or not _begin_rows(group):
                continue
            for f in rows:
                self._field(path, f)
            imgui.end_table()

    def _model(self, path: str, material: Any) -> None:
        now = "GLSL fragment" if material.glsl else type(material.brdf).__name__
        imgui.set_next_item_width(-1)
        if imgui.begin_combo("##model", now):
            for name in sorted(BY_NAME):
                if imgui.selectable(name, name == now)[0] and name != now:
                    self.state.do(SetBrdf(path, name))
                if imgui.is_item_hovered():
                    about = (BY_NAME[name].__module__, BY_NAME[name].source)
                    imgui.set_tooltip("\n".join(about))
            imgui.end_combo()
        mark("property model")
        if material.maps:
            imgui.text_disabled(f"Textured: {', '.join(material.maps)}")

    def _field(self, path: str, f: Field) -> None:
        _label(f.label, f.unit, f.tooltip)
        imgui.set_next_item_width(-1)
        key = f"{f.name}#{f.lobe}"
        new = self._widget(f, f"##{key}")
        mark(f"property {f.name}" + (f" {f.lobe}" if f.lobe >= 0 else ""))
        if new is not None:
            self._edit(path, key, SetParameter(path, f.name, with_lobe(f, new)))
        self._release(path, key)

    def _widget(self, f: Field, label: str) -> Any:
        """The new value in the program's unit; None where it is as it was."""
        shown = shown_value(f)
        low, high = f.low * f.scale, f.high * f.scale
        match f.widget:
            case Widget.NUMBER:
                text = _format(float(shown))
                if np.isfinite([low, high]).all() and high - low <= 400 and not f.logarithmic:
                    changed, new = imgui.slider_float(label, float(shown), low, high, text)
                else:
                    speed = max(abs(float(shown)) * 0.01, 1e-3 * min(1.0, f.scale))
                    limits = (max(low, -3e38), min(high, 3e38))
                    changed, new = imgui.drag_float(label, float(shown), speed, *limits, text)
                return float(np.clip(new / f.scale, f.low, f.high)) if changed else None
            case Widget.INTEGER:
                changed, number = imgui.drag_int(label, int(shown), 0.1, int(f.low), int(f.high))
                return int(number) if changed else None
            case Widget.COLOR if np.max(np.abs(shown)) <= 1.0 and f.low >= 0:
                flags = imgui.ColorEditFlags_.float | imgui.ColorEditFlags_.no_alpha
                changed, color = imgui.color_edit3(label, [float(x) for x in shown], flags)
                return tuple(float(np.clip(x, f.low, f.high)) for x in list(color)[:3]) if changed else None
            case Widget.COLOR | Widget.VECTOR:
                values = [float(x) for x in np.ravel(shown)]
                speed = max(max(map(abs, values)) * 0.01, 1e-3)
                drag: Any = imgui.drag_float3 if len(values) == 3 else imgui.drag_float2
                changed, numbers3 = drag(label, values, speed, 0, 0, _format(max(values, key=abs)))
                if not changed:
                    return None
                numbers = tuple(float(np.clip(x / f.scale, f.low, f.high)) for x in numbers3)
                return tuple(round(x) for x in numbers) if f.name.endswith("resolution") else numbers
            case Widget.CHOICE:
                words = [c or "none" for c in f.choices]
                changed, index = imgui.combo(label, f.choices.index(f.value), words)
                return f.choices[index] if changed else None
            case Widget.SWITCH:
                changed, on = imgui.checkbox(label, bool(f.value))
                return on if changed else None
            case Widget.TEXT:
                imgui.text_disabled(str(f.value))
        return None


def _header(label: str, opened: bool) -> bool:
    imgui.push_style_color(imgui.Col_.header.value, imgui.ImVec4(0.19, 0.198, 0.212, 1))
    flags = imgui.TreeNodeFlags_.default_open if opened else 0
    found = imgui.collapsing_header(label, flags)
    imgui.pop_style_color()
    return bool(found)


def _begin_rows(name: str) -> bool:
    flags = imgui.TableFlags_.sizing_fixed_fit | imgui.TableFlags_.no_saved_settings
    if not imgui.begin_table(f"##{name}", 2, flags):
        return False
    imgui.table_setup_column("name", imgui.TableColumnFlags_.width_fixed, 122)
    imgui.table_setup_column("value", imgui.TableColumnFlags_.width_stretch)
    return True


def _label(label: str, unit: str, tip: str) -> None:
    imgui.table_next_row()
    imgui.table_next_column()
    imgui.align_text_to_frame_padding()
    imgui.text(label)
    if tip and imgui.is_item_hovered():
        imgui.set_tooltip(tip)
    if unit:
        imgui.same_line(0, 5)
        short = unit if len(unit) < 9 else "…"
        imgui.text_disabled(short)
        if imgui.is_item_hovered():
            imgui.set_tooltip(f"{tip}\n{unit}".strip())
    imgui.table_next_column()


def _text_row(label: str, text: str) -> None:
    _label(label, "", "")
    imgui.align_text_to_frame_padding()
    imgui.text(text)


def _format(value: float) -> str:
    if value == 0:
        return "%.3f"
    return "%.4g" if 1e-3 <= abs(value) < 1e5 else "%.3e"


def _triple(v: np.ndarray) -> tuple[float, float, float]:
    x, y, z = (round(float(c), 9) for c in v)
    return x, y, z
