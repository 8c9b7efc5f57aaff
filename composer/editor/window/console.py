"""Every step as text, as a script takes it; and a line to type one."""

from imgui_bundle import icons_fontawesome_6 as icons
from imgui_bundle import imgui

from composer.editor.command_text import parse
from composer.editor.window.places import mark
from composer.editor.window.state import State


class Console:
    def __init__(self, state: State) -> None:
        self.state = state
        self.text = ""
        self.count = 0

    def gui(self) -> None:
        log = self.state.workspace.log
        imgui.begin_child("##log", imgui.ImVec2(0, -34))
        for line in log[-500:]:
            if line.startswith("#"):
                imgui.text_disabled(line)
            else:
                imgui.text_unformatted(line)
        if len(log) != self.count:
            imgui.set_scroll_here_y(1.0)
            self.count = len(log)
        imgui.end_child()
        if imgui.button(f"{icons.ICON_FA_COPY}##copy"):
            imgui.set_clipboard_text("\n".join(log) + "\n")
            self.state.tell("Copied: brightfield edit FILE --script takes it.")
        if imgui.is_item_hovered():
            imgui.set_tooltip("Copy as a script")
        imgui.same_line()
        imgui.set_next_item_width(-1)
        flags = imgui.InputTextFlags_.enter_returns_true
        entered, self.text = imgui.input_text_with_hint(
            "##command", "add_lamp kind=rect position=[0,0,0.3]", self.text, flags
        )
        mark("console")
        if entered and self.text.strip():
            command = self.state.attempt(parse, self.text)
            if command is not None and self.state.do(command):
                self.text = ""
