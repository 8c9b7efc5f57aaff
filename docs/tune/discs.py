"""Printed discs measured on a real camera: a circle gauge tuned on simulated pictures, verified against the lattice.

    python docs/tune/discs.py --out out/discs
    brightfield tune out/discs/simulated.json --algorithm circle-gauge --features out/discs/features.yaml \\
        --real out/discs/real.json --out out/discs/gauge

The photographs (assets/flea3_discs) show one grid at five exposures, the paper saturated in four. Pose and lens are
taught once, by the middles of dark pixels in the picture at 50 ms; that the discs lie on a square lattice is what is
known. How well the lattice fits them is the registration that the prediction counts in.
"""

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import yaml
from scipy.optimize import least_squares

sys.path.insert(0, str(Path(__file__).parents[2]))
sys.path.insert(0, str(Path(__file__).parent))

from chessboard import write

from interchange.brdf.lambert import Lambert
from interchange.camera import Camera, Lens, Sensor
from interchange.exposure import expose
from interchange.formats import images
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.mesh import Mesh, from_corners
from interchange.scene import Body, Scene
from realtime.renderers.rasterizer import Rasterizer

PHOTOGRAPHS = Path(__file__).parents[2] / "assets" / "flea3_discs"
EXPOSURES = (25, 50, 100, 250, 500)  # ms
PITCH = 0.01  # m between discs: the unit of length here, for none is told
PIXEL = 6.9e-6  # m: two pixels of the mosaic, whose greens are averaged
BLACK, WHITE = 0.04, 0.85


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--frames", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    make(args.out, args.frames, args.seed)


def make(out: Path, frames: int, seed: int) -> None:
    """Write simulated.json, real.json and features.yaml with their scenes and images."""
    (out / "images").mkdir(parents=True, exist_ok=True)
    camera, lattice, radius, off = taught(green(50))
    rng = np.random.default_rng(seed)
    bodies = sheet(lattice, radius)
    scenes, entries = [], []
    with Rasterizer() as renderer:
        for k in range(frames):
            scene, own = simulated(camera, bodies, rng, k)
            shot = expose(renderer.render(scene, own, samples=16), own, rng=rng)
            entries.append(
                entry(out, f"simulated_{k:03d}", shot.pixels.astype(np.uint8), own.name, k, own.t_exp)
            )
            scenes.append(scene)
    write(out, "simulated", scenes, entries)
    own = replace(camera, name="/World/Camera", sensor=replace(camera.sensor, bit_depth=8))
    entries = [entry(out, f"{t:03d}ms", green(t), own.name, 0, t / 1000) for t in EXPOSURES]
    write(out, "real", [Scene(bodies, (), (own,))], entries, {"registration_px": round(off, 3)})
    circles = {
        f"disc{k:02d}": {
            "middle": [float(1e3 * x), float(1e3 * y), 0.0], "normal": [0, 0, 1], "diameter": float(2e3 * radius)
        }
        for k, (x, y) in enumerate(lattice)
    }  # fmt: skip
    (out / "features.yaml").write_text(yaml.safe_dump({"circles": circles}))


def green(ms: int) -> np.ndarray:
    """(172, 204) uint8: the mean of the two greens of every 2 x 2 pixels, G at (0, 0) and (1, 1)."""
    raw = images.read(PHOTOGRAPHS / f"{ms:03d}ms.png")[..., 0].astype(np.uint16)
    return ((raw[0::2, 0::2] + raw[1::2, 1::2] + 1) // 2).astype(np.uint8)


def taught(picture: np.ndarray) -> tuple[Camera, np.ndarray, float, float]:
    """The camera before the sheet, the lattice's discs that are seen as a whole (n, 2) m, their radius m, and the rms
    px in each direction by which the lattice misses them. Where the picture was cut from the image is not told either:
    the principal point is searched with the pose."""
    half = (int(picture.min()) + int(np.median(picture))) / 2
    _, _, about, _ = cv2.connectedComponentsWithStats((picture < half).astype(np.uint8))
    height, width = picture.shape
    left, top, w, h, area = about.T
    whole = (left > 4) & (top > 4) & (left + w < width - 4) & (top + h < height - 4) & (area > 80)
    found = np.array([middle_of(picture, half, about[k]) for k in np.flatnonzero(whole)])
    step = np.array([[34.0, 1.0], [-1.5, 31.5]])  # px: to the next disc right and below, roughly
    index = np.rint((found - found[np.argmin(found.sum(axis=1))]) @ np.linalg.inv(step)).astype(int)
    if len(np.unique(index, axis=0)) < len(found):
        raise SystemExit("Two discs have the same place in the lattice.")
    lattice = PITCH * np.stack([index[:, 0], -index[:, 1]], -1).astype(float)
    sensor = Sensor((width, height), (PIXEL, PIXEL), bit_depth=8, mosaic="mono")
    flat = np.column_stack([lattice, np.zeros(len(lattice))])

    def camera(p: np.ndarray) -> Camera:
        camera_from_sheet = np.eye(4)
        camera_from_sheet[:3, :3], camera_from_sheet[:3, 3] = cv2.Rodrigues(p[:3])[0], p[3:6]
        lens, middle = Lens(8e-3), (float(p[6]), float(p[7]))
        return Camera("/World/Camera", np.linalg.inv(camera_from_sheet), lens, sensor, middle)

    first = np.array([np.pi, 0, 0, -0.03, -0.02, PITCH * 8e-3 / (33 * PIXEL), 102, 86])
    scale = [1, 1, 1, 0.1, 0.1, 0.1, 100, 100]
    fitted = least_squares(lambda p: (camera(p).project(flat) - found).ravel(), first, x_scale=scale)
    own = camera(fitted.x)
    missed = own.project(flat) - found
    aside = np.array([PITCH / 2, 0, 0])
    across = np.linalg.norm(own.project(flat + aside) - own.project(flat - aside), axis=1)
    radius = PITCH / float(np.median(across)) * float(np.sqrt(np.median(area[whole]) / np.pi))
    return own, lattice, radius, float(np.sqrt(np.mean(missed**2)))


def middle_of(picture: np.ndarray, half: float, about: np.ndarray) -> tuple[float, float]:
    """(column, row) of a disc's darkness, what is brighter than half way to the paper left out."""
    x0, y0, w, h = (int(v) for v in about[:4])
    row, column = np.mgrid[y0 - 3 : y0 + h + 3, x0 - 3 : x0 + w + 3]
    dark = np.maximum(half - picture[row, column], 0)
    return float((dark * column).sum() / dark.sum()), float((dark * row).sum() / dark.sum())


def sheet(lattice: np.ndarray, radius: float) -> tuple[Body, ...]:
    """Paper, and discs a hair above it."""
    t = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    rim = radius * np.stack([np.cos(t), np.sin(t)], -1)
    extent = np.arange(-6, 7) * PITCH  # beyond what is seen
    middle = np.rint(lattice.mean(axis=0) / PITCH) * PITCH
    places = middle + np.stack(np.meshgrid(extent, extent), -1).reshape(-1, 2)
    corners, faces = [], []
    for k, place in enumerate(places):
        corners.append(np.column_stack([np.vstack([place, place + rim]), np.full(65, 5e-5)]))
        ring = 65 * k + 1 + np.arange(64)
        faces.append(np.column_stack([np.full(64, 65 * k), ring, np.roll(ring, -1)]))
    discs = from_corners(np.concatenate(corners), np.concatenate(faces))
    edge = 0.09
    flat = np.array([[-edge, -edge, 0], [edge, -edge, 0], [edge, edge, 0], [-edge, edge, 0]])
    flat += [*middle, 0]
    paper: Mesh = from_corners(flat, np.array([[0, 1, 2], [0, 2, 3]]))
    return (
        Body("/World/paper", paper, Material("paper", Lambert((WHITE,) * 3))),
        Body("/World/discs", discs, Material("ink", Lambert((BLACK,) * 3))),
    )


def simulated(
    camera: Camera, bodies: tuple[Body, ...], rng: np.random.Generator, k: int
) -> tuple[Scene, Camera]:
    """The sheet shifted and tilted a little, under light from the dark to far beyond saturation."""
    pose = np.eye(4)
    pose[:3, :3] = cv2.Rodrigues(rng.normal(0, 0.03, 3))[0]
    pose[:3, 3] = [*rng.uniform(-0.3, 0.3, 2) * PITCH, rng.uniform(-0.01, 0.01)]
    level = 120 * 2 ** rng.uniform(-0.5, 4.5)  # DN of paper, were it not for saturation
    away, off = rng.uniform(0.6, 1.5), rng.uniform(-0.3, 0.3, 2)
    place = np.array([*off, away])
    lamp = np.eye(4)
    lamp[:3, 3] = place
    irradiance = away / np.linalg.norm(place) ** 3
    full = rng.uniform(4000, 16000)
    sensor = replace(
        camera.sensor,
        responsivity=level / 255 * full / (WHITE / np.pi * irradiance),
        full_well=full,
        read_noise=rng.uniform(8, 40),
        prnu=rng.uniform(0.0, 0.015),
    )
    own = replace(
        camera,
        name=f"/World/Camera{k}",
        world_from_camera=pose @ camera.world_from_camera,
        sensor=sensor,
        lens=replace(camera.lens, blur=rng.uniform(0.3, 0.9)),
    )
    light = Light("/World/Lamp", LightKind.SPHERE, (1.0, 1.0, 1.0), world_from_light=lamp)
    return Scene(bodies, (light,), (own,), time=k), own


def entry(out: Path, name: str, pixels: np.ndarray, camera: str, time: int, exposure: float) -> dict:
    images.write(out / f"images/{name}.png", pixels)
    return {"image": f"images/{name}.png", "camera": camera, "time": time, "exposure": exposure}


if __name__ == "__main__":
    main()
