"""Dialogs: choose a file, save as, unsaved changes, recovery. Drawn in the window, so that no desktop is needed."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from imgui_bundle import icons_fontawesome_6 as icons
from imgui_bundle import imgui

from composer.editor.autosave import Saved, drop
from composer.editor.commands import Import
from composer.editor.window import theme
from composer.editor.window.places import mark
from composer.editor.window.state import State


@dataclass
class FileDialog:
    """``extensions``: lower case, with the dot; none for any file. ``then`` gets the path."""

    title: str
    extensions: tuple[str, ...]
    then: Callable[[Path], None]
    saving: bool = False
    folder: Path = field(default_factory=Path.cwd)
    name: str = ""
    opened: bool = False
    focus: bool = True

    def gui(self) -> bool:
        """Whether it goes on."""
        if not self.opened:
            imgui.open_popup(self.title)
            self.opened = True
        imgui.set_next_window_size(imgui.ImVec2(640, 440), imgui.Cond_.appearing)
        centre = imgui.get_main_viewport().get_center()
        imgui.set_next_window_pos(centre, imgui.Cond_.appearing, imgui.ImVec2(0.5, 0.5))
        going, shown = imgui.begin_popup_modal(self.title, True)
        if not going:
            return False
        if imgui.button(icons.ICON_FA_ARROW_UP):
            self.folder = self.folder.parent
        imgui.same_line()
        if imgui.button(icons.ICON_FA_HOUSE):
            self.folder = Path.home()
        imgui.same_line()
        imgui.align_text_to_frame_padding()
        imgui.text_disabled(str(self.folder))
        chosen = self._list()
        if self.focus:
            imgui.set_keyboard_focus_here()
            self.focus = False
        imgui.set_next_item_width(-190)
        entered, self.name = imgui.input_text("##name", self.name, imgui.InputTextFlags_.enter_returns_true)
        mark("dialog name")
        imgui.same_line()
        pressed = imgui.button("Save" if self.saving else "Open", imgui.ImVec2(88, 0))
        mark("dialog accept")
        imgui.same_line()
        done = imgui.button("Cancel", imgui.ImVec2(88, 0)) or imgui.is_key_pressed(imgui.Key.escape)
        if (entered or pressed or chosen) and self.name:
            done = self._accept() or done
        if done:
            imgui.close_current_popup()
        imgui.end_popup()
        return not done and shown is not False

    def _list(self) -> bool:
        """Whether a file was chosen by a double click."""
        chosen = False
        imgui.begin_child("##files", imgui.ImVec2(0, -38), imgui.ChildFlags_.borders)
        try:
            entries = sorted(self.folder.iterdir(), key=lambda p: (p.is_file(), p.name.lower()))
        except OSError as error:
            imgui.text_colored(imgui.ImVec4(*theme.BAD), f"{error.strerror}")
            entries = []
        for path in entries:
            folder = path.is_dir()
            if path.name.startswith(".") or (
                not folder and self.extensions and path.suffix.lower() not in self.extensions
            ):
                continue
            icon = icons.ICON_FA_FOLDER if folder else icons.ICON_FA_FILE
            flags = imgui.SelectableFlags_.allow_double_click | imgui.SelectableFlags_.no_auto_close_popups
            if imgui.selectable(f"{icon}   {path.name}", path.name == self.name, flags)[0]:
                if folder and imgui.is_mouse_double_clicked(0):
                    self.folder, self.name = path, ""
                elif not folder:
                    self.name = path.name
                    chosen = imgui.is_mouse_double_clicked(0)
        imgui.end_child()
        return chosen

    def _accept(self) -> bool:
        path = (self.folder / Path(self.name).expanduser()).resolve()
        if path.is_dir():
            self.folder, self.name = path, ""
            return False
        self.then(path)
        return True


def scene_extensions() -> tuple[str, ...]:
    from interchange.formats.document import formats

    found = {e for f in formats() if f.holds == "scene" for e in f.extensions}
    return tuple(sorted(found))


def _here(state: State) -> Path:
    return state.workspace.path.resolve().parent if state.workspace.path else Path.cwd()


def open_file(state: State) -> None:
    def then(path: Path) -> None:
        state.attempt(state.workspace.open, path)
        state.fit()

    state.dialog = FileDialog("Open a scene", scene_extensions(), then, folder=_here(state))


def import_file(state: State) -> None:
    state.dialog = FileDialog(
        "Import a part or a scene", scene_extensions(), lambda p: bring_in(state, p), folder=_here(state)
    )


def bring_in(state: State, path: Path) -> None:
    """Import; the first thing in an empty scene comes into view."""
    empty = state.workspace.bounds() is None
    if state.do(Import(str(path))) and empty:
        state.fit()


def save_as(state: State) -> None:
    def then(path: Path) -> None:
        lost = state.attempt(state.workspace.save, path)
        if lost is not None:
            told = f"; not carried: {'; '.join(lost)}" if lost else ""
            state.tell(f"Saved {state.workspace.path or path}{told}")

    state.dialog = FileDialog(
        "Save the scene as",
        (".usda", ".usdc", ".usd", ".usdz", ".dae"),
        then,
        True,
        _here(state),
        state.workspace.name,
    )


@dataclass
class Question:
    """Changes that are not saved, before they would be lost."""

    state: State
    then: Callable[[], None]
    opened: bool = False

    def gui(self) -> bool:
        title = "Unsaved changes"
        if not self.opened:
            imgui.open_popup(title)
            self.opened = True
        centre = imgui.get_main_viewport().get_center()
        imgui.set_next_window_pos(centre, imgui.Cond_.appearing, imgui.ImVec2(0.5, 0.5))
        going, _ = imgui.begin_popup_modal(title, None, imgui.WindowFlags_.always_auto_resize)
        if not going:
            return False
        imgui.text(f"{self.state.workspace.name} has changes that are not saved.")
        imgui.spacing()
        from composer.editor.window.actions import save

        done = False
        if imgui.button("Save", imgui.ImVec2(110, 0)):
            had_file = self.state.workspace.path is not None
            done = True
            self.state.dialog = None
            save(self.state)
            if had_file and not self.state.workspace.unsaved:
                self.then()
        imgui.same_line()
        if imgui.button("Discard", imgui.ImVec2(110, 0)):
            done = True
            self.then()
        imgui.same_line()
        if imgui.button("Cancel", imgui.ImVec2(110, 0)) or imgui.is_key_pressed(imgui.Key.escape):
            done = True
        if done:
            imgui.close_current_popup()
        imgui.end_popup()
        return not done


def unless_unsaved(state: State, then: Callable[[], None]) -> None:
    """Do what would lose changes, at once or after asking."""
    if state.workspace.unsaved:
        state.dialog = Question(state, then)
    else:
        then()


@dataclass
class Recovery:
    """What an editor that crashed left behind."""

    state: State
    saved: Saved
    opened: bool = False

    def gui(self) -> bool:
        title = "Recover unsaved work"
        if not self.opened:
            imgui.open_popup(title)
            self.opened = True
        centre = imgui.get_main_viewport().get_center()
        imgui.set_next_window_pos(centre, imgui.Cond_.appearing, imgui.ImVec2(0.5, 0.5))
        going, _ = imgui.begin_popup_modal(title, None, imgui.WindowFlags_.always_auto_resize)
        if not going:
            return False
        name = self.saved.scene or "A new scene"
        imgui.text(f"{name}: {self.saved.steps} edits were not saved when the editor ended.")
        imgui.spacing()
        done = False
        if imgui.button("Recover", imgui.ImVec2(110, 0)):
            self.state.attempt(self.state.workspace.recover, self.saved)
            self.state.fit()
            done = True
        mark("recover")
        imgui.same_line()
        if imgui.button("Discard", imgui.ImVec2(110, 0)):
            drop(Path(self.saved.file))
            done = True
        imgui.same_line()
        if imgui.button("Later", imgui.ImVec2(110, 0)):
            done = True
        if done:
            imgui.close_current_popup()
        imgui.end_popup()
        return not done
