"""What menus, keys and buttons have in common."""

from composer.editor import proposals
from composer.editor.commands import AddSolid, AssignMaterial, Command, Delete, Duplicate
from composer.editor.presets import Preset
from composer.editor.window.state import State

LAMPS = (
    ("Sphere lamp", "sphere"),
    ("Area lamp", "rect"),
    ("Disk lamp", "disk"),
    ("Tube lamp", "cylinder"),
    ("Distant light", "distant"),
    ("Dome", "dome"),
)


def delete(state: State) -> None:
    if state.workspace.selection:
        state.do(Delete(state.workspace.selection))


def duplicate(state: State) -> None:
    if state.workspace.selection:
        state.do(Duplicate(state.workspace.selection))


def add_lamp(state: State, kind: str) -> None:
    state.do(proposals.lamp(state.workspace, kind))


def add_camera(state: State) -> None:
    if state.do(proposals.camera(state.workspace)):
        state.shown_camera = state.workspace.selection[0]


def add_solid(state: State, kind: str) -> None:
    """Half as large as what there is, on the ground."""
    bounds = state.workspace.bounds()
    size = 0.1 if bounds is None else max(float((bounds[1] - bounds[0]).max()), 1e-3)
    size = float(f"{size:.1g}")
    extent = (2 * size, 2 * size, 0.0) if kind == "plane" else (size, size, size)
    state.do(AddSolid(kind, kind.capitalize(), extent))


def use_preset(state: State, preset: Preset) -> None:
    """Bring a material of the library in, and dress what is selected in it."""
    bodies = tuple(p for p in state.workspace.selection if state.workspace.kind(p) in ("mesh", "group"))
    command: Command = preset.command
    if not state.do(command):
        return
    material = state.workspace.selection[0]
    if bodies:
        state.do(AssignMaterial(bodies, material))
        state.workspace.select(bodies)


def save(state: State) -> None:
    from composer.editor.window.dialogs import save_as

    if state.workspace.path is None:
        save_as(state)
    elif state.attempt(state.workspace.save) is not None:
        state.tell(f"Saved {state.workspace.path}")
