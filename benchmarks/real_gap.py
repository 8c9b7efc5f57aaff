"""The diagnosis on real data: deliberately ideal twins, whose faults a calibration or EMVA 1288 knows.

    python benchmarks/real_gap.py chessboard --out DIR [--sizes 8 4 2 1] [--picture docs/real_gap_chessboard.png]
    python benchmarks/real_gap.py sensor --out DIR [--lamps 1] [--picture docs/real_gap_sensor.png]
    python benchmarks/real_gap.py flea3-filters --out DIR [--sizes 4 2 1] [--picture docs/real_gap_flea3.png]
    python benchmarks/real_gap.py flea3-exposures --out DIR [--dark] [--picture docs/real_gap_flea3_exposures.png]

``chessboard``: photographs of a board (assets/calibration) against a camera without distortion at the poses of an
OpenCV calibration; diagnosed from an eighth of the size on, each size with the lens that the one before found.
``sensor``: a camera on an EMVA 1288 bench (assets/camera_emva1288) against an ideal sensor before a grey plate, lit as
the bench's photon numbers say. ``flea3-filters``, ``flea3-exposures``: benchmarks.real_gap_filters and
benchmarks.real_gap_exposures say. Each writes scene.usda and captures.json to DIR, runs ``brightfield diagnose --render
realtime`` on them, and says how far it agrees with the reference.
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from matplotlib.figure import Figure
from scipy.optimize import least_squares

sys.path.insert(0, str(Path(__file__).parents[1]))

from analysis.calibration.calibration import Calibration, calibrate
from analysis.calibration.models import MODELS
from analysis.calibration.observations import Observations, grey, observe
from analysis.emva import Level, characterise, level
from benchmarks import real_gap_exposures, real_gap_filters
from benchmarks.diagnosed import diagnosed, written
from benchmarks.twin import ASSETS, BOARD, posed, squares
from interchange.brdf.lambert import Lambert
from interchange.camera import Camera, Lens, Sensor
from interchange.formats import emva_data, exr, images
from interchange.frames import look_at
from interchange.image import Image
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.mesh import Mesh
from interchange.scene import Body, Scene

LAMP_AT = (
    0.6  # m before the board: a lamp's distance, which a slope over the board does not tell from its place
)
WHITE, BLACK = 0.85, 0.05  # reflectance
CLIPPED = 242.0  # DN of 255 from which white squares are not compared
SIZES = (8, 4, 2, 1)  # times that pictures are reduced
NOMINAL_K = 0.25  # DN/e-: what a data sheet might say of a camera with 12 bits
LENS = ("k1", "k2", "p1", "p2")
REFERENCE = (("sensor_noise", "K"), ("sensor_noise", "read_noise"), ("black_level", "black_level"),
             ("fixed_pattern", "prnu"), ("fixed_pattern", "dsnu"))  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("chessboard", "sensor", "flea3-filters", "flea3-exposures"))
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument(
        "--sizes", type=int, nargs="*", help="times that pictures are reduced, one after the other"
    )
    parser.add_argument(
        "--lamps", type=int, default=2, help="of the sensor's bench; 1 shows no fixed pattern"
    )
    parser.add_argument("--dark", action="store_true", help="the exposures' dark frames too")
    parser.add_argument("--picture", type=Path)
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    if args.what == "chessboard":
        chessboard(args.out, args.sizes or SIZES, args.picture)
    elif args.what == "sensor":
        sensor(args.out, args.lamps, args.picture)
    elif args.what == "flea3-filters":
        real_gap_filters.filters(args.out, args.sizes or real_gap_filters.SIZES, args.picture)
    else:
        real_gap_exposures.exposures(args.out, args.dark, args.picture)


# --- a lens


def chessboard(out: Path, sizes: Sequence[int], picture: Path | None) -> None:
    paths = sorted((ASSETS / "calibration").glob("left*.jpg"))
    views = observe({"left": paths}, BOARD)
    truth = calibrate(views, MODELS["4"])  # k1, k2, p1, p2, as many as the diagnosis has
    real, cameras, lamps, black = [], [], [], []
    for k, path in enumerate(paths):
        camera = replace(
            truth.camera(0), name=path.stem, world_from_camera=np.linalg.inv(truth.camera_from_board(0, k))
        )
        flat = squares(grey(path), camera)
        if max(dn for _, dn, white in flat if white) < CLIPPED:
            light, veil = lamp(flat, camera)
            real.append((path, grey(path).astype(np.float32)))
            cameras.append(camera)
            lamps.append(light)
            black.append(veil)
    print(f"{len(real)} of {len(paths)} pictures: " + ", ".join(p.stem for p, _ in real))
    k, known = np.zeros(4), np.zeros(4)
    print(f"OpenCV's own residual {truth.rms:.3f} px")
    compared(k, np.zeros(4), truth, views, cameras)
    for size in sizes:
        more, sigma = of_size(out / f"size{size}", size, k, real, cameras, lamps, float(np.median(black)))
        k, sigma = k + more, sigma if more.any() else known
        known = sigma
        compared(k, sigma, truth, views, cameras)
    if picture is not None:
        path = real[-1][0]
        cv2.imwrite(str(picture), drawn(path, cameras[-1], k))


def lamp(flat: list[tuple[np.ndarray, float, bool]], camera: Camera) -> tuple[Light, float]:
    """A small sphere whose place and power give the flat squares their DN above a veil; and the veil, DN."""
    at, dn = np.array([m for m, *_ in flat]), np.array([d for _, d, _ in flat])
    share = np.array([WHITE if white else BLACK for *_, white in flat])
    side = np.sign(camera.world_from_camera[2, 3])

    def model(p: np.ndarray) -> np.ndarray:
        d = np.array([p[0], p[1], side * LAMP_AT]) - at
        return share / np.pi * p[2] * LAMP_AT * 1.0 / np.linalg.norm(d, axis=1) ** 3 + p[3]

    x = least_squares(
        lambda p: model(p) - dn, [0.1, 0.05, 255 * np.pi * LAMP_AT**2, 5.0], x_scale=[0.1, 0.1, 100, 5]
    ).x
    place = np.eye(4)
    place[:3, 3] = x[0], x[1], side * LAMP_AT
    power = float(x[2])
    return Light("/World/Lamp", LightKind.SPHERE, (power,) * 3, place, radius=0.001), float(x[3])


def board(side: float) -> tuple[Body, Body]:
    """White and black squares, with the white rim, as two bodies that face ``side`` of z."""
    quads: dict[bool, list[np.ndarray]] = {True: [], False: []}
    p = BOARD.size
    for i in range(-2, BOARD.columns + 1):
        for j in range(-2, BOARD.rows + 1):
            corner = np.array([[i, -j - 1], [i + 1, -j - 1], [i + 1, -j], [i, -j]]) * p
            rim = i in (-2, BOARD.columns) or j in (-2, BOARD.rows)
            quads[rim or (i + j) % 2 == 1].append(np.column_stack([corner, np.zeros(4)]))
    bodies = []
    for white, name in ((True, "white"), (False, "black")):
        vertices = np.concatenate(quads[white])
        n = np.arange(len(quads[white]))[:, None] * 4
        turn = np.array([[0, 1, 2], [0, 2, 3]] if side > 0 else [[0, 2, 1], [0, 3, 2]])
        faces = (n[:, :, None] + turn).reshape(-1, 3)
        mesh = Mesh(vertices, faces.astype(np.int32), np.tile([0.0, 0, side], (len(vertices), 1)))
        share = WHITE if white else BLACK
        bodies.append(Body(f"/World/{name}", mesh, Material(name, Lambert((share,) * 3))))
    return bodies[0], bodies[1]


def of_size(
    folder: Path,
    size: int,
    k: np.ndarray,
    real: list[tuple[Path, np.ndarray]],
    cameras: list[Camera],
    lamps: list[Light],
    black: float,
) -> tuple[np.ndarray, np.ndarray]:
    """The diagnosis of the pictures reduced ``size`` times: what it adds to k1, k2, p1, p2 of the scene, and σ."""
    folder.mkdir(parents=True, exist_ok=True)
    entries, frames = [], []
    for n, ((path, picture), camera, light) in enumerate(zip(real, cameras, lamps, strict=True)):
        h, w = picture.shape[0] // size, picture.shape[1] // size
        small = picture.reshape(h, size, w, size).mean(axis=(1, 3), dtype=np.float64).astype(np.float32)
        exr.write(folder / f"{path.stem}.exr", Image(small[..., None]))
        px, py = camera.sensor.pixel_pitch
        cx, cy = camera.K[:2, 2]
        twin = replace(
            camera,
            name="/World/Camera",
            principal_point=((cx + 0.5) / size - 0.5, (cy + 0.5) / size - 0.5),
            lens=replace(camera.lens, distortion=tuple(k)),
            sensor=Sensor((w, h), (px * size, py * size), 20000 / 255, 20000, 8, max(black, 0.0), 60.0),
        )
        # the board where its corners are seen: what lies around it is in no scene
        seen = cv2.convexHull(np.float32(camera.project(BOARD.points)))[:, 0]
        mask = cv2.fillConvexPoly(np.zeros(picture.shape, np.uint8), np.rint(seen).astype(np.int32), 255)
        images.write(folder / f"{path.stem}_mask.png", mask[size // 2 :: size, size // 2 :: size].copy())
        frames.append(Scene(board(float(np.sign(camera.world_from_camera[2, 3]))), (light,), (twin,)))
        entries.append({"image": f"{path.stem}.exr", "camera": "/World/Camera", "time": n, "exposure": 1.0,
                        "mask": f"{path.stem}_mask.png"})  # fmt: skip
    tolerances = {"registration_px": 0.2 / size, "light_intensity": 0.03, "light_position_mm": 30,
                  "flat_field": 0.03, "black_level_dn": 5, "albedo": 0.1, "object_pose_mm": 0.05}  # fmt: skip
    held = [e["image"] for e in entries[1::3]]
    written(folder, frames, entries, tolerances, held)
    found = diagnosed(folder)
    lens = next((f["parameters"] for f in found["effects"] if f["name"] == "lens_distortion"), {})
    nothing = {"value": 0.0, "sigma": 0.0}
    numbers = [lens.get(name, nothing) for name in LENS]
    return np.array([n["value"] for n in numbers]), np.array([n["sigma"] for n in numbers])


def compared(
    k: np.ndarray, sigma: np.ndarray, truth: Calibration, views: Observations, cameras: Sequence[Camera]
) -> None:
    """Print the lens beside OpenCV's, and how far its corners lie from those seen: at OpenCV's poses, and at those that
    fit it best."""
    reference = {name: (value, sd) for name, value, sd in truth.parameters(0)}
    for name, value, sd in zip(LENS, k, sigma, strict=True):
        there, own = reference[name]
        both = np.hypot(sd, own)
        print(
            f"  {name} {value:+.5f} ± {sd:.5f}; OpenCV's {there:+.5f} ± {own:.5f}; {(value - there) / both:+.1f} σ"
        )
    at, anew = [], []
    lenses = [replace(c, lens=replace(c.lens, distortion=tuple(k))) for c in cameras]
    seen = {Path(v.image).stem: v.pixels for v in views.views}
    for camera in lenses:
        pixels = seen[camera.name]
        at.append(camera.project(BOARD.points) - pixels)
        anew.append(posed(camera, pixels).project(BOARD.points) - pixels)
    own_rms, anew_rms = (float(np.sqrt(np.mean(np.sum(np.square(e), axis=-1)))) for e in (at, anew))
    print(
        f"  corners off by {own_rms:.3f} px rms at the calibration's poses, {anew_rms:.3f} px at poses found anew",
        flush=True,
    )


def drawn(path: Path, camera: Camera, k: np.ndarray) -> np.ndarray:
    """A picture with the corners where the pinhole has them (red) and the lens that was found (green)."""
    shown = cv2.cvtColor(grey(path), cv2.COLOR_GRAY2BGR)
    for lens, colour in ((np.zeros(4), (60, 60, 230)), (k, (60, 200, 60))):
        for at in replace(camera, lens=replace(camera.lens, distortion=tuple(lens))).project(BOARD.points):
            x, y = np.rint(16 * at).astype(int)
            cv2.circle(shown, (int(x), int(y)), 48, colour, 1, cv2.LINE_AA, 4)
    return shown


# --- a sensor


def sensor(out: Path, count: int, picture: Path | None) -> dict[str, tuple[float, float]]:
    """The numbers that the diagnosis of the bench finds, each beside what ``brightfield emva`` says of it."""
    about = emva_data.read(ASSETS / "camera_emva1288/EMVA1288_Data.txt")
    levels = [level(p.t_exp, p.photons, (images.read(i)[..., 0] for i in p.images)) for p in about.points]
    size = (about.width, about.height)
    of = characterise(
        [v for v in levels if v.photons],
        [v for v in levels if not v.photons],
        about.bits,
        9.9,
        525,
        "1",
        size,
    )
    reference = of.sheet.sensor()
    print(
        "brightfield emva: "
        + ", ".join(
            f"{n} {getattr(reference, n):.5g}" for n in ("K", "read_noise", "black_level", "prnu", "dsnu")
        )
    )
    eta = reference.quantum_efficiency[1]
    full_well = 4095 / NOMINAL_K
    ideal = Sensor(size, (9.9e-6, 9.9e-6), 1.0, full_well, about.bits)
    camera = Camera(
        "/World/Camera",
        lens=Lens(16e-3),
        sensor=ideal,
        world_from_camera=look_at(np.array([0.0, 0, 0.5]), np.zeros(3)),
    )
    corner = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    mesh = Mesh(corner, np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.tile([0.0, 0, 1], (4, 1)))
    plate = Body("/World/Plate", mesh, Material("plate", Lambert((0.5, 0.5, 0.5))))
    entries, frames = [], []
    bright = 0
    for n, point in enumerate(about.points):
        # e- = E ρ/π t: what the photometer counted, times the efficiency; DN by the nominal gain follow the real ones
        irradiance = point.photons * eta * reference.K / NOMINAL_K / point.t_exp / (0.5 / np.pi)
        on = bright % count if point.photons else -1
        bright += point.photons > 0
        lights = tuple(
            Light(f"/World/Lamp{i}", LightKind.DISTANT, (irradiance if i == on else 0.0,) * 3, angle=0.01)
            for i in range(count)
        )
        frames.append(Scene((plate,), lights, (camera,)))
        for k, image in enumerate(point.images):
            name = f"{n:02d}_{k}.png"
            images.write(out / name, images.read(image).astype(np.uint16))
            entries.append({"image": name, "camera": "/World/Camera", "time": n, "exposure": point.t_exp})
    tolerances = {"light_intensity": 0.01, "flat_field": 0.01}
    written(out, frames, entries, tolerances)
    found = diagnosed(out)
    told = {(f["name"], n): p for f in found["effects"] for n, p in f["parameters"].items()}
    beside = {}
    for effect, name in REFERENCE:
        there = float(getattr(reference, name))
        if (effect, name) not in told:
            print(f"  {effect}: not found; {name} is {there:.5g} by brightfield emva")
            continue
        number = told[effect, name]
        beside[name] = (float(number["value"]), there)
        print(
            f"  {effect}: {name} {number['value']:.5g} ± {number['sigma']:.2g} {number['unit']}, {there:.5g} by "
            f"brightfield emva" + (f": {100 * (number['value'] / there - 1):+.2f} %" if there else "")
        )
    if picture is not None and ("sensor_noise", "K") in told:
        own = [told["sensor_noise", n]["value"] for n in ("K", "read_noise")]
        transfer(levels, reference, own).savefig(picture, dpi=110)
    return beside


def transfer(levels: Sequence[Level], reference: Sensor, found: Sequence[float]) -> Figure:
    """Variance over mean: what was measured, the ideal sensor, EMVA 1288's numbers, and those of the diagnosis."""
    figure = Figure(figsize=(6, 4), layout="tight")
    ax = figure.add_subplot(xlabel="mean less dark, DN", ylabel="variance of repeats, DN²")
    dark = np.mean([v.mu for v in levels if not v.photons])
    seen = [(v.mu - dark, float(v.temporal.mean())) for v in levels if v.mu < 4000]
    ax.plot(*np.array(seen).T, "ko", label="pictures")
    x = np.array([0.0, 4000.0])
    lines = (("ideal twin", NOMINAL_K, 0.0, "r:"), ("brightfield emva", reference.K, reference.read_noise, "b-"),
             ("diagnosis", found[0], found[1], "g--"))  # fmt: skip
    for name, K, read, style in lines:
        ax.plot(x, K * x + (K * read) ** 2 + 1 / 12, style, label=f"{name}: K {K:.4f}, σ_d {read:.1f} e-")
    ax.legend()
    return figure


if __name__ == "__main__":
    main()
