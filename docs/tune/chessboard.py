"""The chapter's Fig. 7 on a real camera: edges of a chessboard, tuned on simulated pictures, verified on photographs.

    python docs/tune/chessboard.py --out out/chessboard [--frames 40] [--real 6]
    brightfield tune out/chessboard/simulated.json --algorithm canny --of white --of black \\
        --real out/chessboard/real.json --out out/chessboard/canny

The lens is calibrated from every other photograph of assets/calibration. The simulated series varies what is not known
of the photographs beforehand: pose, level and slope of the light, veil of light over black, blur, noise. The other
photographs are the real images; their poses come from the corners of the board, as an operator would teach them.
"""

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from analysis.calibration.boards.chessboard import Chessboard
from analysis.calibration.body import BLACK, WHITE, views_of
from analysis.calibration.calibration import calibrate
from analysis.calibration.models import MODELS
from analysis.calibration.observations import grey, observe
from interchange.brdf.lambert import Lambert
from interchange.camera import Camera
from interchange.exposure import expose
from interchange.formats import images
from interchange.formats.document import Document
from interchange.formats.usd_author import author_scene
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.mesh import from_corners
from interchange.scene import Body, Scene
from realtime.renderers.rasterizer import Rasterizer

PHOTOGRAPHS = Path(__file__).parents[2] / "assets" / "calibration"
BOARD = Chessboard(9, 6, 0.025)
RIM = 0.6  # of a square: what the photographs show of the outer ones, whose size nobody told


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--frames", type=int, default=40)
    parser.add_argument("--real", type=int, default=6)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    make(args.out, args.frames, args.real, args.seed)


def make(out: Path, frames: int, real: int, seed: int) -> None:
    """Write simulated.json and real.json with their scenes and images."""
    photographs = sorted(PHOTOGRAPHS.glob("left*.jpg"))
    calibrated = calibrate(observe({"left": photographs[0::2]}, BOARD), MODELS["5"])
    lens = calibrated.camera(0)
    rng = np.random.default_rng(seed)
    (out / "images").mkdir(parents=True, exist_ok=True)
    scenes, entries = [], []
    with Rasterizer() as renderer:
        for k in range(frames):
            scene, camera = simulated(lens, rng, k)
            image = expose(renderer.render(scene, camera, samples=16), camera, rng=rng)
            name = f"images/simulated_{k:03d}.png"
            images.write(out / name, image.pixels.astype(np.uint8))
            scenes.append(scene)
            entries.append({"image": name, "camera": camera.name, "time": k, "exposure": camera.t_exp})
    write(out, "simulated", scenes, entries)
    scenes, entries = [], []
    for k, path in enumerate(photographs[1::2][:real]):
        picture = grey(path)
        found = BOARD.detect(picture)
        if found is None:
            raise SystemExit(f"{path} shows no board.")
        camera = replace(posed(lens, found.pixels), name=f"/World/Camera{k}")
        name = f"images/{path.stem}.png"
        images.write(out / name, picture)
        scenes.append(Scene(board(), (), (camera,), time=k))
        entries.append({"image": name, "camera": camera.name, "time": k, "exposure": 1.0})
    write(out, "real", scenes, entries, {"registration_px": round(calibrated.rms / 2**0.5, 3)})


def simulated(lens: Camera, rng: np.random.Generator, k: int) -> tuple[Scene, Camera]:
    """A board at the origin, a camera somewhere before it, and a lamp whose distance sets how even its light is."""
    pose = views_of(BOARD, lens, 1, rng, tilt=(5, 45))[0]
    middle = BOARD.points.mean(axis=0)
    away = rng.uniform(0.35, 1.5)  # m
    off = rng.uniform(-0.5, 0.5, 2) * away
    lamp = Light(
        "/World/Lamp",
        LightKind.SPHERE,
        (1.0, 1.0, 1.0),
        world_from_light=_at(middle + np.array([*off, away])),
    )
    level = rng.uniform(90, 240)  # DN of white in the middle
    towards = np.array([*off, away])
    irradiance = away / np.linalg.norm(towards) ** 3
    black = rng.uniform(0, 35)
    sensor = replace(
        lens.sensor,
        responsivity=(level - black) / 255 * 20_000 / (WHITE / np.pi * irradiance),
        full_well=20_000 * (255 - black) / 255,
        bit_depth=8,
        black_level=black,
        read_noise=rng.uniform(20, 160),
        mosaic="mono",
    )
    camera = replace(
        lens,
        name=f"/World/Camera{k}",
        world_from_camera=pose,
        sensor=sensor,
        lens=replace(lens.lens, blur=rng.uniform(0.3, 1.4)),
        t_exp=1.0,
    )
    return Scene(board(), (lamp,), (camera,), time=k), camera


def board() -> tuple[Body, ...]:
    """Squares as faces of two materials: where they meet is an edge, as in a CAD part. The outer ones are bodies of
    their own, since their size is not known: what counts are the edges between the inner corners."""
    if not _board:
        _board.extend(_made())
    return tuple(_board)


_board: list[Body] = []


def _made() -> list[Body]:
    across = BOARD.size * np.r_[-RIM, np.arange(BOARD.columns), BOARD.columns - 1 + RIM]
    down = -BOARD.size * np.r_[-RIM, np.arange(BOARD.rows), BOARD.rows - 1 + RIM]
    cells: dict[str, list[list[list[float]]]] = {"white": [], "black": [], "white_rim": [], "black_rim": []}
    for i in range(len(down) - 1):
        for j in range(len(across) - 1):
            name = "white" if (i + j) % 2 else "black"
            if i in (0, len(down) - 2) or j in (0, len(across) - 2):
                name += "_rim"
            left, right, top, bottom = across[j], across[j + 1], down[i], down[i + 1]
            cells[name].append([[left, top, 0], [left, bottom, 0], [right, bottom, 0], [right, top, 0]])
    bodies = []
    for name, own in cells.items():
        faces = np.array([[4 * k + a for a in t] for k in range(len(own)) for t in ((0, 1, 2), (0, 2, 3))])
        share = WHITE if name.startswith("white") else BLACK
        mesh = from_corners(np.array(own).reshape(-1, 3), faces)
        bodies.append(Body(f"/World/{name}", mesh, Material(name, Lambert((share,) * 3))))
    return bodies


def posed(lens: Camera, pixels: np.ndarray) -> Camera:
    """The camera in the board's frame."""
    d = np.array(lens.lens.distortion)
    _, r, t = cv2.solvePnP(BOARD.points, pixels, lens.K, d, flags=cv2.SOLVEPNP_ITERATIVE)
    r, t = cv2.solvePnPRefineLM(BOARD.points, pixels, lens.K, d, r, t)
    camera_from_board = np.eye(4)
    camera_from_board[:3, :3], camera_from_board[:3, 3] = cv2.Rodrigues(r)[0], t.ravel()
    return replace(lens, world_from_camera=np.linalg.inv(camera_from_board))


def write(
    out: Path, name: str, scenes: list[Scene], entries: list[dict], tolerances: dict[str, float] | None = None
) -> None:
    """The scene with a camera a frame, and its captures. The first lamp stands for the file; see ``simulated``."""
    whole = replace(scenes[0], cameras=tuple(s.cameras[0] for s in scenes))
    frames = [replace(s, cameras=whole.cameras) for s in scenes]
    stage = author_scene(whole, 1.0, frames[1:])
    Document(stage, out / f"{name}.usda").save(out / f"{name}.usda")
    head = {"scene": f"{name}.usda", "captures": entries, "tolerances": tolerances or {}}
    (out / f"{name}.json").write_text(json.dumps(head, indent=1))


def _at(place: np.ndarray) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, 3] = place
    return pose


if __name__ == "__main__":
    main()
