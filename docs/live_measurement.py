"""Two live cameras measure a plate on a belt, through OpenCV alone; what they find against the truth of the frame.

    python docs/live_measurement.py [--frames 90] [--fps 5] [--out docs/live_measurement.png]

Two cameras with distorting lenses stream over HTTP; this consumer finds the plate's corners in each picture to a part
of a pixel, triangulates them with the calibration that it was given, and measures centre, heading, length and width.
It steers too: the plate is turned by a joint while the belt carries it. Pairs of frames are those of one moment.
"""

import argparse
import json
import re
import threading
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from interchange.brdf.lambert import Lambert
from interchange.camera import Camera, Lens, Sensor
from interchange.frames import camera_from_gl, look_at
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.mesh import Mesh, from_corners
from interchange.scene import Body, Scene
from realtime.virtual_camera.camera import VirtualCamera
from realtime.virtual_camera.joint import Conveyor, Joint
from realtime.virtual_camera.moving_scene import MovingScene
from realtime.virtual_camera.publisher import Publisher
from realtime.virtual_camera.transports.mjpeg import Mjpeg

PLATE = "/World/Plate"
LENGTH, WIDTH = 0.060, 0.040  # m


def slab(x: float, y: float) -> Mesh:
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * [x / 2, y / 2, 0]
    return from_corners(corners, np.array([[0, 1, 2], [0, 2, 3]]))


def station() -> Scene:
    sensor = Sensor(
        (320, 240),
        (6.9e-6, 6.9e-6),
        responsivity=2.2e6,
        full_well=10_500,
        bit_depth=12,
        black_level=64,
        read_noise=7,
    )
    lens = Lens(8e-3, distortion=(-0.12, 0.03, 1e-3, -5e-4))
    cameras = tuple(
        Camera(f"/World/{name}", look_at(np.array([x, -0.12, 0.35]), np.zeros(3)), lens, sensor, t_exp=2e-3)
        for name, x in (("Left", -0.15), ("Right", 0.15))
    )
    below = np.eye(4)
    below[2, 3] = -0.02
    bodies = (
        Body("/World/Belt", slab(2, 2), Material("rubber", Lambert((0.05,) * 3)), below),
        Body(PLATE, slab(LENGTH, WIDTH), Material("paint", Lambert((0.8,) * 3))),
    )
    lamps = tuple(
        Light(
            f"/World/Lamp{k}",
            LightKind.SPHERE,
            (0.35,) * 3,
            look_at(np.array(at), np.zeros(3)) @ camera_from_gl,
        )
        for k, at in enumerate(((-0.3, 0.2, 0.5), (0.3, 0.2, 0.5)))
    )
    return Scene(bodies, lamps, cameras)


def frames(url: str) -> Iterator[tuple[int, np.ndarray]]:
    """Numbers and pictures of a Motion JPEG stream. ``cv2.VideoCapture`` reads it too, but tells no number."""
    with urllib.request.urlopen(url, timeout=60) as stream:
        while (line := stream.readline().strip()).startswith(b"--") and not line.endswith(b"--"):
            headers = {}
            while line := stream.readline().strip():
                name, _, value = line.decode().partition(": ")
                headers[name] = value
            data = np.frombuffer(stream.read(int(headers["Content-Length"])), np.uint8)
            stream.readline()
            yield int(headers["X-Frame-Number"]), cv2.imdecode(data, cv2.IMREAD_GRAYSCALE)


def corners(picture: np.ndarray) -> np.ndarray | None:
    """(4, 2) px, counter-clockwise; each the meeting of two lines fitted to points on the edges of the plate."""
    smooth = cv2.GaussianBlur(picture, (0, 0), 1.0)
    _, mask = cv2.threshold(smooth, 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
    outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    outline = max(outlines, key=cv2.contourArea, default=None)
    if outline is None or cv2.contourArea(outline) < 400:
        return None
    rough = cv2.approxPolyDP(outline, 0.05 * cv2.arcLength(outline, True), True)[:, 0].astype(float)
    height, width = picture.shape
    if len(rough) != 4 or (rough < 3).any() or (rough > [width - 4, height - 4]).any():
        return None
    if np.cross(rough[1] - rough[0], rough[2] - rough[0]) > 0:
        rough = rough[::-1]
    lines = [edge(smooth.astype(np.float32), rough[k], rough[(k + 1) % 4]) for k in range(4)]
    met = [np.cross(lines[k - 1], lines[k]) for k in range(4)]
    return np.array([p[:2] / p[2] for p in met])


def edge(picture: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The line (a, b, c) through the places, across the way from a to b, at which the picture is half way between
    what lies on both sides there."""
    along = (b - a) / np.linalg.norm(b - a)
    across = np.array([-along[1], along[0]])
    share = np.linspace(0.15, 0.85, 40)[:, None, None]
    steps = np.arange(-4, 4.01, 0.25)
    places = (a + share * (b - a)) + steps[None, :, None] * across
    values = cv2.remap(
        picture, places[..., 0].astype(np.float32), places[..., 1].astype(np.float32), cv2.INTER_LINEAR
    )
    values -= (values[:, :1] + values[:, -1:]) / 2
    found = []
    for k, row in enumerate(values):
        change = np.flatnonzero((row[1:] > 0) != (row[:-1] > 0))
        if len(change) == 1:
            i = change[0]
            place = steps[i] + 0.25 * row[i] / (row[i] - row[i + 1])
            found.append(a + share[k, 0] * (b - a) + place * across)
    vx, vy, x, y = cv2.fitLine(np.array(found, np.float32), cv2.DIST_HUBER, 0, 0.01, 0.01).ravel()
    return np.array([vy, -vx, vx * y - vy * x])


def measured(pictures: list[np.ndarray], truths: list[dict]) -> dict[str, float] | None:
    """Of the plate, in mm and degrees; the truths give the calibration alone."""
    found = [corners(p) for p in pictures]
    if any(f is None for f in found):
        return None
    rays, projections = [], []
    for pixels, truth in zip(found, truths, strict=True):
        rays.append(
            cv2.undistortPoints(pixels[:, None], np.array(truth["K"]), np.array(truth["distortion"]))[:, 0]
        )
        projections.append(np.linalg.inv(np.array(truth["world_from_camera"]))[:3])
    best = None
    for turn in range(4):  # which corner is which: the one way in which the rays meet
        other = np.roll(rays[1], turn, axis=0)
        points = cv2.triangulatePoints(projections[0], projections[1], rays[0].T, other.T)
        points = (points[:3] / points[3]).T
        seen = (np.column_stack([points, np.ones(4)]) @ projections[1].T)[:, :]
        miss = np.abs(seen[:, :2] / seen[:, 2:] - other).max()
        if best is None or miss < best[0]:
            best = miss, points
    points = best[1]
    sides = np.roll(points, -1, axis=0) - points
    lengths = np.linalg.norm(sides, axis=1)
    first = int(lengths[1] > lengths[0])  # the long sides
    direction = sides[first] - sides[first + 2]
    return {
        "x": points[:, 0].mean() * 1e3,
        "y": points[:, 1].mean() * 1e3,
        "z": points[:, 2].mean() * 1e3,
        "heading": np.degrees(np.arctan2(direction[1], direction[0])) % 180,
        "length": lengths[first::2].mean() * 1e3,
        "width": lengths[1 - first :: 2].mean() * 1e3,
    }


def truly(truth: dict) -> dict[str, float]:
    pose = np.array(truth["bodies"][PLATE])
    x, y, z = pose[:3, 3] * 1e3
    heading = np.degrees(np.arctan2(pose[1, 0], pose[0, 0])) % 180
    return {"x": x, "y": y, "z": z, "heading": heading, "length": LENGTH * 1e3, "width": WIDTH * 1e3}


def watch(url: str, count: int, fps: float, moving: MovingScene) -> list[tuple[float, dict, dict]]:
    """(s, what is measured, what is so) of ``count`` pairs of frames."""
    latest: dict[str, dict[float, tuple[np.ndarray, dict]]] = {"Left": {}, "Right": {}}
    new, done = threading.Condition(), threading.Event()

    def read(name: str) -> None:
        for number, picture in frames(f"{url}/{name}.mjpg"):
            with urllib.request.urlopen(f"{url}/{name}/truth.json?number={number}", timeout=60) as answer:
                truth = json.load(answer)
            with new:
                latest[name][round(truth["seconds"] * fps)] = picture, truth
                new.notify_all()
            if done.is_set():
                return

    readers = [threading.Thread(target=read, args=(name,), daemon=True) for name in latest]
    for reader in readers:
        reader.start()
    rows: list[tuple[float, dict, dict]] = []

    def both() -> set[float]:
        return set(latest["Left"]) & set(latest["Right"])

    while len(rows) < count:
        with new:
            if not new.wait_for(both, 60):
                raise SystemExit("no pair of frames came within 60 s")
            moment = max(both())
            pairs = [latest[name].pop(moment) for name in latest]
            for kept in latest.values():
                for old in [k for k in kept if k < moment]:
                    del kept[old]
        found = measured([p for p, _ in pairs], [t for _, t in pairs])
        if found is not None:
            rows.append((pairs[0][1]["seconds"], found, truly(pairs[0][1])))
            moving.set_joint("turn", np.radians(3.0 * len(rows)))
    done.set()
    for reader in readers:  # each at its next frame
        reader.join()
    return rows


def plot(rows: list[tuple[float, dict, dict]], out: Path) -> None:
    from matplotlib.figure import Figure

    seconds = np.array([r[0] for r in rows]) - rows[0][0]
    figure = Figure(figsize=(9, 5.5), dpi=90, layout="constrained")
    place, error, heading, size = figure.subplots(2, 2).ravel()
    for name in "xyz":
        place.plot(seconds, [r[2][name] for r in rows], "-", lw=0.8, color="0.6")
        place.plot(seconds, [r[1][name] for r in rows], ".", ms=3, label=f"{name} measured")
        error.plot(seconds, [(r[1][name] - r[2][name]) * 1e3 for r in rows], ".-", ms=3, lw=0.5, label=name)
    off = [(r[1]["heading"] - r[2]["heading"] + 90) % 180 - 90 for r in rows]
    heading.plot(seconds, off, ".-", ms=3, lw=0.5, color="C3")
    for name in ("length", "width"):
        size.plot(seconds, [(r[1][name] - r[2][name]) * 1e3 for r in rows], ".-", ms=3, lw=0.5, label=name)
    for axes, title, unit in (
        (place, "centre (grey: truth)", "mm"), (error, "error of the centre", "µm"),
        (heading, "error of the heading", "degrees"), (size, "error of length and width", "µm"),
    ):  # fmt: skip
        axes.set_title(title, fontsize=10)
        axes.set_ylabel(unit, fontsize=8)
        axes.set_xlabel("s", fontsize=8)
        axes.tick_params(labelsize=7)
        axes.grid(alpha=0.3)
        if axes is not heading:
            axes.legend(fontsize=7)
    figure.savefig(out)


def main() -> None:
    parser = argparse.ArgumentParser(description=re.split(r"\n\n", __doc__)[0])
    parser.add_argument("--frames", type=int, default=90)
    parser.add_argument("--fps", type=float, default=5.0)
    parser.add_argument("--out", type=Path, default=Path("docs/live_measurement.png"))
    a = parser.parse_args()
    belt = Conveyor("belt", (PLATE,), (1, 0, 0), 0.02, 0.06, start=0.0)
    middle = np.eye(4)
    middle[0, 3] = -0.03  # so that the belt's 60 mm lie about the middle
    moving = MovingScene(station(), [Joint("turn", (PLATE,), (0, 0, 1), (-0.03, 0, 0))], [belt], live=True)
    moving.set_body_pose(PLATE, middle)
    publishers = [
        Publisher(VirtualCamera(moving, name, frame_rate=a.fps, format="Mono8")) for name in ("Left", "Right")
    ]
    served = Mjpeg(publishers)
    served.start()
    try:
        for p in publishers:
            p.start()
        rows = watch(served.url, a.frames, a.fps, moving)
    finally:
        for p in publishers:
            p.stop()
        served.stop()
    for name, scale, unit in (
        ("x", 1e3, "µm"), ("y", 1e3, "µm"), ("z", 1e3, "µm"), ("length", 1e3, "µm"), ("width", 1e3, "µm"),
    ):  # fmt: skip
        off = np.array([(r[1][name] - r[2][name]) * scale for r in rows])
        print(f"{name}: mean error {off.mean():.1f} {unit}, rms about it {off.std():.1f} {unit}")
    off = np.array([(r[1]["heading"] - r[2]["heading"] + 90) % 180 - 90 for r in rows])
    print(
        f"heading: mean error {off.mean():.3f} degrees, rms about it {off.std():.3f} degrees; {len(rows)} pairs"
    )
    plot(rows, a.out)


if __name__ == "__main__":
    main()
