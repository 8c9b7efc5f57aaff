"""A board as a body of a scene: what a camera must see to be calibrated, also a simulated one."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from analysis.calibration.boards.base import Board
from interchange.brdf.lambert import Lambert
from interchange.camera import Camera
from interchange.material import Material, Texture, Wrap
from interchange.mesh import Mesh
from interchange.problems import BrightfieldError
from interchange.scene import Body

BLACK, WHITE = 0.05, 0.85  # of what a printed board reflects, or a screen sends out


def board_body(
    board: Board, fineness: int = 40, world_from_board: np.ndarray | None = None, glows: bool = False
) -> Body:
    """A plane with the board's picture on it, ``fineness`` texels to a square. ``glows``: it sends light out by itself,
    radiance 0.05 and 0.85 W m⁻² sr⁻¹, instead of reflecting these shares of the light that falls on it."""
    picture, ((left, top), (right, bottom)) = board.picture(fineness)
    shares = BLACK + (WHITE - BLACK) * (picture[..., None] / np.float32(255))
    texture = Texture(shares.astype(np.float32), (Wrap.CLAMP, Wrap.CLAMP))
    if glows:
        material = Material("board", Lambert((0.0, 0.0, 0.0)), emission=(1.0, 1.0, 1.0), emission_map=texture)
    else:
        material = Material("board", Lambert((0.5, 0.5, 0.5)), {"diffuse": texture})
    corner = np.array([[left, bottom, 0], [right, bottom, 0], [right, top, 0], [left, top, 0]])
    uv = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    mesh = Mesh(corner, faces, np.tile([0.0, 0, 1], (4, 1)), uv)
    return Body("/board", mesh, material, np.eye(4) if world_from_board is None else world_from_board)


def views_of(
    board: Board, camera: Camera, count: int, rng: np.random.Generator, tilt: tuple[float, float] = (15, 50)
) -> list[np.ndarray]:
    """Poses world_from_camera (4, 4) that show a board at the origin well for a calibration: the whole of it, in every
    part of the image, near and far, turned, and tilted by ``tilt`` degrees."""
    width, height = camera.sensor.resolution
    middle = board.points.mean(axis=0)
    spread = board.points - middle
    margin = 0.04 * min(width, height)  # px around the outer points, for the squares beyond them
    found: list[np.ndarray] = []
    for _ in range(1000 * count):
        if len(found) == count:
            return found
        around, lean, turn = (
            rng.uniform(0, 2 * np.pi),
            np.radians(rng.uniform(*tilt)),
            rng.uniform(-np.pi, np.pi),
        )
        axis = np.array([np.cos(around), np.sin(around), 0])
        R = (
            Rotation.from_rotvec(lean * axis)
            * Rotation.from_rotvec([np.pi, 0, 0])
            * Rotation.from_rotvec([0, 0, turn])
        )
        pixel = rng.uniform([margin, margin], [width - margin, height - margin])
        _, ray = replace(camera, world_from_camera=np.eye(4)).rays(pixel)
        away = np.ptp(spread[:, :2], axis=0).max() * camera.K[0, 0] / width * rng.uniform(1.15, 2.2)
        camera_from_board = np.eye(4)
        camera_from_board[:3, :3] = R.as_matrix()
        camera_from_board[:3, 3] = ray * away - R.as_matrix() @ middle
        world_from_camera = np.linalg.inv(camera_from_board)
        pixels = replace(camera, world_from_camera=world_from_camera).project(board.points)
        if ((pixels > margin) & (pixels < np.array([width, height]) - 1 - margin)).all():
            found.append(world_from_camera)
    raise BrightfieldError(
        f"The camera must be able to see the whole board in each of {count} views; it cannot."
    )
