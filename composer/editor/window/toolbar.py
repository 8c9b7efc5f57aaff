"""Buttons over the overview: what the gizmo does, snapping, and how surfaces look."""

from typing import TYPE_CHECKING

from imgui_bundle import icons_fontawesome_6 as icons
from imgui_bundle import imgui

from composer.editor.window import theme
from composer.editor.window.places import mark
from composer.editor.window.state import State

if TYPE_CHECKING:
    from composer.editor.window.viewport import Viewport

TOOLS = (
    ("move", icons.ICON_FA_UP_DOWN_LEFT_RIGHT, "Move  (G)"),
    ("rotate", icons.ICON_FA_ROTATE, "Rotate  (R)"),
    ("scale", icons.ICON_FA_UP_RIGHT_AND_DOWN_LEFT_FROM_CENTER, "Scale  (S)"),
)


def toggle(label: str, on: bool, tip: str, name: str = "") -> bool:
    """A button that stays down; whether it was pressed."""
    if on:
        imgui.push_style_color(imgui.Col_.button.value, imgui.ImVec4(*theme.ACCENT[:3], 0.85))
        imgui.push_style_color(imgui.Col_.button_hovered.value, imgui.ImVec4(*theme.ACCENT[:3], 1.0))
    pressed = imgui.button(label)
    if on:
        imgui.pop_style_color(2)
    if name:
        mark(name)
    if imgui.is_item_hovered():
        imgui.set_tooltip(tip)
    return pressed


def toolbar(state: State, view: "Viewport") -> None:
    for name, icon, tip in TOOLS:
        if toggle(f"{icon}##{name}", state.operation == name, tip, f"tool {name}"):
            state.operation = name
        imgui.same_line(0, 2)
    imgui.same_line(0, 12)
    if toggle("Local" if state.local else "World", False, "The gizmo's axes: the world's or the thing's own"):
        state.local = not state.local
    imgui.same_line(0, 2)
    step = {"move": f"{state.snap_mm:g} mm", "rotate": f"{state.snap_degrees:g}°", "scale": "0.1"}
    tip = "Snap to steps (Ctrl while dragging turns it round); click with the right button to set them"
    if toggle(f"{icons.ICON_FA_MAGNET}  {step[state.operation]}", state.snapping, tip, "snap"):
        state.snapping = not state.snapping
    if imgui.begin_popup_context_item("##steps"):
        imgui.set_next_item_width(110)
        changed, value = imgui.input_float("mm", state.snap_mm, 0, 0, "%g")
        state.snap_mm = max(value, 1e-4) if changed else state.snap_mm
        imgui.set_next_item_width(110)
        changed, value = imgui.input_float("degrees", state.snap_degrees, 0, 0, "%g")
        state.snap_degrees = max(value, 1e-4) if changed else state.snap_degrees
        imgui.end_popup()
    imgui.same_line(0, 12)
    if toggle("Solid", state.shading == "solid", "Matte surfaces under a headlight  (Z)", "solid"):
        state.shading = "solid"
    imgui.same_line(0, 2)
    if toggle("Lamps", state.shading == "lamps", "The scene's own lamps and materials  (Z)", "lamps"):
        state.shading = "lamps"
    imgui.same_line(0, 12)
    if toggle(icons.ICON_FA_EXPAND, False, "Fit selection, or all  (F)", "fit"):
        state.fit()
