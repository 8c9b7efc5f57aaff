"""`brightfield edit [FILE]`: the window; or, with --headless, the same edits from a script."""

import argparse
import importlib
import sys
from collections.abc import Iterable
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING

from composer.reading import add_reading_options, options_from
from interchange.problems import BrightfieldError

if TYPE_CHECKING:
    from composer.editor.workspace import Workspace

HELP = "open a scene in the editor's window, or edit it by commands"


def configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "file", metavar="FILE", nargs="?", type=Path, help="scene or part; none is a new scene"
    )
    parser.add_argument(
        "--do",
        action="append",
        default=[],
        metavar="EDIT",
        help="an edit, such as 'add_lamp kind=rect position=[0,0,0.3]' (m); several are done in order",
    )
    parser.add_argument("--script", type=Path, help="a file of edits, one a line, after those of --do")
    parser.add_argument("--headless", action="store_true", help="no window: edit, write, and end")
    parser.add_argument("--out", type=Path, help="where to write (default: FILE, which must then be USD)")
    stream = parser.add_argument_group("a live camera, which shows each edit (see brightfield stream)")
    stream.add_argument(
        "--stream",
        metavar="PRIM",
        help="a camera to stream meanwhile; with --headless, edits are then read from the input, one a line",
    )
    stream.add_argument(
        "--as", dest="kinds", nargs="+", default=["mjpeg"], metavar="KIND", help="(default: mjpeg)"
    )
    stream.add_argument("--address", default="127.0.0.1", help="(default: this machine alone)")
    stream.add_argument(
        "--port", type=int, help="of the first KIND (default: the one that its clients expect)"
    )
    parser.add_argument("--list", action="store_true", help="list the edits and their fields")
    add_reading_options(parser)


def run(args: argparse.Namespace) -> int:
    if args.list:
        print(edits())
        return 0
    from composer.editor.autosave import Autosave
    from composer.editor.live_camera import LiveCamera
    from composer.editor.workspace import Workspace

    workspace = Workspace(None if args.headless else Autosave())
    if not args.headless:
        load_window()
    if args.file is not None and (args.headless or args.file.exists() or args.file.suffix != ".usda"):
        workspace.open(args.file, options_from(args))
    elif args.file is not None:
        workspace.path = args.file  # a new scene that is saved there
    workspace.run(args.do)
    if args.script is not None:
        workspace.run(args.script.read_text(encoding="utf8").splitlines())
    for note in workspace.notes:
        print(note, file=sys.stderr)
    live = LiveCamera(workspace, args.stream, args.kinds, args.address, args.port) if args.stream else None
    if live is not None:
        for line in live.start():
            print(line, flush=True)
    try:
        if not args.headless:
            from composer.editor.window.app import App

            app = App(workspace)
            app.state.stream = live
            app.run()
            return 0
        if live is not None:
            edit_from(sys.stdin, workspace)
            if args.out is None:
                return 0
    finally:
        if live is not None:
            live.stop()
    target = args.out or workspace.path
    if target is None:
        raise BrightfieldError(
            "--headless needs --out: what was read is not a USD file that could be edited."
        )
    for lost in workspace.save(target):
        print(lost, file=sys.stderr)
    print(f"{target} written after {len(workspace.history.done)} edits.")
    return 0


def load_window() -> None:
    """Import the window's modules while a process of its own reads the file: half a second of a start."""
    Thread(target=importlib.import_module, args=("composer.editor.window.app",), daemon=True).start()


def edit_from(lines: Iterable[str], workspace: "Workspace") -> None:
    """Do each edit as its line comes in, ``undo`` and ``redo`` besides; what cannot be done is told."""
    for line in lines:
        words = line.strip()
        try:
            if words == "undo":
                workspace.undo()
            elif words == "redo":
                workspace.redo()
            else:
                workspace.run([words])
        except BrightfieldError as error:
            print(f"brightfield: {error}", file=sys.stderr, flush=True)


def edits() -> str:
    """Every edit with its fields and what it is."""
    from dataclasses import MISSING, fields

    from composer.editor.command_text import COMMANDS

    lines = []
    for name, kind in COMMANDS.items():
        lines.append(f"{name}: {' '.join((kind.__doc__ or kind.title).split())}")
        for f in fields(kind):  # type: ignore[arg-type]
            default = f.default_factory() if f.default_factory is not MISSING else f.default
            lines.append(f"    {f.name}{'' if default is MISSING else f'={default}'}")
    return "\n".join(lines)
