"""The editor driven as a person would: a STEP part, a lamp, a measured material, a camera, streamed while the part is
dragged, undone, saved, reopened; then killed, started again, and its work recovered.

python -m composer.editor.tour --out DIR              # status 0 where every step did what it should
python -m composer.editor.tour --out DIR --pictures   # the pictures of docs/editor.md
"""

import argparse
import os
import signal
import subprocess
import sys
import threading
import time
import traceback
from dataclasses import replace
from pathlib import Path

import numpy as np

from composer.editor.autosave import Autosave
from composer.editor.live_camera import LiveCamera
from composer.editor.robot import Robot, missing, screen
from composer.editor.window import app as window
from composer.editor.workspace import Workspace
from interchange.brdf.lafortune import Lafortune
from interchange.problems import BrightfieldError

PART = "cad/featuretype.STEP"
CRASHED = "crashed"  # folder of the copies that outlive a crash
SCENES = ("steps", "crash", "recover", "pictures")
LARGE, SMALL = (1600, 960), (1200, 760)


def steps(robot: Robot, part: Path, out: Path) -> None:
    """Each step is followed by what must then hold. Raises BrightfieldError or AssertionError."""
    workspace = robot.app.state.workspace
    robot.frames(3)
    robot.menu("File", "Import…")
    robot.type(str(part))
    robot.key("Return")
    robot.wait("The part", lambda: len(workspace.scene.bodies) > 0 and len(workspace.selection) == 1)
    (body,) = workspace.selection
    robot.menu("Add", "Area lamp")
    robot.wait("The lamp", lambda: len(workspace.scene.lights) == 1 and workspace.selection != (body,))
    (lamp,) = workspace.selection

    start = workspace.pose(lamp)
    robot.key("Home")
    robot.frames(5)
    middle = robot.middle("gizmo")
    robot.drag(middle, (middle[0] + 60, middle[1] - 40))
    moved = workspace.pose(lamp)
    assert np.linalg.norm(moved[:3, 3] - start[:3, 3]) > 1e-3, "the gizmo moves the lamp"
    np.testing.assert_allclose(moved[:3, :3], start[:3, :3], atol=1e-9)
    assert workspace.log[-1].startswith("transform")

    robot.click(f"tree {body}")
    assert workspace.selection == (body,)
    robot.click("library find")
    robot.type("machined")
    robot.click("library aluminium, machined")
    robot.wait("The material", lambda: isinstance(workspace.scene.bodies[0].material.brdf, Lafortune))
    assert workspace.selection == (body,)

    robot.menu("Add", "Camera")
    robot.wait("The camera", lambda: len(workspace.scene.cameras) == 1)
    robot.wait("Its picture", lambda: robot.app.views[0].full)
    robot.key("ctrl+z")
    assert len(workspace.scene.cameras) == 0, "undo takes the camera away"
    robot.key("ctrl+y")
    assert len(workspace.scene.cameras) == 1, "redo brings it back"
    for count in (2, 3):
        robot.menu("Add", "Camera")
        robot.wait("Another camera", lambda count=count: len(workspace.scene.cameras) == count)
    robot.menu("View", "Camera 3")
    third = robot.app.views[2]
    robot.wait("A third view", lambda: third.full and third.camera == workspace.scene.cameras[2].name)
    robot.menu("View", "Camera 3")
    for _ in range(2):
        robot.key("ctrl+z")
    assert len(workspace.scene.cameras) == 1
    robot.click(f"tree {body}")

    aluminium = workspace.scene.bodies[0].material
    robot.click("library find")
    robot.key("ctrl+a")
    robot.type("ground")
    robot.drag(robot.middle("library steel, ground"), seen(robot, 0), steps=6)
    robot.wait("The dropped material", lambda: "assign_material" in workspace.log[-1])
    assert body in workspace.log[-1], "a material of the library falls onto the body under the cursor"
    robot.key("ctrl+z")
    robot.key("ctrl+z")
    assert workspace.scene.bodies[0].material == aluminium

    robot.click("stream 0")
    robot.wait("The stream", lambda: robot.app.state.stream is not None)
    stream = robot.app.state.stream
    assert stream is not None
    robot.wait("A frame", lambda: stream._publisher.latest is not None)
    dragged_in_the_stream(robot, stream, body)
    robot.click("stream 0")
    robot.wait("The stream's end", lambda: robot.app.state.stream is None)

    x0, y0, x1, y1 = robot.rect("viewport")
    robot.click(f"tree {body}")
    before = workspace.pose(body)
    robot.move((x0 + x1) / 2, (y0 + y1) / 2)
    for key in ("r", "z", "3", "0", "Return"):
        robot.key(key)
    turn = workspace.pose(body)[:3, :3] @ np.linalg.inv(before[:3, :3])
    np.testing.assert_allclose(np.degrees(np.arctan2(turn[1, 0], turn[0, 0])), 30, atol=1e-4)
    robot.key("ctrl+z")
    np.testing.assert_allclose(workspace.pose(body), before, atol=1e-12)

    orbit = robot.app.state.orbit
    robot.drag((x0 + 60, y1 - 160), (x0 + 130, y1 - 130))
    assert robot.app.state.orbit != orbit, "a drag beside things orbits"
    assert workspace.selection == (body,)

    scene = workspace.scene
    file = out / "tour.usda"
    robot.key("ctrl+s")
    robot.rect("dialog name")
    robot.key("ctrl+a")
    robot.type(str(file))
    robot.key("Return")
    robot.wait("The file", lambda: file.exists() and not workspace.unsaved)
    robot.key("ctrl+o")
    robot.rect("dialog name")
    robot.type(str(file))
    robot.key("Return")
    robot.wait("The scene of the file", lambda: not workspace.history.done and workspace.scene is not scene)
    again = workspace.scene
    assert [b.name for b in again.bodies] == [b.name for b in scene.bodies]
    for a, b in zip(again.bodies, scene.bodies, strict=True):
        np.testing.assert_array_equal(a.mesh.vertices, b.mesh.vertices)
        np.testing.assert_array_equal(a.world_from_body, b.world_from_body)
        assert a.material.brdf == b.material.brdf
    np.testing.assert_array_equal(again.lights[0].world_from_light, scene.lights[0].world_from_light)
    assert again.lights[0].intensity == scene.lights[0].intensity
    assert again.cameras[0].lens == scene.cameras[0].lens
    assert again.cameras[0].sensor == scene.cameras[0].sensor


def dragged_in_the_stream(robot: Robot, stream: LiveCamera, body: str) -> None:
    """Frames show the part while the mouse still holds it, where it is let go, and where undo puts it."""
    workspace = robot.app.state.workspace
    name = workspace.scene.bodies[0].name
    robot.click(f"tree {body}")
    start = workspace.scene.bodies[0].world_from_body

    def streamed() -> np.ndarray:
        frame = stream._publisher.latest
        assert frame is not None
        return frame.truth.pose(name)

    def held() -> None:
        robot.wait("The drag in the stream", lambda: np.abs(streamed() - start).max() > 1e-4)
        np.testing.assert_array_equal(workspace.scene.bodies[0].world_from_body, start)
        shown = robot.app.state.scene.bodies[0].world_from_body
        robot.wait("The latest of it", lambda: np.array_equal(streamed(), shown))

    middle = robot.middle("gizmo")
    robot.drag(middle, (middle[0] + 30, middle[1] - 20), held=held)
    end = workspace.scene.bodies[0].world_from_body
    assert np.abs(end - start).max() > 1e-4, "the part was let go elsewhere"
    robot.wait("Its new place in the stream", lambda: np.allclose(streamed(), end, atol=1e-12))
    robot.key("ctrl+z")
    robot.wait("Its old place in the stream", lambda: np.allclose(streamed(), start, atol=1e-12))


def crash(robot: Robot, out: Path) -> None:
    """Edit, and die without a word once the copy is there."""
    app = robot.app
    window.AUTOSAVE_SECONDS = 0.1
    robot.menu("Add", "Area lamp")
    robot.wait("The lamp", lambda: len(app.state.workspace.scene.lights) == 1)
    robot.wait("The copy", lambda: any((out / CRASHED).glob("[!.]*.json")))
    os.kill(os.getpid(), signal.SIGKILL)


def recover(robot: Robot, out: Path) -> None:
    """What the crashed editor held is offered, and there again."""
    workspace = robot.app.state.workspace
    assert not workspace.scene.lights
    robot.click("recover")
    robot.wait("The recovered lamp", lambda: len(workspace.scene.lights) == 1)
    assert workspace.unsaved, "it is still to be saved"


def seen(robot: Robot, number: int) -> tuple[float, float]:
    """px on the screen, in the middle of the triangle of a body that is largest in the overview."""
    view, body = robot.app.viewport, robot.app.state.workspace.scene.bodies[number]
    points = body.mesh.vertices @ body.world_from_body[:3, :3].T + body.world_from_body[:3, 3]
    triangles = view.camera.project(points)[body.mesh.faces]
    (ax, ay), (bx, by) = (np.moveaxis(triangles[:, k] - triangles[:, 0], -1, 0) for k in (1, 2))
    x, y = (
        triangles[np.argmax(ay * bx - ax * by)].mean(axis=0) + view.origin
    )  # counter-clockwise: turned to us
    return float(x), float(y)


def pictures(robot: Robot, assets: Path, out: Path) -> None:
    """The pictures of docs/editor.md: the demo's station, looked at, edited and path-traced."""
    from composer.demo.station import station
    from interchange.formats.document import Document
    from interchange.formats.usd_author import author_scene

    app = robot.app
    frames = [
        replace(scene, cameras=tuple(replace(c, t_exp=4.0) for c in scene.cameras))
        for scene in station(assets)
    ]
    file = out / "station.usda"
    Document(author_scene(frames[0], frames=frames[1:]), file).save(file)
    robot.key("ctrl+o")
    robot.rect("dialog name")
    robot.type(str(file))
    robot.key("Return")
    workspace = app.state.workspace
    robot.wait("The station", lambda: len(workspace.scene.cameras) == 2)
    x0, y0, x1, y1 = robot.rect("viewport")
    robot.click("library find")
    robot.key("ctrl+a")
    robot.key("BackSpace")
    robot.move(*robot.middle("tree /World/Part"))
    robot.scroll(-12)
    robot.click("tree /World/Oblique")
    robot.move((x0 + x1) / 2, (y0 + y1) / 2)
    robot.key("Home")
    robot.scroll(3)
    rest(robot)
    robot.picture(out / "editor.png")

    robot.move(*robot.middle("tree /World/Oblique"))
    robot.scroll(12)
    robot.click("tree /World/Part")
    robot.move((x0 + x1) / 2, (y0 + y1) / 2)
    robot.key("f")
    robot.key("g")
    for key in ("z", "2", "0"):
        robot.key(key)
    rest(robot)
    robot.picture(out / "editor_moving.png")
    robot.key("Escape")

    robot.click("lamps")
    app.views[0].samples = 16
    robot.click("offline 0")
    robot.wait("Path tracing", lambda: app.state.job is not None)
    robot.wait("The path-traced image", lambda: app.state.job is not None and not app.state.job.running)
    assert app.state.job is not None
    assert not app.state.job.error, app.state.job.error
    robot.click("radiance 1")
    rest(robot)
    left, top, right, bottom = robot.rect("camera 1")
    robot.move(left + 0.45 * (right - left), top + 0.5 * (bottom - top))
    robot.picture(out / "editor_offline.png")


def rest(robot: Robot) -> None:
    """Until every picture is made in full."""
    robot.frames(3)
    robot.wait("The balls", lambda: robot.app.library.waiting is None)
    robot.wait("The views", lambda: robot.app.state.quiet and all(v.full for v in robot.app.views if v.shown))
    robot.frames(3)


def drive(assets: Path, out: Path, scene: str) -> int:
    """Open the window on this screen, take the steps of ``scene`` (SCENES), close it."""
    out.mkdir(parents=True, exist_ok=True)
    autosave = Autosave(out / (CRASHED if scene in ("crash", "recover") else "autosave"))
    app = window.App(Workspace(autosave), rests=False)
    failed: list[str] = []

    def run() -> None:
        robot = Robot(app)
        try:
            robot.wait("The window", lambda: app.frames > 5)
            match scene:
                case "pictures":
                    robot.patience = 600.0
                    pictures(robot, assets.resolve(), out.resolve())
                case "steps":
                    steps(robot, (assets / PART).resolve(), out.resolve())
                case "crash":
                    crash(robot, out)
                case _:
                    recover(robot, out)
        except Exception:  # told at the end, by the main thread
            failed.append(traceback.format_exc())
            robot.picture(out / "failed.png")
        app.state.quit = True

    threading.Thread(target=run, name="robot", daemon=True).start()
    app.run(LARGE if scene == "pictures" else SMALL)
    for text in failed:
        print(text, file=sys.stderr)
    return 1 if failed else 0


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "--assets", type=Path, default=Path("assets"), help="the folder with cad/featuretype.STEP"
    )
    parser.add_argument("--out", type=Path, required=True, help="folder of the scene and the pictures")
    parser.add_argument("--pictures", action="store_true", help="make the pictures of docs/editor.md")
    parser.add_argument("--here", choices=SCENES, help="take these steps, on the screen that is there")
    args = parser.parse_args()
    if args.here:
        return drive(args.assets, args.out, args.here)
    if missing():
        raise BrightfieldError(f"The tour needs {' and '.join(missing())}: apt install xvfb xdotool.")
    began = time.perf_counter()
    failed = False
    with screen(*(LARGE if args.pictures else SMALL)) as display:
        for scene in ("pictures",) if args.pictures else ("steps", "crash", "recover"):
            words = [sys.executable, "-m", "composer.editor.tour", *sys.argv[1:], "--here", scene]
            status = subprocess.run(words, env={**os.environ, "DISPLAY": display}).returncode
            failed = failed or status != (-signal.SIGKILL if scene == "crash" else 0)
    print(f"{'failed' if failed else 'done'} in {time.perf_counter() - began:.0f} s")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
