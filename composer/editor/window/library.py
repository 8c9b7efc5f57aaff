"""The material library: every entry as a ball, drawn by the renderer itself, one a frame."""

from typing import Any

import moderngl
import numpy as np
from imgui_bundle import icons_fontawesome_6 as icons
from imgui_bundle import imgui

from analysis.sphere import sphere_camera, sphere_scene
from composer.editor.presets import Preset, presets
from composer.editor.window import theme
from composer.editor.window.actions import use_preset
from composer.editor.window.display import Display, Look
from composer.editor.window.places import mark
from composer.editor.window.state import State
from interchange.problems import BrightfieldError

BALL = 72  # px


class Library:
    def __init__(self, state: State) -> None:
        self.state = state
        self.display: Display | None = None
        self.pictures: dict[str, moderngl.Texture | None] = {}  # None: cannot be drawn
        self.words = ""
        self.waiting: Preset | None = None

    def gui(self) -> None:
        imgui.set_next_item_width(-1)
        _, self.words = imgui.input_text_with_hint(
            "##find", f"{icons.ICON_FA_MAGNIFYING_GLASS}  Find a material or a model", self.words
        )
        mark("library find")
        self.waiting = None
        imgui.begin_child("##library")
        group = ""
        column = 0
        across = max(1, int((imgui.get_content_region_avail().x + 6) // (BALL + 14)))
        for preset in presets():
            if self.words and self.words.lower() not in preset.name.lower():
                continue
            if preset.group != group:
                group, column = preset.group, 0
                imgui.text_colored(imgui.ImVec4(*theme.MUTED), group)
            if column % across:
                imgui.same_line(0, 6)
            column += 1
            self._entry(preset)
        imgui.end_child()
        if self.waiting is not None and self.state.quiet and self.state.held is None:
            self._draw(self.waiting)

    def _entry(self, preset: Preset) -> None:
        key = f"{preset.group} {preset.name}"
        imgui.begin_group()
        corner = imgui.get_cursor_screen_pos()
        pressed = imgui.invisible_button(f"##{key}", imgui.ImVec2(BALL + 8, BALL + 24))
        mark(f"library {preset.name}")
        hovered, visible = imgui.is_item_hovered(), imgui.is_item_visible()
        draw = imgui.get_window_draw_list()
        if imgui.begin_drag_drop_source():
            self.state.carried = preset
            imgui.set_drag_drop_payload_py_id("material", 1)
            imgui.text(f"{icons.ICON_FA_PALETTE}  {preset.name}")
            imgui.end_drag_drop_source()
        if hovered:
            draw.add_rect_filled(
                corner, (corner.x + BALL + 8, corner.y + BALL + 24), theme.color32((1, 1, 1, 0.06)), 4
            )
            imgui.set_tooltip(
                f"{preset.name}\n{preset.source}\nClick: onto what is selected · drag: onto a body"
            )
        picture = self.pictures.get(key)
        at = (corner.x + 4, corner.y + 3)
        if picture is not None:
            draw.add_image(imgui.ImTextureRef(picture.glo), at, (at[0] + BALL, at[1] + BALL))
        else:
            middle = (at[0] + BALL / 2, at[1] + BALL / 2)
            draw.add_circle_filled(middle, BALL * 0.45, theme.color32((0.2, 0.21, 0.22, 1)))
            if visible and key not in self.pictures and self.waiting is None:
                self.waiting = preset
        name = preset.name if len(preset.name) < 13 else preset.name[:11] + "…"
        width = imgui.calc_text_size(name).x
        place = (corner.x + (BALL + 8 - width) / 2, corner.y + BALL + 5)
        draw.add_text(place, theme.color32((0.78, 0.79, 0.82, 1)), name)
        imgui.end_group()
        if pressed:
            use_preset(self.state, preset)

    def _draw(self, preset: Preset) -> None:
        renderer, context = self.state.renderer, self.state.context
        if renderer is None or context is None:
            return
        key = f"{preset.group} {preset.name}"
        before = context.detect_framebuffer()
        try:
            pixels = self._ball(renderer, preset)
        except BrightfieldError:  # such a model is no worse in a scene for it: the ball stays a plain disc
            self.pictures[key] = None
            return
        finally:
            before.use()
        if self.display is None:
            self.display = Display(context)
        self.display.upload(pixels)
        self.display.draw(Look.SHADED, 1.0, (0.150, 0.155, 0.165))
        assert self.display.framebuffer is not None
        picture = context.texture((BALL, BALL), 4, self.display.framebuffer.read(components=4))
        picture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        self.pictures[key] = picture

    @staticmethod
    def _ball(renderer: Any, preset: Preset) -> np.ndarray:
        image = renderer.render(sphere_scene(preset.brdf), sphere_camera(BALL), samples=4)
        return np.asarray(image.pixels)
