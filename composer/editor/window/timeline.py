"""The time line: frames of the scene, played, stepped and dragged through."""

import time

import numpy as np
from imgui_bundle import icons_fontawesome_6 as icons
from imgui_bundle import imgui

from composer.editor.window.places import mark
from composer.editor.window.state import State


class Timeline:
    def __init__(self, state: State) -> None:
        self.state = state
        self.playing = False
        self.rate = 10.0  # frames/s
        self.last = 0.0

    def gui(self) -> None:
        workspace = self.state.workspace
        times = workspace.times
        if len(times) < 2:
            imgui.text_disabled("The scene has one frame. Time samples of a USD file make more.")
            return
        index = int(np.argmin(np.abs(np.asarray(times) - workspace.time)))
        if imgui.button(icons.ICON_FA_BACKWARD_STEP):
            self.go(max(index - 1, 0))
        imgui.same_line(0, 2)
        if imgui.button(icons.ICON_FA_PAUSE if self.playing else icons.ICON_FA_PLAY):
            self.playing = not self.playing
        mark("play")
        imgui.same_line(0, 2)
        if imgui.button(icons.ICON_FA_FORWARD_STEP):
            self.go(min(index + 1, len(times) - 1))
        imgui.same_line()
        imgui.set_next_item_width(-170)
        changed, new = imgui.slider_int("##frame", index, 0, len(times) - 1, f"frame %d of {len(times)}")
        mark("frame")
        if changed and new != index:
            self.go(new)
        imgui.same_line()
        imgui.set_next_item_width(80)
        changed, rate = imgui.drag_float("frames/s", self.rate, 0.2, 0.1, 240, "%.1f")
        self.rate = rate if changed else self.rate
        if self.playing and time.monotonic() - self.last >= 1 / self.rate:
            self.go((index + 1) % len(times))

    def go(self, index: int) -> None:
        self.last = time.monotonic()
        self.state.attempt(self.state.workspace.go_to, self.state.workspace.times[index])
