"""A camera of the scene that is being edited, streamed as `brightfield stream` does: each edit is in the next frame.

    live = LiveCamera(workspace, "Top", ("mjpeg", "shm"))
    for line in live.start():  # where it is found
        print(line)
    workspace.do("place path=/World/Part position=[0,0,0.1]")  # undo, redo and another time code are seen, too
    live.stop()

Exposure time, gain and frame rate follow the document where an edit changes them; what a client sets holds until then.
"""

from collections.abc import Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING

from composer.editor.workspace import Workspace
from interchange.camera import Camera
from interchange.problems import BrightfieldError
from interchange.scene import Scene

if TYPE_CHECKING:
    from realtime.virtual_camera.camera import VirtualCamera
    from realtime.virtual_camera.moving_scene import MovingScene


class LiveCamera:
    """``camera``: its prim, or the last part of it. ``kinds``: transports, the first of which is at ``port`` (None: the
    one that its clients expect, 0: a free one). Frames are drawn and served in threads of their own."""

    def __init__(
        self,
        workspace: Workspace,
        camera: str,
        kinds: Sequence[str] = ("mjpeg",),
        address: str = "127.0.0.1",
        port: int | None = None,
        samples: int = 4,
    ) -> None:
        self.workspace, self.kinds, self.address, self.port = workspace, tuple(kinds), address, port
        self.samples = samples
        self.name = workspace.scene.camera(camera).name
        self.lines: list[str] = []  # where it is found; empty while it is not served
        self.problem = ""  # why it ended by itself
        self._stack = ExitStack()
        self._record: Camera | None = None
        self._scene: MovingScene | None = None
        self._camera: VirtualCamera | None = None

    def start(self) -> list[str]:
        """Compile, then serve; the lines that say where. BrightfieldError where it cannot be."""
        from realtime.virtual_camera.camera import VirtualCamera
        from realtime.virtual_camera.moving_scene import MovingScene
        from realtime.virtual_camera.publisher import Publisher
        from realtime.virtual_camera.transports import transport

        scene = self.workspace.scene
        self._record = scene.camera(self.name)
        with ExitStack() as stack:
            self._scene = MovingScene(scene, live=True)
            self._camera = VirtualCamera(self._scene, self.name, samples=self.samples)
            publisher = stack.enter_context(Publisher(self._camera))
            self._camera.prepare()  # an error of the scene is told before anything is served
            serving = [
                kind([publisher], self.address, kind.port)
                for kind in map(transport, dict.fromkeys(self.kinds))
            ]
            if self.port is not None:
                serving[0].asked_port = self.port
            lines = []
            for one in serving:
                stack.callback(one.stop)
                lines += one.start()
            publisher.start()
            self._publisher = publisher
            self.workspace.watchers.append(self.show)
            stack.callback(self.workspace.watchers.remove, self.show)
            self._stack = stack.pop_all()
        self.lines, self.problem = lines, ""
        return lines

    def show(self, scene: Scene) -> None:
        """From the next exposure on. The stream ends, and ``problem`` says why, where the scene has its camera no more,
        or its sensor is another one: clients were told of the old one."""
        if not self.lines or self._scene is None or self._camera is None or self._record is None:
            return
        error = self._publisher.error
        record = next((c for c in scene.cameras if c.name == self.name), None)
        if error is not None:
            self._end(str(error))
        elif record is None:
            self._end(f"The stream has ended: the scene has no camera {self.name} any more.")
        elif _format(record) != _format(self._record):
            self._end(f"The stream has ended: the sensor of {self.name} is another one; start it again.")
        else:
            self._follow(self._record, record)
            self._scene.show(scene)

    def _follow(self, before: Camera, now: Camera) -> None:
        assert self._camera is not None
        pairs = {
            "t_exp": (before.t_exp, now.t_exp),
            "gain_dB": (before.sensor.gain_dB, now.sensor.gain_dB),
            "frame_rate": (before.sensor.frame_rate or 30.0, now.sensor.frame_rate or 30.0),
        }
        changed = {name: new for name, (old, new) in pairs.items() if new != old}
        self._record = now
        if changed:
            try:
                self._camera.configure(**changed)
            except BrightfieldError as error:  # such as an exposure time of 0, which a scene may have
                self._end(str(error))

    def _end(self, why: str) -> None:
        self.stop()
        self.problem = why

    def stop(self) -> None:
        """Clients are let go. May be called twice."""
        self.lines = []
        self._stack.close()

    def __enter__(self) -> "LiveCamera":
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()


def _format(camera: Camera) -> object:
    sensor = camera.sensor
    return sensor.resolution, sensor.bits_out, sensor.mosaic
