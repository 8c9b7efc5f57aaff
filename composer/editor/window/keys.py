"""Keys, as users of Blender and of CAD programs expect them; one table, which the menu Help shows too."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from imgui_bundle import imgui

from composer.editor.window import actions, dialogs
from composer.editor.window.state import State
from composer.editor.window.tree import Tree
from composer.editor.window.viewport import Viewport

K, MOD = imgui.Key, imgui.Key.mod_ctrl
SHIFT = imgui.Key.mod_shift


@dataclass(frozen=True)
class Shortcut:
    chords: tuple[int, ...]
    keys: str  # as the help writes them
    meaning: str
    action: Callable[[], None]
    typing: bool = False  # acts while text is typed, too


def shortcuts(state: State, view: Viewport, tree: Tree) -> list[Shortcut]:
    def chord(*keys: int) -> int:
        total = 0
        for key in keys:
            total |= int(key)
        return total

    def side(name: str) -> Callable[[], None]:
        def act() -> None:
            state.orbit = state.orbit.seen_from(name)

        return act

    def tool(kind: str) -> Callable[[], None]:
        def act() -> None:
            state.operation = kind
            view.begin_modal(kind)

        return act

    def flip() -> None:
        state.orbit = replace(state.orbit, orthographic=not state.orbit.orthographic)

    def shade() -> None:
        state.shading = "lamps" if state.shading == "solid" else "solid"

    def copy() -> None:
        actions.duplicate(state)
        view.begin_modal("move")

    def new() -> None:
        dialogs.unless_unsaved(state, state.workspace.new)

    def look_through() -> None:
        chosen = [p for p in state.workspace.selection if state.workspace.kind(p) == "camera"]
        if chosen:
            state.shown_camera = chosen[-1]

    def everything() -> None:
        state.workspace.select(
            n.path
            for top in state.workspace.outline
            for n in top.below()
            if n.kind in ("mesh", "light", "camera")
        )

    return [
        Shortcut((chord(MOD, K.n),), "Ctrl N", "new scene", new),
        Shortcut(
            (chord(MOD, K.o),),
            "Ctrl O",
            "open",
            lambda: dialogs.unless_unsaved(state, lambda: dialogs.open_file(state)),
        ),
        Shortcut((chord(MOD, K.i),), "Ctrl I", "import", lambda: dialogs.import_file(state)),
        Shortcut((chord(MOD, K.s),), "Ctrl S", "save", lambda: actions.save(state), True),
        Shortcut((chord(MOD, SHIFT, K.s),), "Ctrl Shift S", "save as", lambda: dialogs.save_as(state), True),
        Shortcut((chord(MOD, K.z),), "Ctrl Z", "undo", state.undo),
        Shortcut((chord(MOD, K.y), chord(MOD, SHIFT, K.z)), "Ctrl Y", "redo", state.redo),
        Shortcut((chord(MOD, K.a),), "Ctrl A", "select everything", everything),
        Shortcut((K.g,), "G", "grab: move with the mouse", tool("move")),
        Shortcut((K.r,), "R", "rotate with the mouse", tool("rotate")),
        Shortcut((K.s,), "S", "scale with the mouse", tool("scale")),
        Shortcut((chord(SHIFT, K.d), chord(MOD, K.d)), "Shift D", "duplicate, and grab", copy),
        Shortcut((K.delete, K.x), "Del, X", "delete", lambda: actions.delete(state)),
        Shortcut((K.f2,), "F2", "rename", tree.begin_rename),
        Shortcut((K.f, K.keypad_decimal), "F", "fit the selection, or all", state.fit),
        Shortcut((K.home,), "Home", "fit all", lambda: state.fit(everything=True)),
        Shortcut((K.z,), "Z", "solid, or the scene's lamps", shade),
        Shortcut(
            (K.keypad1, chord(imgui.Key.mod_alt, K._1)), "Num 1, Alt 1", "from the front", side("front")
        ),
        Shortcut((chord(MOD, K.keypad1),), "Ctrl Num 1", "from the back", side("back")),
        Shortcut(
            (K.keypad3, chord(imgui.Key.mod_alt, K._3)), "Num 3, Alt 3", "from the right", side("right")
        ),
        Shortcut((chord(MOD, K.keypad3),), "Ctrl Num 3", "from the left", side("left")),
        Shortcut((K.keypad7, chord(imgui.Key.mod_alt, K._7)), "Num 7, Alt 7", "from the top", side("top")),
        Shortcut((chord(MOD, K.keypad7),), "Ctrl Num 7", "from below", side("bottom")),
        Shortcut(
            (K.keypad5, chord(imgui.Key.mod_alt, K._5)), "Num 5, Alt 5", "perspective or parallel", flip
        ),
        Shortcut(
            (K.keypad0, chord(imgui.Key.mod_alt, K._0)),
            "Num 0, Alt 0",
            "show the selected camera",
            look_through,
        ),
    ]


def press(found: list[Shortcut]) -> None:
    """Do what is pressed now."""
    typing = imgui.get_io().want_text_input
    for each in found:
        if (each.typing or not typing) and any(imgui.is_key_chord_pressed(c) for c in each.chords):
            each.action()
            return


MOUSE = (
    ("drag", "orbit (left or middle button)"),
    ("Shift drag, right drag", "pan"),
    ("wheel, Ctrl drag", "zoom"),
    ("click", "select; Shift or Ctrl: more"),
)
