"""How true lamps are: prints the figures of docs/lamps.md; or draws its picture: --picture docs/lamps.png."""

import argparse
from pathlib import Path

import numpy as np

from interchange.brdf.cook_torrance import CookTorrance
from interchange.brdf.lambert import Lambert
from interchange.camera import Camera, Lens, Projection, Sensor
from interchange.colorimetry import chromaticity, luminous_efficacy
from interchange.distortion import LensModel
from interchange.formats import gprims
from interchange.formats.images import encode_srgb, write_png
from interchange.frames import look_at
from interchange.illuminants import STEFAN_BOLTZMANN, black_body, illuminant, led
from interchange.lamps import composite
from interchange.lamps.placing import total_power
from interchange.lamps.projecting import projector, stripes
from interchange.lamps.reflector import ReflectorDevice
from interchange.material import Material
from interchange.scene import Body, Scene
from offline.renderers.cycles import Cycles
from offline.settings import CyclesSettings
from realtime.renderers.rasterizer import Rasterizer

DIRECT = CyclesSettings(samples=64, max_bounces=0)
RHO = 0.5
MATTE = Material("matte", Lambert(RHO))
PUBLISHED = {
    "A": (0.44758, 0.40745),
    "D65": (0.31272, 0.32903),
    "FL2": (0.3721, 0.3751),
    "LED-B3": (0.3756, 0.3723),
}
LENSES = {
    "pinhole": Lens(8e-3),
    "14 parameters": Lens(
        8e-3,
        distortion=(-0.25, 0.1, 0.003, -0.002, 0.02, 0.03, -0.01, 0.004, 0.002, 0, -0.003, 0, 0.03, -0.02),
    ),
    "fisheye": Lens(6e-3, distortion=(0.06, -0.01, 0.0, 0.0), model=LensModel.FISHEYE),
}


def above(width: float, pixels: int) -> Camera:
    pose = look_at(np.array([0, 0, 1.0]), np.zeros(3), up=(0, 1, 0))
    pitch = width / pixels
    return Camera(
        "/above", pose, Lens(projection=Projection.ORTHOGRAPHIC), Sensor((pixels, pixels), (pitch, pitch))
    )


def on_floor(camera: Camera, pixels: np.ndarray) -> np.ndarray:
    origin, direction = camera.rays(pixels)
    return origin - direction * (origin[..., 2:] / direction[..., 2:])


def at(x: float, y: float, z: float) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    return pose


def spectra() -> None:
    for name, published in PUBLISHED.items():
        off = np.abs(chromaticity(illuminant(name)) - published).max()
        print(f"{name}: x, y off by {off:.1e}, {luminous_efficacy(illuminant(name)):.1f} lm/W")
    total = black_body(3000, np.geomspace(50, 1e6, 20001)).integral() / (STEFAN_BOLTZMANN * 3000**4)
    print(
        f"black body / Stefan-Boltzmann - 1: {total - 1:.1e}; 555 nm: {luminous_efficacy(led(555, 0.2)):.3f} lm/W"
    )


def projected(render) -> None:
    """Where edges fall, px of the projector, against Camera.project."""
    view = above(0.3, 300)
    for name, lens in LENSES.items():
        pose = look_at(np.array([0.05, -0.25, 0.4]), np.array([0.0, 0.02, 0.0]))
        camera = Camera("/p", pose, lens, Sensor((64, 48), (1e-4, 1e-4)), principal_point=(30.0, 25.5))
        white = np.ones((48, 64, 1), np.float32)
        striped = white * ((np.arange(64) // 8) % 2 == 0)[None, :, None]
        images = [
            render(
                Scene((Body("/f", gprims.plane(1, 1), MATTE),), (projector(camera, i, intensity=1.0),)), view
            )
            for i in (white, striped)
        ]
        pixels = camera.project(on_floor(view, np.stack(np.meshgrid(np.arange(300.0), np.arange(300.0)), -1)))
        well = ((pixels > 2) & (pixels < (61, 45))).all(axis=-1)
        lit = images[0][..., 0]
        ratio = np.where(well, images[1][..., 0] / np.where(lit > 0, lit, 1), np.nan)
        low, high = ratio[:, :-1], ratio[:, 1:]
        row, column = np.nonzero((low - 0.5) * (high - 0.5) < 0)
        share = (0.5 - low[row, column]) / (high - low)[row, column]
        found = camera.project(on_floor(view, np.stack([column + share, row], -1)))[:, 0]
        off = (found + 4.5) % 8 - 4
        print(f"  {name}: {len(off)} edges, rms {off.std():.4f} px, worst {np.abs(off).max():.4f} px")


def reflector(render) -> None:
    device = ReflectorDevice()
    view = above(0.030, 30)
    for theta in np.linspace(*device.polar_range, 6)[:5]:
        scene = Scene((Body("/f", gprims.plane(0.2, 0.2), MATTE),), device.lights(0.7, theta))
        E = render(scene, view)[..., 1] * np.pi / RHO
        expected = float(device.irradiance(theta)) * np.cos(theta)
        field = np.hypot(
            *np.moveaxis(on_floor(view, np.stack(np.meshgrid(*[np.arange(30.0)] * 2), -1))[..., :2], -1, 0)
        )
        middle, round_about = E[field < 0.002].mean(), E[field < 0.0075]
        print(
            f"  theta {np.degrees(theta):5.1f} deg: E(0) {middle / expected - 1:+.2%} of the closed form, "
            f"15 mm across {round_about.min() / middle:.3f} to {round_about.max() / middle:.3f}, "
            f"90 % within {1000 * device.even_field(theta):.1f} mm across the beam"
        )


def devices(live, true) -> None:
    view = above(0.02, 32)
    part = Body("/b", gprims.box(0.006), MATTE, at(0.002, 0, 0.003))
    for name, lights in {
        "ring": composite.ring(0.5, 0.05, 16, 0.5, world_from_lamp=at(0, 0, 0.08)),
        "dark field": composite.dark_field_ring(0.5, 0.04, count=12, world_from_lamp=at(0, 0, 0.01)),
        "bar": composite.bar(0.5, 0.1, 0.02, world_from_lamp=at(0, 0, 0.1)),
        "line": composite.line(0.5, 0.1, 0.002, world_from_lamp=at(0, 0, 0.1)),
        "dome": composite.dome(0.5, 0.08, 0.03),
        "coaxial": composite.coaxial(1.0, view, 0.03, 0.03, 0.8),
        "projector": (projector(Camera("/p", look_at(np.array([0.05, -0.03, 0.1]), np.zeros(3)), Lens(16e-3),
                                       Sensor((64, 48), (5e-5, 5e-5))), stripes((64, 48), 8), power=0.05),),
    }.items():  # fmt: skip
        scene = Scene((Body("/f", gprims.plane(0.2, 0.2), MATTE), part), lights)
        a, b = live(scene, view), true(scene, view)
        power = "" if name == "dome" else f", {total_power(lights).mean():.6f} W"
        apart = np.abs(a - b).mean() / b.mean()
        print(f"  {name}: mean {a.mean() / b.mean() - 1:+.2%}, mean difference {apart:.2%}{power}")


def picture(live, true) -> np.ndarray:
    """(2 · 96, 8 · 128) uint8: a glossy ball and a matt box under eight lamps; both renderers, each lamp by its own
    brightest hundredth."""
    pose = look_at(np.array([0, -0.06, 0.12]), np.array([0, 0, 0.003]))
    view = Camera("/v", pose, Lens(16e-3), Sensor((128, 96), (40e-6, 40e-6)))
    bodies = (
        Body("/floor", gprims.plane(0.3, 0.3), MATTE),
        Body(
            "/ball",
            gprims.sphere(0.008),
            Material("gloss", CookTorrance(diffuse=0.1, s=0.5, m=0.15)),
            at(-0.012, 0.0, 0.008),
        ),
        Body("/box", gprims.box(0.01), Material("white", Lambert(0.8)), at(0.012, -0.004, 0.005)),
    )
    device, to_side = ReflectorDevice(), look_at(np.array([0.06, -0.04, 0.1]), np.zeros(3))
    panel = Camera("/p", to_side, Lens(16e-3), Sensor((64, 48), (1.2e-4, 1.2e-4)))
    above_all = Camera("/c", look_at(np.array([0, -0.045, 0.09]), np.zeros(3)), Lens(16e-3))
    lamps = (
        device.lights(0.7, np.radians(20)),
        device.lights(2.4, np.radians(40)),
        device.lights(4.0, np.radians(65)),
        (projector(panel, stripes((64, 48), 12), power=0.05),),
        composite.ring(0.5, 0.03, 24, 0.3, world_from_lamp=at(0, 0, 0.08)),
        composite.dark_field_ring(0.5, 0.05, count=24, world_from_lamp=at(0, 0, 0.0134)),
        composite.dome(0.5, 0.08, 0.03),
        composite.coaxial(1.0, above_all, 0.03, 0.03, 0.05),
    )
    columns = []
    for lights in lamps:
        a, b = (render(Scene(bodies, lights), view)[..., 1] for render in (live, true))
        shown = encode_srgb(np.clip(np.vstack([a, b]) / np.quantile(b, 0.99), 0, 1))
        columns.append(np.rint(255 * shown).astype(np.uint8))
    return np.hstack(columns)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--picture", type=Path)
    args = parser.parse_args()
    if args.picture is None:
        spectra()
    with Rasterizer() as rasterizer, Cycles() as cycles:

        def live(scene: Scene, camera: Camera) -> np.ndarray:
            return rasterizer.render(scene, camera, samples=64).pixels

        def true(scene: Scene, camera: Camera) -> np.ndarray:
            return cycles.render(scene, camera, DIRECT).pixels

        if args.picture is not None:
            write_png(args.picture, picture(live, true)[..., None])
            return
        for name, render in (("rasteriser", live), ("path tracer", true)):
            print(f"{name}: projected edges")
            projected(render)
            print(f"{name}: reflector device")
            reflector(render)
        print("rasteriser beside path tracer")
        devices(live, true)


if __name__ == "__main__":
    main()
