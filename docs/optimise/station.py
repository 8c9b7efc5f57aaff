"""A stand for `brightfield optimise`: a milled part under a housing, a lamp, a camera; and the plan of its search.

    python docs/optimise/station.py --out out/station
    brightfield optimise out/station/plan.yaml

The part shall show a scratch on its top and the places of its edges. A housing with an opening stands between it and
camera and lamp; both may be moved within what the rail allows, and must keep clear of the housing.
"""

import argparse
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from interchange.brdf.lambert import Lambert
from interchange.brdf.ward import Ward
from interchange.camera import Camera, Lens
from interchange.formats.document import Document
from interchange.formats.usd_author import author_scene
from interchange.frames import look_at
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.mesh import Mesh, from_corners
from interchange.scene import Body, Scene
from interchange.sensor import Mosaic, Sensor

PLAN = """\
scene: station.usda
camera: Camera
part: [Part]
parameters:
  Camera.pose.tx: {range: [-60, 60], unit: mm}
  Camera.pose.ty: {range: [-60, 60], unit: mm}
  Camera.pose.tz: {range: [-80, 120], unit: mm}
  Camera.lens.f_stop: {range: [2.8, 16], law: log_uniform}
  Camera.sensor.t_exp: {range: [0.5, 30], unit: ms, law: log_uniform}
  Lamp.pose.tx: {range: [-40, 160], unit: mm}
  Lamp.pose.tz: {range: [-60, 80], unit: mm}
aim: {Camera: Part, Lamp: Part}
focus: Part
limits: {seen: 0.93, saturated: 0.02, clearance: 15, unit: mm, clear: [Camera, Lamp]}
defects:
  - kind: scratch
    on: Part
    at: [-4, 2, 20]
    length: {value: 8, unit: mm}
    width: {value: 0.5, unit: mm}
    depth: {value: 60, unit: µm}
    angle: {value: 25, unit: deg}
objectives:
  defect_visibility: {clutter: 0.02}
  uncertainty: {along: 1}
  evenness: {}
search: {method: tpe, trials: 80, seed: 0}
render: {width: 128, samples: 6}
confirm: {count: 3, samples: 64}
"""

HALVES = ((0, 1, 2), (0, 2, 3))
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, required=True)
    make(parser.parse_args().out)


def make(out: Path) -> None:
    """Write station.usda and plan.yaml."""
    out.mkdir(parents=True, exist_ok=True)
    Document(author_scene(station()), out / "station.usda").save(out / "station.usda")
    (out / "plan.yaml").write_text(PLAN, encoding="utf-8")


def station() -> Scene:
    steel = Material("steel", Ward((0.12,) * 3, (0.35,) * 3, 0.16))
    table = Material("table", Lambert((0.06,) * 3))
    housing = Material("housing", Lambert((0.03,) * 3))
    bodies = [
        Body("/World/Part", stepped(), steel),
        Body("/World/Table", box((0, 0, -2), (240, 240, 4)), table),
        # four walls around an opening of 90 x 90 mm, 80 mm above the table
        Body("/World/Housing", joined([box((x, y, 80), size) for x, y, size in WALLS]), housing),
    ]
    sensor = Sensor(
        (640, 480), (7.0e-6, 7.0e-6), responsivity=0.0, full_well=12_000, bit_depth=12, read_noise=6,
        quantum_efficiency=(0.55,) * 3, mosaic=Mosaic.MONO, prnu=0.005,
    )  # fmt: skip
    camera = Camera(
        "/World/Camera",
        look_at(np.array([0.0, -0.02, 0.21]), np.zeros(3)),
        Lens(12e-3, 4.0, 0.2),
        sensor,
        t_exp=4e-3,
    )
    pose = look_at(np.array([0.03, 0.03, 0.16]), np.array([0.0, 0, 0.01])) @ np.diag([1.0, -1, -1, 1])
    lamp = Light("/World/Lamp", LightKind.DISK, (0.05,) * 3, pose, radius=0.012)
    return Scene(tuple(bodies), (lamp,), (camera,))


WALLS = [
    (0.0, 82.5, (240, 75, 6)), (0.0, -82.5, (240, 75, 6)), (82.5, 0.0, (75, 90, 6)), (-82.5, 0.0, (75, 90, 6)),
]  # fmt: skip


def stepped() -> Mesh:
    """A block of 44 x 32 x 10 mm with a boss of 26 x 18 x 10 mm on it."""
    rings = [
        [[x * sx / 2, y * sy / 2, z] for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        for sx, sy, z in ((44, 32, 0), (44, 32, 10), (26, 18, 10), (26, 18, 20))
    ]
    quads = [rings[0][::-1], rings[-1]]
    quads += [[low[k], low[k - 3], high[k - 3], high[k]] for low, high in pairwise(rings) for k in range(4)]
    corners = 1e-3 * np.array([c for q in quads for c in q])
    return from_corners(
        corners, np.array([[4 * i + a for a in t] for i in range(len(quads)) for t in HALVES])
    )


def box(middle: tuple[float, float, float], size: tuple[float, float, float]) -> Mesh:
    """mm; flat faces."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    faces = np.array([[q[i] for i in t] for q in QUADS for t in ((0, 1, 2), (0, 2, 3))])
    return from_corners(1e-3 * (np.array(middle) + corners * np.array(size)), faces)


def joined(meshes: list[Mesh]) -> Mesh:
    start = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    return Mesh(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([m.faces + k for m, k in zip(meshes, start, strict=False)]).astype(np.int32),
        np.concatenate([m.normals for m in meshes]),
    )


if __name__ == "__main__":
    main()
