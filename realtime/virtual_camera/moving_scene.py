"""A scene in motion: what it is at a given second, by its time line, its joints and belts, and who moved what last.

Cameras that look at the same scene share one ``MovingScene``; what one consumer moves, all of them see.
"""

import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from interchange.camera import Camera
from interchange.problems import BrightfieldError, did_you_mean
from interchange.scene import Body, Scene
from realtime.virtual_camera.joint import Conveyor, Joint, moves


@dataclass(frozen=True)
class TimeLine:
    """Time code at s: ``first`` + s ``per_second``; from ``last`` on it starts again if ``loop``, else it stays.

    ``scene_at`` gives the scene at a time code, ``Document.scene`` for one.
    """

    scene_at: Callable[[float], Scene]
    first: float = 0.0
    last: float = 0.0
    per_second: float = 24.0
    loop: bool = True

    def code(self, seconds: float) -> float:
        if not self.last > self.first:
            return self.first
        run = seconds * self.per_second
        length = self.last - self.first
        return self.first + (run % length if self.loop else min(max(run, 0.0), length))

    def near(self, seconds: float, more: float) -> float:
        """Time code ``more`` s later or earlier, in the same lap: nothing is seen to jump from the end to the start."""
        code = self.code(seconds) + more * self.per_second
        return min(max(code, self.first), max(self.last, self.first))


@dataclass(frozen=True, eq=False)
class Moment:
    """The scene at ``seconds`` since the start, by which its strobes go too, and what its joints (rad, m), belts (m)
    and encoders showed. ``near(s)``: the scene s later or earlier, by the time line and the belts, which move while
    the shutter is open; what someone sets, jumps. None where nothing moves by itself."""

    scene: Scene
    seconds: float
    joints: dict[str, float] = field(default_factory=dict)
    belts: dict[str, float] = field(default_factory=dict)
    encoders: dict[str, int] = field(default_factory=dict)
    near: Callable[[float], Scene] | None = None


KEPT = 16  # moments


class MovingScene:
    """``source``: a scene that stands still, or a time line. ``live``: time passes by the clock on the wall; else by
    the frames that are taken. Every method may be called from any thread; what is set holds from the next exposure
    on."""

    def __init__(
        self,
        source: Scene | TimeLine,
        joints: Sequence[Joint] = (),
        conveyors: Sequence[Conveyor] = (),
        live: bool = False,
    ) -> None:
        self.live = live
        self.timeline = source if isinstance(source, TimeLine) else TimeLine(lambda _: source)
        self._lock, self._asking = threading.Lock(), threading.Lock()
        self._moments: OrderedDict[float, Moment] = OrderedDict()
        self._began, self._shown = time.monotonic(), 0.0
        self._latest: tuple[float, Scene] | None = None
        first = self._scene(self.timeline.first)
        self._names = {b.name for b in first.bodies}
        self._cameras = {c.name for c in first.cameras}
        movers: list[Joint | Conveyor] = [*joints, *conveyors]
        names = [m.name for m in movers]
        if len(set(names)) < len(names):
            raise BrightfieldError(f"Joints and conveyors need a name each; got {', '.join(names)}.")
        movable = self._names | self._cameras
        for mover in movers:
            for body in mover.bodies:
                if not any(moves((body,), name) for name in movable):
                    hint = did_you_mean(body, movable)
                    raise BrightfieldError(
                        f'{mover.name} moves "{body}", which the scene does not have.{hint}'
                    )
        self._joints = {j.name: j for j in joints}
        self._q = {j.name: 0.0 for j in joints}
        self._belts = {c.name: c for c in conveyors}
        self._poses: dict[str, np.ndarray] = {}
        self._camera_poses: dict[str, np.ndarray] = {}

    def elapsed(self) -> float:
        """s since the start; of a scene that is not live, up to the latest frame."""
        return time.monotonic() - self._began if self.live else self._shown

    def at(self, seconds: float) -> Moment:
        """What is there at ``seconds``. While it is live, all who ask for one of the latest times get the same
        moment, whatever was moved in between: two cameras of one exposure see one scene."""
        if not self.live:
            return self._moment(seconds)
        with self._asking:
            if seconds not in self._moments:
                self._moments[seconds] = self._moment(seconds)
                while len(self._moments) > KEPT:
                    self._moments.popitem(last=False)
            return self._moments[seconds]

    def _moment(self, seconds: float) -> Moment:
        with self._lock:
            timeline = self.timeline
            scene = self._scene(timeline.code(seconds))
            poses, cameras = dict(self._poses), dict(self._camera_poses)
            joints, belts = dict(self._q), dict(self._belts)
            self._shown = max(self._shown, seconds)
        turned = [(self._joints[n].bodies, self._joints[n].displacement(q)) for n, q in joints.items() if q]

        def placed(scene: Scene, more: float = 0.0) -> Scene:
            moved = [(c.bodies, c.displacement(seconds, more)) for c in belts.values()] + turned
            if moved or poses or cameras:
                scene = replace(
                    scene,
                    bodies=tuple(_body_placed(b, poses, moved) for b in scene.bodies),
                    cameras=tuple(_camera_placed(c, cameras, moved) for c in scene.cameras),
                )
            return replace(scene, seconds=seconds) if any(x.strobe.is_there for x in scene.lights) else scene

        def near(more: float) -> Scene:
            with self._lock:  # a file is read by one at a time
                then = timeline.scene_at(timeline.near(seconds, more))
            return placed(then, more)

        moves_on = timeline.last > timeline.first or any(c.speed for c in belts.values())
        return Moment(
            placed(scene),
            seconds,
            joints,
            {n: c.position(seconds) for n, c in belts.items()},
            {n: c.pulses(seconds) for n, c in belts.items()},
            near if moves_on else None,
        )

    def change(
        self,
        bodies: Mapping[str, Any] | None = None,
        cameras: Mapping[str, Any] | None = None,
        joints: Mapping[str, float] | None = None,
        conveyors: Mapping[str, float] | None = None,
    ) -> None:
        """Move several things between two exposures, all or none: poses (4, 4) of bodies and of cameras (None: where
        the file has it), joints in rad or m, conveyors' speeds in m/s. BrightfieldError for what there is not, and
        for what is no pose or beyond a joint's bounds."""
        bodies, cameras, joints, conveyors = bodies or {}, cameras or {}, joints or {}, conveyors or {}
        for wanted, known, kind in (
            (bodies, self._names, "body"),
            (cameras, self._cameras, "camera"),
            (joints, self._joints, "joint"),
            (conveyors, self._belts, "conveyor"),
        ):
            for name in wanted:
                _check_known(name, known, kind)
        poses = {n: None if m is None else check_pose(m, n, rigid=False) for n, m in bodies.items()}
        standing = {n: None if m is None else check_pose(m, n, rigid=True) for n, m in cameras.items()}
        angles = {n: self._joints[n].checked(q) for n, q in joints.items()}
        with self._lock:
            since = self.elapsed()
            belts = {n: self._belts[n].at(v, since) for n, v in conveyors.items()}
            for kept, new in ((self._poses, poses), (self._camera_poses, standing)):
                kept.update({n: m for n, m in new.items() if m is not None})
                for n in [n for n, m in new.items() if m is None]:
                    kept.pop(n, None)
            self._q.update(angles)
            self._belts.update(belts)

    def show(self, scene: Scene) -> None:
        """Another scene in place of this one's source, from the next exposure on: an editor's after an edit. What
        was moved and is still there stays where it was put."""
        bodies, cameras = {b.name for b in scene.bodies}, {c.name for c in scene.cameras}
        with self._lock:
            self.timeline, self._latest = TimeLine(lambda _: scene), None
            self._names, self._cameras = bodies, cameras
            self._poses = {n: m for n, m in self._poses.items() if n in bodies}
            self._camera_poses = {n: m for n, m in self._camera_poses.items() if n in cameras}

    def set_body_pose(self, name: str, world_from_body: Any) -> None:
        """Put a body (4, 4) where it stays until it is moved again; joints and belts move it from there."""
        self.change(bodies={name: world_from_body})

    def set_camera_pose(self, name: str, world_from_camera: Any) -> None:
        """Put a camera (4, 4), rigid."""
        self.change(cameras={name: world_from_camera})

    def set_joint(self, name: str, q: float) -> None:
        """rad or m."""
        self.change(joints={name: q})

    def run(self, conveyor: str, speed: float) -> None:
        """m/s from ``elapsed`` on."""
        self.change(conveyors={conveyor: speed})

    def _scene(self, code: float) -> Scene:
        if self._latest is None or self._latest[0] != code:
            self._latest = code, self.timeline.scene_at(code)
        return self._latest[1]


def _check_known(name: str, known: Iterable[str], kind: str) -> None:
    names = sorted(known)
    if name not in names:
        there = f" There are {', '.join(names[:20])}." if names else " There is none."
        raise BrightfieldError(f'No {kind} is called "{name}".{did_you_mean(name, names)}{there}')


def check_pose(pose: Any, name: str, rigid: bool) -> np.ndarray:
    """A copy (4, 4) that nobody else holds. BrightfieldError where it is no pose."""
    try:
        m = np.array(pose, np.float64)
    except (TypeError, ValueError):
        m = np.full(0, np.nan)
    if m.shape != (4, 4) or not np.isfinite(m).all() or not np.array_equal(m[3], [0, 0, 0, 1]):
        raise BrightfieldError(f"A pose must be a finite (4, 4) matrix with last row 0 0 0 1. ({name})")
    R = m[:3, :3]
    if rigid and not (np.allclose(R @ R.T, np.eye(3), atol=1e-6) and np.linalg.det(R) > 0):
        raise BrightfieldError(f"A camera's pose must be rigid: a rotation and a shift. ({name})")
    if abs(np.linalg.det(R)) < 1e-300:
        raise BrightfieldError(f"A body's pose must not be flat; its determinant is 0. ({name})")
    m.setflags(write=False)
    return m


Moved = list[tuple[tuple[str, ...], np.ndarray]]


def _body_placed(body: Body, poses: dict[str, np.ndarray], moved: Moved) -> Body:
    pose = _moved(poses.get(body.name, body.world_from_body), body.name, moved)
    return body if pose is body.world_from_body else replace(body, world_from_body=pose)


def _camera_placed(camera: Camera, poses: dict[str, np.ndarray], moved: Moved) -> Camera:
    """A joint that names a camera carries it: an eye in the hand."""
    pose = _moved(poses.get(camera.name, camera.world_from_camera), camera.name, moved)
    return camera if pose is camera.world_from_camera else replace(camera, world_from_camera=pose)


def _moved(pose: np.ndarray, name: str, moved: Moved) -> np.ndarray:
    for bodies, displacement in reversed(moved):
        if moves(bodies, name):
            pose = displacement @ pose
    return pose
