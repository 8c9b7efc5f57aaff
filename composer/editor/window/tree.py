"""The scene tree."""

from imgui_bundle import icons_fontawesome_6 as icons
from imgui_bundle import imgui

from composer.editor.commands import AssignMaterial, Rename, Show
from composer.editor.window import theme
from composer.editor.window.actions import drop_material
from composer.editor.window.places import mark
from composer.editor.window.state import State
from interchange.formats.usd_edit import Node

ICONS = {
    "group": (icons.ICON_FA_FOLDER, theme.MUTED),
    "mesh": (icons.ICON_FA_CUBE, (0.72, 0.76, 0.82, 1.0)),
    "light": (icons.ICON_FA_LIGHTBULB, theme.LAMP),
    "camera": (icons.ICON_FA_VIDEO, theme.CAMERA),
    "material": (icons.ICON_FA_PALETTE, (0.80, 0.62, 0.90, 1.0)),
}


class Tree:
    def __init__(self, state: State) -> None:
        self.state = state
        self.editing = ""
        self.text = ""
        self.words = ""

    def gui(self) -> None:
        imgui.set_next_item_width(-1)
        _, self.words = imgui.input_text_with_hint(
            "##find", f"{icons.ICON_FA_MAGNIFYING_GLASS}  Find", self.words
        )
        imgui.begin_child("##tree")
        for node in self.state.workspace.outline:
            self._node(node)
        if imgui.is_window_hovered() and imgui.is_mouse_clicked(0) and not imgui.is_any_item_hovered():
            self.state.workspace.select([])
        imgui.end_child()

    def begin_rename(self) -> None:
        if len(self.state.workspace.selection) == 1:
            self.editing = self.state.workspace.selection[0]
            self.text = self.editing.rsplit("/", 1)[-1]

    def _node(self, node: Node) -> None:
        if self.words and not any(self.words.lower() in n.name.lower() for n in node.below()):
            return
        workspace = self.state.workspace
        imgui.push_id(node.path)
        flags = imgui.TreeNodeFlags_
        style = flags.open_on_arrow | flags.span_avail_width | flags.frame_padding | flags.allow_overlap
        if not node.children:
            style |= flags.leaf | flags.no_tree_push_on_open
        if node.path in workspace.selection:
            style |= flags.selected
        if node.kind != "group" or not node.path.endswith("/Materials"):
            style |= flags.default_open if node.path.count("/") < 3 else 0
        icon, color = ICONS[node.kind]
        opened = imgui.tree_node_ex("##node", style)
        mark(f"tree {node.path}")
        clicked = imgui.is_item_clicked() and not imgui.is_item_toggled_open()
        twice = imgui.is_item_hovered() and imgui.is_mouse_double_clicked(0)
        self._drag_and_drop(node)
        self._menu(node)
        imgui.same_line(0, 4)
        imgui.text_colored(imgui.ImVec4(*color), icon)
        imgui.same_line(0, 6)
        if self.editing == node.path:
            self._rename(node)
        elif node.visible:
            imgui.text(node.name)
        else:
            imgui.text_disabled(node.name)
        if node.kind in ("mesh", "group", "light") and self.editing != node.path:
            self._eye(node)
        if clicked:
            io = imgui.get_io()
            if io.key_ctrl or io.key_shift:
                kept = [p for p in workspace.selection if p != node.path]
                workspace.select(kept if node.path in workspace.selection else [*kept, node.path])
            else:
                workspace.select([node.path])
        if twice and node.kind != "material":
            self.state.fit()
        if opened and node.children:
            for child in node.children:
                self._node(child)
            imgui.tree_pop()
        imgui.pop_id()

    def _eye(self, node: Node) -> None:
        bar = imgui.get_style().scrollbar_size if imgui.get_scroll_max_y() > 0 else 0.0
        imgui.same_line(imgui.get_window_width() - 26 - bar)
        icon = icons.ICON_FA_EYE if node.visible else icons.ICON_FA_EYE_SLASH
        imgui.push_style_color(imgui.Col_.button.value, imgui.ImVec4(0, 0, 0, 0))
        tint = theme.MUTED if node.visible else theme.WARN
        imgui.push_style_color(imgui.Col_.text.value, imgui.ImVec4(*tint[:3], 0.7 if node.visible else 1.0))
        if imgui.small_button(icon):
            self.state.do(Show(node.path, not node.visible))
        imgui.pop_style_color(2)

    def _rename(self, node: Node) -> None:
        imgui.set_next_item_width(-30)
        imgui.set_keyboard_focus_here()
        flags = imgui.InputTextFlags_.enter_returns_true | imgui.InputTextFlags_.auto_select_all
        entered, text = imgui.input_text("##name", self.text, flags)
        self.text = text
        if entered:
            if text and text != node.path.rsplit("/", 1)[-1]:
                self.state.do(Rename(node.path, text))
            self.editing = ""
        elif imgui.is_key_pressed(imgui.Key.escape) or (
            imgui.is_mouse_clicked(0) and not imgui.is_item_hovered()
        ):
            self.editing = ""

    def _drag_and_drop(self, node: Node) -> None:
        if node.kind == "material" and imgui.begin_drag_drop_source():
            self.state.carried = node.path
            imgui.set_drag_drop_payload_py_id("material", 1)
            imgui.text(f"{icons.ICON_FA_PALETTE}  {node.name}")
            imgui.end_drag_drop_source()
        if node.kind in ("mesh", "group") and imgui.begin_drag_drop_target():
            if imgui.accept_drag_drop_payload_py_id("material") is not None:
                drop_material(self.state, node.path)
            imgui.end_drag_drop_target()

    def _menu(self, node: Node) -> None:
        from composer.editor.window.actions import delete, duplicate

        if not imgui.begin_popup_context_item("##context"):
            return
        workspace = self.state.workspace
        if node.path not in workspace.selection:
            workspace.select([node.path])
        if imgui.menu_item_simple("Rename", "F2"):
            self.begin_rename()
        if imgui.menu_item_simple("Duplicate", "Shift+D"):
            duplicate(self.state)
        if imgui.menu_item_simple("Delete", "Del"):
            delete(self.state)
        if node.kind == "material":
            bodies = [p for p in workspace.selection if workspace.kind(p) in ("mesh", "group")]
            if imgui.menu_item_simple("Assign to selection", "", False, bool(bodies)):
                self.state.do(AssignMaterial(tuple(bodies), node.path))
        elif imgui.menu_item_simple("Fit", "F"):
            self.state.fit()
        imgui.end_popup()
