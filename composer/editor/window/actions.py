"""What menus, keys and buttons have in common."""

from composer.editor import proposals
from composer.editor.commands import AddSolid, AssignMaterial, Command, Delete, Duplicate
from composer.editor.live_camera import LiveCamera
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


def use_preset(state: State, preset: Preset, on: tuple[str, ...] = ()) -> None:
    """Bring a material of the library in, and dress these bodies in it, or what is selected."""
    wanted = on or state.workspace.selection
    bodies = tuple(p for p in wanted if state.workspace.kind(p) in ("mesh", "group"))
    command: Command = preset.command
    if not state.do(command):
        return
    material = state.workspace.selection[0]
    if bodies:
        state.do(AssignMaterial(bodies, material))
        state.workspace.select(bodies)


def drop_material(state: State, path: str) -> None:
    """What is carried from the tree or the library falls onto a body."""
    if not path or state.workspace.kind(path) not in ("mesh", "group"):
        state.tell("A material is dropped onto a body.")
    elif isinstance(state.carried, Preset):
        use_preset(state, state.carried, (path,))
    elif state.carried:
        state.do(AssignMaterial((path,), state.carried))
    state.carried = ""


def stream(state: State, camera: str) -> None:
    """Stream this camera instead of another one; "" ends it."""
    if state.stream is not None:
        state.stream.stop()
        state.stream = None
        state.tell("The stream has ended.")
    if not camera:
        return
    live = LiveCamera(state.workspace, camera)
    lines = state.attempt(live.start)
    if lines is not None:
        state.stream = live
        state.tell("; ".join(lines))


def save(state: State) -> None:
    from composer.editor.window.dialogs import save_as

    if state.workspace.path is None:
        save_as(state)
    elif state.attempt(state.workspace.save) is not None:
        state.tell(f"Saved {state.workspace.path}")
