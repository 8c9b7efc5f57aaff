"""What the editor costs: from the start to the first picture, and a frame while the overview orbits.

    PYTHONPATH=. python benchmarks/editor.py [--triangles 100000] [--size 1280x720] [--frames 40]

A screen of its own (Xvfb) and llvmpipe where there is no GPU. CPU seconds of the process (all threads) stand beside
those of the clock: on a busy machine only they mean something; over two cores they are at most twice the clock's.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

START = time.time() - time.process_time()


def scene_file(folder: Path, triangles: int) -> Path:
    """A bumpy sphere of so many triangles under three lamps, and a camera."""
    from composer.editor.workspace import Workspace
    from interchange.formats.usd_edit_prims import add_mesh
    from interchange.mesh import Mesh, smooth_normals

    n = max(4, round(np.sqrt(triangles / 2)))
    theta, phi = np.meshgrid(
        np.linspace(0.01, np.pi - 0.01, n + 1), np.linspace(0, 2 * np.pi, n + 1), indexing="ij"
    )
    radius = 0.1 * (1 + 0.05 * np.sin(9 * theta) * np.sin(8 * phi))
    ring = np.sin(theta)
    points = np.stack([ring * np.cos(phi), ring * np.sin(phi), np.cos(theta)], -1) * radius[..., None]
    at = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    a, b, c, d = (x.ravel() for x in (at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]).astype(np.int32)
    vertices = points.reshape(-1, 3)
    workspace = Workspace()
    add_mesh(workspace.stage, "Body", Mesh(vertices, faces, smooth_normals(vertices, faces)), (0, 0, 0))
    for x in (-0.3, 0.0, 0.3):
        workspace.do(f"add_lamp position=[{x},-0.3,0.4]")
    workspace.do("add_camera position=[0,-0.8,0.4]")
    file = folder / "scene.usdc"
    workspace.save(file)
    return file


def measure(file: Path, size: tuple[int, int], frames: int) -> None:
    from composer.commands.edit import load_window
    from composer.editor.workspace import Workspace

    workspace = Workspace()
    load_window()
    workspace.open(file)
    from composer.editor.window import app as window

    app = window.App(workspace, rests=False)
    times: list[tuple[float, float]] = []
    told: list[int] = []  # frames until the camera's picture was there in full
    gaps: list[tuple[float, float]] = []  # from frame to frame until then, by the clock and by CPU time

    def each(shown: window.App) -> None:
        times.append((time.perf_counter(), time.process_time()))
        if shown.frames == 2:
            print(
                f"first picture after {time.time() - START:.2f} s, {time.process_time():.2f} CPU s",
                flush=True,
            )
        if not told and shown.frames > 3:
            gaps.append((times[-1][0] - times[-2][0], times[-1][1] - times[-2][1]))
        if not told and shown.views[0].full:
            told.append(len(times))
            clock, cpu = np.max(gaps, axis=0)
            print(
                f"longest from one frame to the next until then: {clock:.2f} s, {cpu:.2f} CPU s", flush=True
            )
            print(
                f"the camera's picture in full after {time.time() - START:.2f} s, {time.process_time():.2f} CPU s",
                flush=True,
            )
        if told:
            shown.state.orbit = shown.state.orbit.turned(0.03, 0.0)
        shown.state.quit = bool(told) and len(times) > told[0] + 12 + frames

    window.EACH_FRAME.append(each)
    app.run(size)
    taken = np.diff(np.array(times[-frames:]), axis=0) * 1e3
    clock, cpu = np.median(taken, axis=0)
    print(f"orbiting: {clock:.0f} ms a frame ({1e3 / clock:.1f} frames/s), {cpu:.0f} CPU ms")
    width, height = app.viewport.size
    print(f"overview of {width} x {height} px, drawn at 1/{app.viewport.coarse} of that while it moves")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--triangles", type=int, default=100_000)
    parser.add_argument("--size", default="1280x720")
    parser.add_argument("--frames", type=int, default=40)
    parser.add_argument("--file", type=Path, help="(for the process that has the screen)")
    args = parser.parse_args()
    width, height = map(int, args.size.split("x"))
    if args.file is not None:
        measure(args.file, (width, height), args.frames)
        return
    from composer.editor.robot import screen

    with tempfile.TemporaryDirectory() as folder, screen(width, height) as display:
        file = scene_file(Path(folder), args.triangles)
        words = [sys.executable, __file__, *sys.argv[1:], "--file", str(file)]
        root = str(Path(__file__).resolve().parents[1])
        subprocess.run(words, env={**os.environ, "DISPLAY": display, "PYTHONPATH": root}, check=True)


if __name__ == "__main__":
    main()
