"""Colours, fonts and spacing: dark, neutral greys (so that colours of a picture are judged rightly), one accent."""

from pathlib import Path

import imgui_bundle
from imgui_bundle import hello_imgui, imgui

ACCENT = (0.29, 0.56, 0.89, 1.0)
SELECTED = (1.00, 0.62, 0.17, 1.0)
LAMP, CAMERA, AXES = (1.0, 0.86, 0.45, 0.9), (0.47, 0.78, 1.0, 0.9), (0.62, 0.64, 0.68, 1.0)
GRID, GRID_X, GRID_Y = (0.42, 0.44, 0.48, 0.28), (0.83, 0.33, 0.33, 0.6), (0.45, 0.72, 0.33, 0.6)
MUTED = (0.60, 0.62, 0.66, 1.0)
WARN = (0.95, 0.70, 0.30, 1.0)
BAD = (0.95, 0.42, 0.40, 1.0)
BACKGROUND = (0.115, 0.120, 0.130)  # of the viewport, as shown
SIZE = 15.0  # px, of the text


def color32(rgba: tuple[float, float, float, float]) -> int:
    return int(imgui.get_color_u32(imgui.ImVec4(*rgba)))


def load_fonts() -> None:
    """Roboto; DejaVu, which comes with matplotlib, for the symbols that it lacks; icons."""
    import matplotlib

    fonts = Path(imgui_bundle.__file__).parent / "assets" / "fonts"

    def params(merge: bool) -> hello_imgui.FontLoadingParams:
        found = hello_imgui.FontLoadingParams()
        found.inside_assets = False
        found.merge_to_last_font = merge
        return found

    hello_imgui.load_font(str(fonts / "Roboto" / "Roboto-Regular.ttf"), SIZE, params(False))
    hello_imgui.load_font(str(fonts / "Font_Awesome_6_Free-Solid-900.otf"), SIZE - 2, params(True))
    dejavu = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"
    hello_imgui.load_font(str(dejavu), SIZE - 1, params(True))


def apply() -> None:
    style = imgui.get_style()
    imgui.style_colors_dark()
    style.window_rounding = style.child_rounding = 0.0
    style.frame_rounding = style.grab_rounding = style.popup_rounding = 3.0
    style.tab_rounding = 3.0
    style.scrollbar_size = 12.0
    style.window_padding = imgui.ImVec2(8, 8)
    style.frame_padding = imgui.ImVec2(7, 4)
    style.item_spacing = imgui.ImVec2(7, 5)
    style.item_inner_spacing = imgui.ImVec2(5, 4)
    style.cell_padding = imgui.ImVec2(4, 2)
    style.indent_spacing = 15.0
    style.window_border_size = style.popup_border_size = 1.0
    style.frame_border_size = style.tab_border_size = 0.0
    Col = imgui.Col_

    def put(names: str, rgba: tuple[float, float, float, float]) -> None:
        for name in names.split():
            style.set_color_(getattr(Col, name).value, imgui.ImVec4(*rgba))

    r, g, b, _ = ACCENT
    put("window_bg", (0.150, 0.155, 0.165, 1))
    put("child_bg", (0.150, 0.155, 0.165, 0))
    put("popup_bg", (0.125, 0.130, 0.140, 0.98))
    put("menu_bar_bg", (0.120, 0.125, 0.135, 1))
    put("border", (0.070, 0.075, 0.080, 1))
    put("frame_bg", (0.105, 0.110, 0.118, 1))
    put("frame_bg_hovered", (0.190, 0.200, 0.215, 1))
    put("frame_bg_active", (0.215, 0.230, 0.250, 1))
    put("title_bg title_bg_collapsed", (0.105, 0.110, 0.118, 1))
    put("title_bg_active", (0.120, 0.125, 0.135, 1))
    put("button", (0.225, 0.235, 0.250, 1))
    put("button_hovered", (0.290, 0.305, 0.325, 1))
    put("button_active", (r * 0.8, g * 0.8, b * 0.8, 1))
    put("header", (r, g, b, 0.30))
    put("header_hovered", (r, g, b, 0.22))
    put("header_active", (r, g, b, 0.45))
    put("tab tab_dimmed", (0.120, 0.125, 0.135, 1))
    put("tab_hovered", (0.250, 0.265, 0.285, 1))
    put("tab_selected tab_dimmed_selected", (0.190, 0.198, 0.212, 1))
    put("tab_selected_overline", (r, g, b, 1))
    put("tab_dimmed_selected_overline", (0.3, 0.3, 0.3, 0))
    put("check_mark slider_grab_active", (r, g, b, 1))
    put("slider_grab", (r * 0.85, g * 0.85, b * 0.85, 1))
    put("text", (0.880, 0.885, 0.895, 1))
    put("text_disabled", (0.520, 0.535, 0.560, 1))
    put("separator", (0.090, 0.095, 0.100, 1))
    put("resize_grip", (0, 0, 0, 0))
    put("plot_histogram", (r, g, b, 0.9))
    put("docking_preview", (r, g, b, 0.5))
    put("table_row_bg_alt", (1, 1, 1, 0.02))
    put("modal_window_dim_bg", (0, 0, 0, 0.45))
