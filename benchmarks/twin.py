"""Real pictures beside their rendered twins: where edges lie, how sharp they are, and DN in flat patches.

    python benchmarks/twin.py [--out docs/twin.md]

Chessboards (assets/calibration): the lens comes from every other picture; each twin is of a picture that it has not
seen, at the pose that its corners give, under a lamp whose level and slope over the board its flat squares give,
through the chain of ``interchange.exposure``. The bench of assets/camera_emva1288, simulated anew; discs, a
ColorChecker and exposures of assets/flea3 (``benchmarks.twin_flea3``).
"""

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from analysis.calibration.boards.chessboard import Chessboard
from analysis.calibration.body import BLACK, WHITE, board_body
from analysis.calibration.calibration import calibrate
from analysis.calibration.models import MODELS
from analysis.calibration.observations import grey, observe
from analysis.emva import characterise, level
from benchmarks import twin_flea3
from benchmarks.edge_profiles import REACH, Edges, across, rms
from interchange.camera import Camera, Lens
from interchange.exposure import expose, responsivity
from interchange.formats import emva_data, images
from interchange.image import Image
from interchange.material import Texture
from interchange.scene import Body, Scene
from realtime.renderers.rasterizer import Rasterizer

ASSETS = Path(__file__).parents[1] / "assets"
BOARD = Chessboard(9, 6, 0.025)
FIGURES = "<!-- figures -->"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path)
    args = parser.parse_args()
    pictures = sorted((ASSETS / "calibration").glob("left*.jpg"))
    lines, panels = chessboards(pictures[0::2], pictures[1::2][:4])
    lines += ["", *transfer()]
    more, panels_flea3 = twin_flea3.all_of(ASSETS / "flea3")
    lines += ["", *more]
    text = "\n".join(lines)
    print(text)
    if args.out:
        head = args.out.read_text().split(FIGURES)[0]
        args.out.write_text(f"{head}{FIGURES}\n{text}\n")
        cv2.imwrite(str(args.out.with_suffix(".png")), panels)
        cv2.imwrite(str(args.out.with_name(f"{args.out.stem}_flea3.png")), panels_flea3)


def chessboards(learn: list[Path], shown: list[Path]) -> tuple[list[str], np.ndarray]:
    lens = calibrate(observe({"left": learn}, BOARD), MODELS["5"]).camera(0)
    lines = [
        "## Chessboards",
        "",
        f"Lens from {len(learn)} pictures; twins of {len(shown)} others. rms unless said; edges: {REACH} px to either "
        "side, 255 DN.",
        "",
        "| picture | corners px | edges px | edges, mean px | width of edges px: real, twin | white squares DN: mean, "
        "off by | black squares DN: mean, off by | all pixels of the board, off by DN (median of absolutes) |",
        "|---|---|---|---|---|---|---|---|",
    ]
    panels = []
    for path in shown:
        real = grey(path)
        found = BOARD.detect(real)
        if found is None:
            raise SystemExit(f"{path} shows no board.")
        camera = posed(lens, found.pixels)
        flat = squares(real, camera)
        slope, veil = lamp(flat)
        sharp = frame(camera, slope, veil, 0.0)
        measured, without = edges(real, camera), edges(sharp, camera)
        blur = float(np.sqrt(max(np.nanmedian(measured.sigma) ** 2 - np.nanmedian(without.sigma) ** 2, 0)))
        twin = frame(camera, slope, veil, blur)
        own, again = edges(twin, camera), BOARD.detect(twin)
        both = np.isfinite(measured.offset) & np.isfinite(own.offset)
        apart = (measured.offset - own.offset)[both]
        corners = np.linalg.norm(found.pixels - again.pixels, axis=-1)
        seen = squares(twin, camera)
        off = {
            white: np.array([b[1] - a[1] for a, b in zip(flat, seen, strict=True) if a[2] is white])
            for white in (True, False)
        }
        mean = {white: np.mean([a[1] for a in flat if a[2] is white]) for white in (True, False)}
        inside = cv2.fillConvexPoly(np.zeros_like(real), np.rint(outline(camera)).astype(np.int32), 1) > 0
        gap = np.abs(twin.astype(float) - real)[inside]
        lines.append(
            f"| {path.name} | {rms(corners):.3f} | {rms(apart):.3f} | {apart.mean():+.3f} | "
            f"{np.nanmedian(measured.sigma):.2f}, {np.nanmedian(own.sigma):.2f} | {mean[True]:.0f}, "
            f"{rms(off[True]):.1f} | {mean[False]:.0f}, {rms(off[False]):.1f} | {np.median(gap):.1f} |"
        )
        difference = np.clip(128 + (twin.astype(float) - real), 0, 255).astype(np.uint8)
        panels.append(np.hstack([real, twin, difference])[::2, ::2])
    return lines, np.vstack(panels[::3])  # two of four: the picture stays small


def posed(lens: Camera, pixels: np.ndarray) -> Camera:
    """The camera in the board's frame."""
    d = np.array(lens.lens.distortion)
    _, r, t = cv2.solvePnP(BOARD.points, pixels, lens.K, d, flags=cv2.SOLVEPNP_ITERATIVE)
    r, t = cv2.solvePnPRefineLM(BOARD.points, pixels, lens.K, d, r, t)
    camera_from_board = np.eye(4)
    camera_from_board[:3, :3], camera_from_board[:3, 3] = cv2.Rodrigues(r)[0], t.ravel()
    return replace(lens, world_from_camera=np.linalg.inv(camera_from_board))


def outline(camera: Camera) -> np.ndarray:
    """(4, 2) px: the outer inner corners."""
    corners = BOARD.points.reshape(BOARD.rows, BOARD.columns, 3)[[0, 0, -1, -1], [0, -1, -1, 0]]
    return camera.project(corners)


def squares(image: np.ndarray, camera: Camera) -> list[tuple[np.ndarray, float, bool]]:
    """Middle (board frame, m), mean DN of the inner quarter, whether it is white; of the squares between corners."""
    grid = BOARD.points.reshape(BOARD.rows, BOARD.columns, 3)
    found = []
    for i in range(BOARD.rows - 1):
        for j in range(BOARD.columns - 1):
            middle = (grid[i, j] + grid[i + 1, j + 1]) / 2
            inner = np.array([grid[i, j], grid[i, j + 1], grid[i + 1, j + 1], grid[i + 1, j]])
            area = np.rint(camera.project(middle + (inner - middle) / 2)).astype(np.int32)
            mask = cv2.fillConvexPoly(np.zeros(image.shape[:2], np.uint8), area, 1) > 0
            found.append((middle, float(image[mask].mean()), (i + j) % 2 == 1))
    return found


def lamp(flat: list[tuple[np.ndarray, float, bool]]) -> tuple[np.ndarray, float]:
    """DN = veil + (a + b x + c y) share, by least squares: (a, b, c) and veil."""
    shares = np.array([WHITE if white else BLACK for *_, white in flat])
    at = np.array([[1, m[0], m[1]] for m, *_ in flat])
    A = np.column_stack([at * shares[:, None], np.ones(len(flat))])
    x = np.linalg.lstsq(A, np.array([dn for _, dn, _ in flat]), rcond=None)[0]
    return x[:3], float(x[3])


def frame(camera: Camera, slope: np.ndarray, veil: float, blur: float) -> np.ndarray:
    """The twin in DN, (H, W) uint8: the board under the lamp, through lens, sensor and converter."""
    body = board_body(BOARD, 40, glows=True)
    texture = body.material.emission_map
    low, high = body.mesh.vertices[:, :2].min(0), body.mesh.vertices[:, :2].max(0)
    h, w = texture.pixels.shape[:2]
    x = low[0] + (np.arange(w) + 0.5) / w * (high - low)[0]
    y = high[1] - (np.arange(h) + 0.5) / h * (high - low)[1]
    light = slope[0] + slope[1] * x[None, :] + slope[2] * y[:, None]
    lit = Texture((texture.pixels * light[..., None]).astype(np.float32), texture.wrap)
    body = Body(body.name, body.mesh, replace(body.material, emission_map=lit), body.world_from_body)
    black = max(veil, 0.0)
    sensor = replace(
        camera.sensor, responsivity=1.0, full_well=255 - black, bit_depth=8, black_level=black, mosaic="mono"
    )
    ready = replace(camera, sensor=sensor, lens=replace(camera.lens, blur=blur), t_exp=1.0)
    return expose(Rasterizer().render(Scene((body,)), ready, samples=16)).pixels[..., 0].astype(np.uint8)


def edges(image: np.ndarray, camera: Camera) -> Edges:
    """Error functions through the profiles across all edges between neighbouring corners, a mean of three lines."""
    grid = BOARD.points.reshape(BOARD.rows, BOARD.columns, 3)
    pairs = [(grid[i, j], grid[i, j + 1]) for i in range(1, BOARD.rows - 1) for j in range(BOARD.columns - 1)]
    pairs += [
        (grid[i, j], grid[i + 1, j]) for i in range(BOARD.rows - 1) for j in range(1, BOARD.columns - 1)
    ]
    place, normal = [], []
    for a, b in pairs:
        ends = camera.project(np.array([a, b]))
        along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
        normal.append([[-along[1], along[0]]])
        place.append(camera.project(a + np.array([[0.35], [0.5], [0.65]]) * (b - a)))
    return across(image, np.array(place), np.array(normal))


def transfer() -> list[str]:
    """The camera of assets/camera_emva1288 characterised, and simulated anew at the real photon numbers."""
    about = emva_data.read(ASSETS / "camera_emva1288/EMVA1288_Data.txt")
    levels = [level(p.t_exp, p.photons, (images.read(i)[..., 0] for i in p.images)) for p in about.points]
    bright, dark = [v for v in levels if v.photons], [v for v in levels if not v.photons]
    size = (about.width, about.height)
    sensor = characterise(bright, dark, about.bits, 9.9, 525, "1", size).sheet.sensor()
    camera = Camera(lens=Lens(f_stop=2.0), sensor=sensor, t_exp=0.02)
    unit = (
        responsivity(camera.lens, sensor)[1] * camera.t_exp / sensor.quantum_efficiency[1]
    )  # photons of L = 1
    lines = [
        "## A camera on an EMVA 1288 bench (12 bits, 525 nm)",
        "",
        f"K {sensor.K:.4f} DN/e-, σ_d {sensor.read_noise:.2f} e-, η {100 * sensor.quantum_efficiency[1]:.1f} % by "
        "`brightfield emva`; frames of that sensor at the real photon numbers.",
        "",
        "| photons | real: mean DN, σ² DN² | twin: mean DN, σ² DN² | mean, twin over real | σ², twin over real |",
        "|---|---|---|---|---|",
    ]
    for real in bright:
        flat = Image(np.full((size[1], size[0], 1), real.photons / unit, np.float32))
        rng = np.random.default_rng(int(real.photons))
        twin = level(0.02, 1, [expose(flat, camera, rng=rng).pixels[..., 0] for _ in range(2)])
        a, b = real.temporal.mean(), twin.temporal.mean()
        shown = f"| {real.photons:.0f} | {real.mu:.1f}, {a:.1f} | {twin.mu:.1f}, {b:.1f} | {twin.mu / real.mu:.4f} |"
        lines.append(f"{shown} {b / a:.3f} |" if a > 1 else f"{shown} saturated |")
    return lines


if __name__ == "__main__":
    main()
