"""The window: panels, menus and the loop."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import moderngl
from imgui_bundle import hello_imgui, imgui, immapp
from imgui_bundle import icons_fontawesome_6 as icons

from composer.editor.autosave import orphans
from composer.editor.window import actions, dialogs, glfw, keys, theme
from composer.editor.window.camera_view import CameraView, keep_awake
from composer.editor.window.console import Console
from composer.editor.window.library import Library
from composer.editor.window.places import mark
from composer.editor.window.properties import Properties
from composer.editor.window.state import State
from composer.editor.window.timeline import Timeline
from composer.editor.window.tree import Tree
from composer.editor.window.viewport import Viewport
from composer.editor.workspace import Workspace
from interchange.problems import BrightfieldError
from realtime.renderers.rasterizer import Rasterizer

AUTOSAVE_SECONDS = 20.0
SIZE = (1600, 960)
VIEWS = 4  # of cameras; those after the second are opened by the menu View
MORE = [f"Camera {n + 1}" for n in range(2, VIEWS)]
EACH_FRAME: list[Callable[["App"], None]] = []  # for measurements


class App:
    """``rests``: draws only now and then while nothing happens."""

    def __init__(self, workspace: Workspace, rests: bool = True) -> None:
        self.rests = rests
        self.state = State(workspace)
        self.viewport = Viewport(self.state)
        self.tree = Tree(self.state)
        self.properties = Properties(self.state)
        self.library = Library(self.state)
        self.views = [CameraView(self.state, number) for number in range(VIEWS)]
        self.timeline = Timeline(self.state)
        self.console = Console(self.state)
        self.shortcuts = keys.shortcuts(self.state, self.viewport, self.tree)
        self.kept_at = time.monotonic()
        self.frames = 0
        self.drawn = 0  # the number that the toolkit gives the last frame
        self.title = ""
        self.dropped: list[Path] = []

    def run(self, size: tuple[int, int] = SIZE) -> None:
        """Until the window is closed. BrightfieldError where none can be opened."""
        try:
            immapp.run(self._params(size), immapp.AddOnsParams())
        except Exception as error:
            self.state.workspace.keep()  # what went wrong here must not cost anyone's work
            if self.frames or not isinstance(error, RuntimeError):
                raise
            raise BrightfieldError(
                f"No window could be opened: {error}. Without a screen: brightfield edit FILE --headless --do '…'"
            ) from None
        if self.state.job is not None:
            self.state.job.cancel()
        if self.state.stream is not None:
            self.state.stream.stop()

    def _params(self, size: tuple[int, int]) -> Any:
        params = hello_imgui.RunnerParams()
        params.app_window_params.window_title = "Brightfield"
        params.app_window_params.window_geometry.size = size
        params.app_window_params.restore_previous_geometry = False
        params.ini_disable = True
        options = hello_imgui.OpenGlOptions()
        options.major_version, options.minor_version = 4, 1
        options.use_core_profile, options.use_forward_compat, options.glsl_version = True, False, "410"
        options.anti_aliasing_samples = (
            0  # lines and edges of Dear ImGui are smooth without; its 8 cost half a frame
        )
        params.renderer_backend_options.open_gl_options = options
        window = params.imgui_window_params
        window.default_imgui_window_type = hello_imgui.DefaultImGuiWindowType.provide_full_screen_dock_space
        window.show_menu_bar, window.show_menu_app, window.show_menu_view = True, False, False
        window.show_status_bar, window.show_status_fps = True, False
        window.tweaked_theme = hello_imgui.ImGuiTweakedTheme(hello_imgui.ImGuiTheme_.darcula_darker)
        params.fps_idling.enable_idling = True
        params.fps_idling.fps_idle = 4.0
        params.fps_idling.time_active_after_last_event = 0.5
        params.fps_idling.vsync_to_monitor = False
        params.fps_idling.fps_max = 60.0
        calls = params.callbacks
        calls.load_additional_fonts = theme.load_fonts
        calls.setup_imgui_style = theme.apply
        calls.post_init = self._start
        calls.show_menus = self._menus
        calls.show_status = self._status
        calls.before_imgui_render = self._before_render
        calls.pre_new_frame = self._before
        calls.before_exit = self._end
        params.docking_params = self._layout()
        return params

    def _layout(self) -> Any:
        docking = hello_imgui.DockingParams()
        docking.layout_name = "Composer"
        split = hello_imgui.DockingSplit
        Dir = imgui.Dir
        docking.docking_splits = [
            split("MainDockSpace", "Right", Dir.right, 0.235),
            split("MainDockSpace", "Left", Dir.left, 0.205),
            split("Left", "LeftDown", Dir.down, 0.52),
            split("MainDockSpace", "Down", Dir.down, 0.40),
            split("Down", "DownRight", Dir.right, 0.5),
        ]
        windows = [
            ("Scene", "Left", self.tree.gui),
            ("Materials", "LeftDown", self.library.gui),
            ("Overview", "MainDockSpace", self.viewport.gui),
            ("Camera", "Down", self.views[0].gui),
            ("Camera 2", "DownRight", self.views[1].gui),
            ("Console", "DownRight", self.console.gui),
            ("Time", "DownRight", self.timeline.gui),
            ("Properties", "Right", self.properties.gui),
            *(
                (f"Camera {n + 1}", "DownRight" if n % 2 else "Down", self.views[n].gui)
                for n in range(2, VIEWS)
            ),
        ]
        found = []
        for label, place, gui in windows:
            each = hello_imgui.DockableWindow(label, place, gui)
            each.can_be_closed = label in MORE
            each.is_visible = label not in MORE
            if label == "Overview":
                flags = imgui.WindowFlags_
                each.imgui_window_flags = flags.no_scrollbar | flags.no_scroll_with_mouse | flags.no_move
            found.append(each)
        docking.dockable_windows = found
        return docking

    def _start(self) -> None:
        self.state.context = moderngl.create_context(require=410)
        self.state.renderer = Rasterizer(self.state.context)
        self.state.full.start(self.state.context)
        io = imgui.get_io()
        io.config_windows_move_from_title_bar_only = True
        io.config_drag_click_to_input_text = False
        glfw.watch(self.dropped.append)
        self.state.fit()
        if self.state.workspace.autosave is not None:
            left = orphans(self.state.workspace.autosave.folder)
            if left:
                self.state.dialog = dialogs.Recovery(self.state, left[0])

    def _before(self) -> None:
        state = self.state
        self.frames += 1
        self.drawn = imgui.get_frame_count()
        for path in self.dropped:
            dialogs.bring_in(state, path)
        self.dropped.clear()
        keep_awake(state)
        if self.timeline.playing or not self.rests:
            hello_imgui.request_refresh()
        if (
            time.monotonic() - self.kept_at > AUTOSAVE_SECONDS
            and state.dragged is None
            and state.held is None
        ):
            state.attempt(state.workspace.keep)
            self.kept_at = time.monotonic()
        for call in EACH_FRAME:
            call(self)
        params = hello_imgui.get_runner_params()
        if params.app_shall_exit and not state.quit and state.workspace.unsaved:
            params.app_shall_exit = False
            dialogs.unless_unsaved(state, self._quit)
        if state.quit:
            params.app_shall_exit = True

    def _before_render(self) -> None:
        state = self.state
        state.notice()
        if state.dialog is not None:
            dialog = state.dialog
            if not dialog.gui() and state.dialog is dialog:
                state.dialog = None
        elif self.viewport.modal is None and not imgui.is_popup_open("", imgui.PopupFlags_.any_popup_id):
            keys.press(self.shortcuts)
        star = " *" if state.workspace.unsaved else ""
        title = f"{state.workspace.name}{star} · Brightfield"
        if title != self.title:
            self.title = title
            glfw.set_title(title)

    def _quit(self) -> None:
        self.state.quit = True

    def _end(self) -> None:
        """An end that was asked for; after any other the autosave stays."""
        workspace = self.state.workspace
        if workspace.autosave is not None and (self.state.quit or not workspace.unsaved):
            workspace.autosave.drop()

    # menus and status

    def _item(self, label: str, keys_: str = "", enabled: bool = True, on: bool = False) -> bool:
        pressed = imgui.menu_item_simple(label, keys_, on, enabled)
        mark(f"menu {label}")
        return bool(pressed)

    def _menus(self) -> None:
        for title, content in (
            ("File", self._file),
            ("Edit", self._edit),
            ("Add", self._add),
            ("View", self._view),
            ("Help", self._help),
        ):
            opened = imgui.begin_menu(title)
            mark(f"menu {title}")
            if opened:
                content()
                imgui.end_menu()

    def _file(self) -> None:
        state = self.state
        if self._item("New", "Ctrl+N"):
            dialogs.unless_unsaved(state, state.workspace.new)
        if self._item("Open…", "Ctrl+O"):
            dialogs.unless_unsaved(state, lambda: dialogs.open_file(state))
        if self._item("Import…", "Ctrl+I"):
            dialogs.import_file(state)
        imgui.separator()
        if self._item("Save", "Ctrl+S"):
            actions.save(state)
        if self._item("Save as…", "Ctrl+Shift+S"):
            dialogs.save_as(state)
        imgui.separator()
        if self._item("Quit"):
            dialogs.unless_unsaved(state, self._quit)

    def _edit(self) -> None:
        state, history = self.state, self.state.workspace.history
        last = history.last.command.title if history.last else ""
        following = history.undone[-1].command.title if history.undone else ""
        if self._item(f"Undo {last}", "Ctrl+Z", bool(last)):
            state.undo()
        if self._item(f"Redo {following}", "Ctrl+Y", bool(following)):
            state.redo()
        imgui.separator()
        some = bool(state.workspace.selection)
        if self._item("Duplicate", "Shift+D", some):
            actions.duplicate(state)
        if self._item("Rename", "F2", len(state.workspace.selection) == 1):
            self.tree.begin_rename()
        if self._item("Delete", "Del", some):
            actions.delete(state)

    def _add(self) -> None:
        state = self.state
        imgui.text_disabled("Lamps")
        for label, kind in actions.LAMPS:
            if self._item(f"{icons.ICON_FA_LIGHTBULB}  {label}"):
                actions.add_lamp(state, kind)
            mark(f"menu {label}")
        imgui.separator()
        if self._item(f"{icons.ICON_FA_VIDEO}  Camera"):
            actions.add_camera(state)
        mark("menu Camera")
        imgui.separator()
        for kind in ("box", "plane", "cylinder", "sphere"):
            if self._item(f"{icons.ICON_FA_CUBE}  {kind.capitalize()}"):
                actions.add_solid(state, kind)

    def _view(self) -> None:
        state = self.state
        for side in ("front", "back", "left", "right", "top", "bottom"):
            if self._item(
                side.capitalize(), {"front": "Num 1", "right": "Num 3", "top": "Num 7"}.get(side, "")
            ):
                state.orbit = state.orbit.seen_from(side)
        imgui.separator()
        if self._item("Fit", "F"):
            state.fit()
        if self._item("Grid", "", True, state.show_grid):
            state.show_grid = not state.show_grid
        if self._item("Field of view of the selected camera", "", True, state.show_field):
            state.show_field = not state.show_field
        imgui.separator()
        for label in MORE:
            window = hello_imgui.get_runner_params().docking_params.dockable_window_of_name(label)
            if window is not None and self._item(label, "", True, window.is_visible):
                window.is_visible = not window.is_visible

    def _help(self) -> None:
        if imgui.begin_table("##keys", 2, imgui.TableFlags_.sizing_fixed_fit):
            rows = [*((s.keys, s.meaning) for s in self.shortcuts), *keys.MOUSE]
            for words, meaning in rows:
                imgui.table_next_row()
                imgui.table_next_column()
                imgui.text_colored(imgui.ImVec4(*theme.MUTED), words)
                imgui.table_next_column()
                imgui.text(f"{meaning}  ")
            imgui.end_table()

    def _status(self) -> None:
        state = self.state
        fresh = time.monotonic() - state.message_at < (20 if state.message_is_error else 6)
        if state.message and fresh:
            color = theme.BAD if state.message_is_error else (0.88, 0.885, 0.895, 1)
            line = state.message.splitlines()[0]
            imgui.text_colored(imgui.ImVec4(*color), line)
            if imgui.is_item_hovered():
                imgui.set_tooltip(state.message)
        else:
            scene = state.workspace.scene
            triangles = f"{sum(len(b.mesh.faces) for b in scene.bodies):,}".replace(",", " ")
            imgui.text_disabled(
                f"{len(scene.bodies)} surfaces   {triangles} triangles   {len(scene.lights)} lamps   "
                f"{len(scene.cameras)} cameras"
            )
        if state.renderer is not None:
            text = f"{state.renderer.gl.split(' (')[0]}"
            imgui.same_line(max(imgui.get_window_width() - imgui.calc_text_size(text).x - 16, 0))
            imgui.text_disabled(text)
