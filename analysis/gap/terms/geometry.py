"""Terms that move the image: cameras, lenses, objects.

A point X of the camera's frame, at pixel (u, v), moves by δX = τ + ω × X; a lens moves normalised coordinates by
Brown's model.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import cv2
import numpy as np

from analysis.gap.compared import lens_flow
from analysis.gap.compared.conditions import Condition
from analysis.gap.compared.state import State
from analysis.gap.light.radiance import Rendered
from analysis.gap.terms.base import NUISANCE, Flow, Term, moving
from analysis.gap.terms.camera import of_all, of_one, several
from analysis.gap.terms.mounts import ALL, CREEPING
from interchange.camera import Projection
from interchange.captures import Tolerances
from interchange.effects.parts import bounds

Way = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
EACH = 0.6  # of the registration's tolerance: turns, shifts, the principal point and what undoes itself add up to it
MOST_ASIDE = 5.0  # mm, of a camera over a flat scene
STEEP, EDGES = 0.05, 1e-3  # of the light a px; share of the image
ZONE = 0.6**1.5 * 0.4  # the most of ρ³ - ρ⁵
# thickness over length of what is printed on something: it lies there, and has no size of its own
FLAT = 0.02
CONVENTION = 0.5  # of a principal point's tolerance: what all cameras' are off by alike
DECENTRED = 0.3  # of a lens's distortion: its elements stand nearly on one axis
CREEPS_IN = 4  # conditions of a camera, from which on that is told from what each of them shows
LEAST_OUTLINE = 30  # px of an object's outline in view, for the same
LEAST_PIXELS = 200  # that an object must cover to have a pose of its own


def geometry_terms(conditions: Sequence[Condition], tolerances: Tolerances) -> list[Term]:
    terms: list[Term] = []
    px = EACH * tolerances.registration_px
    for name in dict.fromkeys(stand(c) for c in conditions):
        terms += _pose(name, next(c for c in conditions if stand(c) == name), px)
    terms += _principal_points(conditions, px)
    lens = _lens(conditions[0], px)
    terms += of_all(lens) if several(conditions) else lens
    for name in dict.fromkeys(c.camera.name for c in conditions):
        first = next(c for c in conditions if c.camera.name == name)
        terms += of_one(_lens(first, px), name) if several(conditions) else []
        terms += _undone(name, _farthest(first), px)
        terms += _creeping(name, conditions, tolerances.registration_px)
    terms += _read_out(conditions, px)
    if not any(has_edges(c) for c in conditions):
        terms = [replace(t, cause=NUISANCE) for t in terms]
    return terms


def _principal_points(conditions: Sequence[Condition], px: float) -> list[Term]:
    """Of each camera, and of all alike: where a pixel's middle lies is a convention."""
    terms = []
    cameras = dict.fromkeys(c.camera.name for c in conditions)
    for name in [ALL, *cameras] if len(cameras) > 1 else cameras:
        for axis, parameter in enumerate(("cx", "cy")):

            def flow(s: State, name: str = name, axis: int = axis) -> tuple[np.ndarray, np.ndarray] | None:
                if name not in (ALL, s.camera.name):
                    return None
                one, nothing = np.ones(s.grid[0].shape), np.zeros(s.grid[0].shape)
                return (one, nothing) if axis == 0 else (nothing, one)

            term = moving("principal_point", name, parameter, "px", px, flow)
            terms.append(replace(term, form=True, spike=CONVENTION * px) if name == ALL else term)
    return terms


def has_edges(condition: Condition) -> bool:
    """Whether anything in the image tells a motion: where light varies smoothly, a motion by many pixels would look
    as any uneven lamp does."""
    model = condition.simulated()
    signal = np.ascontiguousarray(np.maximum(model.dn - model.black, 0).mean(axis=2), np.float32)
    dy, dx = np.gradient(signal)
    around = cv2.blur(signal, (3, 3))
    return bool((np.hypot(dx, dy) > STEEP * around + 1e-9).mean() > EDGES)


def stand(condition: Condition) -> str:
    """A camera where it stands: the same name at another pose is registered anew."""
    pose = np.round(condition.camera.world_from_camera[:3, 3] * 1e3, 1)
    return f"{condition.camera.name} at ({pose[0]:g}, {pose[1]:g}, {pose[2]:g}) mm"


def _projected(state: State, delta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """px that points of ``state`` move by where they move by ``delta`` (h, w, 3) m in the camera's frame."""
    X, K = state.in_camera, state.camera.K.astype(np.float32)
    if state.camera.lens.projection is Projection.ORTHOGRAPHIC:
        return K[0, 0] * delta[..., 0], K[1, 1] * delta[..., 1]
    z = np.maximum(X[..., 2], 1e-6)
    du = K[0, 0] * (delta[..., 0] - X[..., 0] / z * delta[..., 2]) / z
    dv = K[1, 1] * (delta[..., 1] - X[..., 1] / z * delta[..., 2]) / z
    return du, dv


def _pose(name: str, condition: Condition, px: float) -> list[Term]:
    depth = condition.shown.passes["depth"]
    z = float(np.median(depth[np.isfinite(depth)])) if np.isfinite(depth).any() else 1.0
    f = condition.camera.K[0, 0]
    near = f if condition.camera.lens.projection is Projection.ORTHOGRAPHIC else f / z
    terms = []
    for axis in range(3):
        unit = np.eye(3, dtype=np.float32)[axis]

        def shift(s: State, unit: np.ndarray = unit) -> tuple[np.ndarray, np.ndarray] | None:
            return (
                _projected(s, np.broadcast_to(np.float32(1e-3) * unit, s.in_camera.shape))
                if stand(s.condition) == name
                else None
            )

        def turn(s: State, unit: np.ndarray = unit) -> tuple[np.ndarray, np.ndarray] | None:
            return (
                _projected(s, np.float32(1e-3) * np.cross(unit, s.in_camera))
                if stand(s.condition) == name
                else None
            )

        reach = _farthest(condition) if axis == 2 else 1.0
        tau = px / (1e-3 * near * (reach if axis == 2 else 1.0)) / np.sqrt(3)
        omega = px / (1e-3 * f * reach) / np.sqrt(3)
        terms.append(moving("camera_pose", name, f"t{'xyz'[axis]}", "mm", tau, shift))
        terms.append(moving("camera_pose", name, f"r{'xyz'[axis]}", "mrad", omega, turn))
    if condition.camera.lens.projection is not Projection.ORTHOGRAPHIC:
        terms += _parallax(name, depth[np.isfinite(depth)], z, f, px)
    return terms


def _creeping(name: str, conditions: Sequence[Condition], px: float) -> list[Term]:
    """A camera whose mount gives way while it captures: it turns by as much from each condition to the next, ``px`` as
    expected from the first to the last. Between repeats nothing is touched, so that they are taken as alike. Linear
    where the image stands: conditions that share a rendering share what moves it, too."""
    own = [c for c in conditions if c.camera.name == name]
    if len({c.when for c in own}) < CREEPS_IN:
        return []
    terms = []
    for axis in range(2):
        unit = np.eye(3, dtype=np.float32)[axis]

        def field(s: State, unit: np.ndarray = unit) -> np.ndarray | None:
            if s.camera.name != name:
                return None
            du, dv = _projected(s, np.float32(1e-3) * np.cross(unit, s.in_camera))
            since = np.float32(s.condition.when - 0.5)
            return s.shifted(since * du, since * dv)

        word = f"turn about {'xy'[axis]} from first to last capture"
        spike = px / (1e-3 * own[0].camera.K[0, 0])
        # a shift of all of its captures beside it is the camera's, too
        against = ("principal_point",)
        terms.append(Term("camera_pose", name + CREEPING, word, "mrad", spike, field, against=against))
    return terms


def _parallax(name: str, depth: np.ndarray, z: float, f: float, px: float) -> list[Term]:
    """A camera that stands aside and turns back by as much: calibration tells the two apart only by how points at other
    depths than ``z`` move, f (1/Z - 1/z) per metre. No cause: the tolerance of what a pose leaves in the image."""
    spread = 1e-3 * f * float(np.std(1 / depth)) if len(depth) else 0.0
    terms = []
    for axis in range(2):
        aside = (1e-3 * np.eye(3)[axis]).astype(np.float32)
        back = np.array([[0.0, -1e-3 / z, 0.0], [1e-3 / z, 0.0, 0.0]][axis], np.float32)

        def flow(
            s: State, aside: np.ndarray = aside, back: np.ndarray = back
        ) -> tuple[np.ndarray, np.ndarray] | None:
            if stand(s.condition) != name:
                return None
            return _projected(s, aside + np.cross(back, s.in_camera))

        spike = px / max(spread, px / MOST_ASIDE) / np.sqrt(3)
        terms.append(moving(NUISANCE, name, f"aside {'xy'[axis]}", "mm", spike, flow))
    return terms


def _farthest(condition: Condition) -> float:
    """Of the image's corners, from the axis, which need not pass through its middle; over the focal length."""
    K, sizes = condition.camera.K, condition.camera.sensor.resolution
    away = [max(K[k, 2] + 0.5, n - K[k, 2] - 0.5) / K[k, k] for k, n in enumerate(sizes)]
    return float(np.hypot(*away))


def _lens(condition: Condition, px: float) -> list[Term]:
    K, corner = condition.camera.K, _farthest(condition)

    cause = lens_flow.CAUSE if lens_flow.has_numbers(condition.camera) else NUISANCE

    def flow(number: int) -> Flow:
        def moved(s: State) -> tuple[np.ndarray, np.ndarray] | None:
            if cause == lens_flow.CAUSE and not lens_flow.has_numbers(s.camera):
                return None
            return lens_flow.unit_flow(s, number)

        return moved

    order, part = (3, 5, 2, 2), (1.0, 1.0, DECENTRED, DECENTRED)
    return [
        replace(
            moving(cause, "", name, "1", px / (K[0, 0] * corner ** order[i]), flow(i)),
            part=part[i],
        )
        for i, name in enumerate(lens_flow.NUMBERS)
    ]


def _undone(name: str, corner: float, px: float) -> list[Term]:
    """What calibration leaves where numbers undo each other, each of which alone would have to be many times as far off
    as it leaves them; no cause. ρ is 1 in the corner.

    k1 and k2, between the middle and the corner: radially by ρ³ - ρ⁵, at most 1. A turn of the camera and the principal
    point: (x², x y) and (x y, y²). A place along the axis and the focal length: (x, y) at every depth. Both focal
    lengths: (x, -y), and the angle between rows and columns: (y, x).
    """

    def radial(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        r2 = x * x + y * y
        by = r2 * (1 - r2) / ZONE
        return x * by, y * by

    ways = {
        "zone of the lens": radial,
        "turn against the principal point, x": lambda x, y: (x * x, x * y),
        "turn against the principal point, y": lambda x, y: (x * y, y * y),
        "focal length": lambda x, y: (x, y),
        "aspect": lambda x, y: (x, -y),
        "skew": lambda x, y: (y, x),
    }
    terms = []
    for word, way in ways.items():

        def flow(s: State, way: Way = way) -> tuple[np.ndarray, np.ndarray] | None:
            if s.camera.name != name:
                return None
            K = s.camera.K
            return way((s.grid[0] - K[0, 2]) / K[0, 0] / corner, (s.grid[1] - K[1, 2]) / K[1, 1] / corner)

        terms.append(moving(NUISANCE, name, word, "px", px, flow))
    return terms


def _read_out(conditions: Sequence[Condition], px: float) -> list[Term]:
    """px that a row is off from the one above, the same at every exposure time, other than motion blur. Where the scene
    gives a line time the chain's own terms say it as a velocity."""
    if any(c.camera.sensor.line_time for c in conditions):
        return []
    terms = []
    for axis, parameter in enumerate(("u", "v")):

        def flow(s: State, axis: int = axis) -> tuple[np.ndarray, np.ndarray]:
            late, nothing = s.grid[1].astype(np.float64), np.zeros(s.grid[1].shape)
            return (late, nothing) if axis == 0 else (nothing, late)

        spike = px / conditions[0].camera.sensor.resolution[1]
        terms.append(moving("rolling_shutter", "", parameter, "px/row", spike, flow))
    return terms


def _spin(name: str) -> Flow:
    """About the vertical through the middle of the object's box."""

    def flow(s: State) -> tuple[np.ndarray, np.ndarray] | None:
        names = s.shown.scene.object_names
        if name not in names:
            return None
        arm = s.position - bounds(s.shown.scene, name).mean(axis=0)
        delta = 1e-3 * np.stack([-arm[..., 1], arm[..., 0], np.zeros(arm.shape[:2])], axis=-1)
        du, dv = _projected(s, delta @ s.camera.camera_from_world[:3, :3].T)
        mask = s.take(s.shown.passes["object_id"]) == names.index(name)
        return du * mask, dv * mask

    return flow


def outlines(conditions: Sequence[Condition]) -> dict[str, int]:
    """Objects that end within an image, and by how many pixels, the most of any: where one does not, only its shading
    could be seen to move, and that is the lamps'."""
    found: dict[str, int] = {}
    for shown in _arrangements(conditions):
        names = shown.scene.object_names
        for name, count in shown.pixels_of["object_id"].items():
            mask = (shown.passes["object_id"] == names.index(name)).astype(np.uint8)
            ends = count - int(cv2.erode(mask, np.ones((3, 3)), borderType=cv2.BORDER_REPLICATE).sum())
            if ends >= LEAST_OUTLINE:
                found[name] = max(found.get(name, 0), ends)
    return found


def _arrangements(conditions: Sequence[Condition]) -> list[Rendered]:
    return list({id(c.shown): c.shown for c in conditions}.values())


def moved_objects(
    conditions: Sequence[Condition], tolerances: Tolerances, besides: Sequence[str] = ()
) -> list[Term]:
    """The places of objects (``besides`` some) without any rendering: what is seen of them moves, shadows stay. What is
    flat does not rise: cameras on one side would hardly tell that from a shift."""
    counts: dict[str, int] = {}
    for shown in _arrangements(conditions):
        for name, n in shown.pixels_of["object_id"].items():
            counts[name] = max(counts.get(name, 0), n)
    terms = []
    for name in (n for n in outlines(conditions) if counts[n] >= LEAST_PIXELS and n not in besides):
        box = next(bounds(c.shown.scene, name) for c in conditions if name in c.shown.scene.object_names)
        size = np.ptp(box, axis=0)
        for axis in range(2 if size[2] < FLAT * size.max() else 3):

            def flow(s: State, name: str = name, axis: int = axis) -> tuple[np.ndarray, np.ndarray] | None:
                names = s.shown.scene.object_names
                if name not in names:
                    return None
                mask = s.take(s.shown.passes["object_id"]) == names.index(name)
                delta = (1e-3 * s.camera.camera_from_world[:3, axis]).astype(np.float32)
                du, dv = _projected(s, np.broadcast_to(delta, s.in_camera.shape))
                return du * mask, dv * mask

            terms.append(moving("object_pose", name, "xyz"[axis], "mm", tolerances.object_pose_mm, flow))
        reach = 1e3 * float(np.hypot(*size[:2])) / 2
        spin = moving("object_pose", name, "rz", "mrad", 1e3 * tolerances.object_pose_mm / reach, _spin(name))
        terms.append(spin)
    return terms
