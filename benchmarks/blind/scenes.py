"""The scenes: a rich inspection bench, a machined part, a plain plate, a circuit board, the sample captures' bench."""

from dataclasses import replace

import numpy as np

from benchmarks.blind.bench import Bench, Lamp, Matter, Part, Sensor, Shot, eye
from benchmarks.blind.sample import sample
from benchmarks.blind.solids import ball, box, rod, sheet, sheets, with_hole

SPOT = 5.0  # mm, radius of an LED: far smaller ones lose digits in an engine of single precision


def turned(degrees: float, x: float = 0, y: float = 0, z: float = 0) -> np.ndarray:
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    return np.array([[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, z], [0, 0, 0, 1]], float)


def shots(lamps: int, repeats: int = 4, poses: int = 1, second: tuple[int, ...] = (0, 2)) -> tuple[Shot, ...]:
    """Each lamp alone; all lamps, repeated; a quarter of the exposure; all dark; the second camera."""
    every = tuple(range(lamps))
    plan = [Shot(0, 0, (k,), 1.0) for k in every]
    plan += [Shot(0, 0, every, 0.4, repeats), Shot(0, 0, every, 0.1, 2), Shot(0, 0, (), 1.0)]
    for pose in range(1, poses):
        plan += [Shot(0, pose, every, 0.4), Shot(0, pose, (0,), 1.0)]
    plan += [Shot(1, 0, every, 0.4, 2), *(Shot(1, 0, (k,), 1.0) for k in second)]
    return tuple(plan)


def rich() -> Bench:
    """Checkerboard, colour patches, a box, a plastic rod, a metal ball, a red wall: edges, shadows, highlights."""
    matters = (
        Matter("base", "Lambert", (0.42, 0.42, 0.42)),
        Matter("white", "Lambert", (0.76, 0.76, 0.75)),
        Matter("black", "Lambert", (0.05, 0.05, 0.05)),
        Matter("red", "Lambert", (0.55, 0.09, 0.07)),
        Matter("green", "Lambert", (0.11, 0.42, 0.14)),
        Matter("blue", "Lambert", (0.07, 0.13, 0.48)),
        Matter("card", "Lambert", (0.62, 0.58, 0.5)),
        Matter("plastic", "Lafortune", (0.1, 0.3, 0.34), (((0.5, 0.5, 0.5), (-1.0, -1.0, 1.0), 40.0),)),
        Matter("metal", "Lafortune", (0.14, 0.14, 0.15), (((0.9, 0.9, 0.94), (-0.98, -0.98, 0.99), 18.0),)),
    )
    cells = [(-120 + 12 * i, -80 + 12 * j, -108 + 12 * i, -68 + 12 * j) for i in range(6) for j in range(5)]
    dark = [c for k, c in enumerate(cells) if (k // 5 + k % 5) % 2]
    light = [c for k, c in enumerate(cells) if not (k // 5 + k % 5) % 2]
    parts = [
        Part("base", sheet(-170, -130, 170, 130), "base"),
        Part("board_white", sheets(light, 0.05), "white"),
        Part("board_black", sheets(dark, 0.05), "black"),
        *(
            Part(f"patch_{n}", sheet(20 + 22 * k, -78, 38 + 22 * k, -60, 0.05), n)
            for k, n in enumerate(("red", "green", "blue", "white", "black"))
        ),
        Part("box", box(44, 30, 34).moved(-70, 35, 0, 24), "card"),
        Part("rod", rod(15, 38).moved(15, 25, 0), "plastic"),
        Part("ball", ball(20).moved(70, -12, 20), "metal"),
        Part("wall", box(10, 90, 46).moved(120, 30, 0), "red"),
    ]
    lamps = (
        Lamp("LED0", (-180, -140, 280), SPOT, 36),
        Lamp("LED1", (170, -120, 300), SPOT, 36),
        Lamp("LED2", (-60, 170, 320), SPOT, 36),
        Lamp("LED3", (10, -60, 420), SPOT, 60),
    )
    eyes = (
        eye("Camera0", (30, -390, 480), (0, -5, 5), 2.25),
        eye("Camera1", (330, -230, 440), (10, -5, 10), 2.25, 4),
    )
    return Bench("rich", matters, tuple(parts), lamps, eyes, Sensor(330.0), shots(4))


def metal() -> Bench:
    """A milled block with a pocket, a boss, a step and pins on a dark cloth, in two poses."""
    lobe = ((0.7, 0.7, 0.72), (-0.97, -0.97, 0.99), 14.0)
    matters = (
        Matter("cloth", "Lambert", (0.16, 0.16, 0.17)),
        Matter("steel", "Lafortune", (0.2, 0.2, 0.21), (lobe,)),
        Matter("brass", "Lafortune", (0.24, 0.17, 0.06), (((0.75, 0.6, 0.3), (-0.99, -0.99, 0.98), 22.0),)),
        Matter("tag", "Lambert", (0.46, 0.46, 0.44)),
    )
    here = (turned(8), turned(47, 10, -6))
    parts = (
        Part("table", sheet(-180, -140, 180, 140), "cloth"),
        Part("block", with_hole(130, 90, 26, 26, 14), "steel", here),
        Part("step", box(34, 90, 12).moved(-48, 0, 26), "steel", here),
        Part("boss", rod(14, 44).moved(46, 24, 0), "steel", here),
        Part("pin", rod(6, 40).moved(46, -26, 0), "brass", here),
        Part("label", sheet(-62, -36, -36, 36, 38.05), "tag", here),
        Part("scale", sheets([(-110 + 10 * k, -92, -105 + 10 * k, -74) for k in range(20)], 0.05), "tag"),
    )
    lamps = (
        Lamp("LED0", (-200, -80, 260), SPOT, 34),
        Lamp("LED1", (200, -60, 260), SPOT, 34),
        Lamp("LED2", (0, 200, 280), SPOT, 34),
        Lamp("LED3", (40, -20, 430), SPOT, 54),
    )
    eyes = (
        eye("Camera0", (-40, -330, 480), (0, 0, 14), 2.3),
        eye("Camera1", (-320, -200, 430), (0, 0, 14), 2.3, -5),
    )
    return Bench("metal", matters, parts, lamps, eyes, Sensor(360.0), shots(4, poses=2))


def plate() -> Bench:
    """A matte plate that fills the view: most causes look alike here, by design."""
    matters = (Matter("paint", "Lambert", (0.52, 0.5, 0.47)),)
    parts = (Part("plate", sheet(-300, -300, 300, 300), "paint"),)
    lamps = (
        Lamp("LED0", (-170, -120, 300), SPOT, 40),
        Lamp("LED1", (180, -90, 280), SPOT, 40),
        Lamp("LED2", (20, 190, 340), SPOT, 44),
    )
    eyes = (
        eye("Camera0", (0, -250, 480), (0, 0, 0), 2.2),
        eye("Camera1", (260, 120, 460), (5, 0, 0), 2.2, 30),
    )
    return Bench("plate", matters, parts, lamps, eyes, Sensor(560.0), shots(3))


def board() -> Bench:
    """Green varnish with a soft pattern in it, copper tracks, tinned pads, chips, connectors, silk print."""
    rng = np.random.default_rng(20)
    coarse = rng.normal(size=(9, 12))
    grid = [np.linspace(0, n - 1.001, 64) for n in coarse.shape]
    i, j = (np.floor(g).astype(int) for g in grid)
    ti, tj = (g - np.floor(g) for g in grid)
    ti, tj = (t * t * (3 - 2 * t) for t in (ti, tj))
    rows = coarse[i] * (1 - ti)[:, None] + coarse[i + 1] * ti[:, None]
    soft = rows[:, j] * (1 - tj) + rows[:, j + 1] * tj
    green = np.array([0.08, 0.3, 0.12]) * (1 + 0.08 * soft[..., None])
    matters = (
        Matter("tray", "Lambert", (0.35, 0.36, 0.4)),
        Matter("varnish", "Lambert", (0.08, 0.3, 0.12), texture=green.astype(np.float32)),
        Matter("track", "Lambert", (0.13, 0.4, 0.16)),
        Matter("tin", "Lafortune", (0.34, 0.34, 0.34), (((0.5, 0.5, 0.5), (-0.97, -0.97, 0.98), 10.0),)),
        Matter("chip", "UsdPreviewSurface", (0.05, 0.05, 0.055), roughness=0.55),
        Matter("plug", "Lambert", (0.72, 0.7, 0.62)),
        Matter("silk", "Lambert", (0.7, 0.7, 0.68)),
    )
    top = 1.6
    tracks = [(-95 + 9 * k, -60 + 4 * (k % 3), -92 + 9 * k, 10 + 7 * (k % 4)) for k in range(10)]
    tracks += [(-10, 30 + 6 * k, 60 + 5 * k, 32.4 + 6 * k) for k in range(6)]
    pads = [
        (x, y + dy, x + 3.2, y + dy + 5) for x in np.arange(15, 70, 6.5) for y, dy in ((-42, 0), (-42, 27))
    ]
    pads += [(x, y, x + 5, y + 5) for x in np.arange(-100, -40, 10.0) for y in (30, 42, 54)]
    silk = [(20 + 5 * k, -58, 20 + 5 * k + (3.4 if k % 3 else 2), -50) for k in range(9)]
    silk += [(-30, -8, -8, -6), (-30, 8, -8, 10), (-30, -6, -28, 8), (-10, -6, -8, 8)]
    parts = (
        Part("tray", sheet(-170, -130, 170, 130), "tray"),
        Part("board", box(220, 150, top), "track"),
        Part("face", sheet(-110, -75, 110, 75, top + 0.02), "varnish"),
        Part("tracks", sheets(tracks, top + 0.06), "track"),
        Part("pads", sheets(pads, top + 0.1), "tin"),
        Part("silk", sheets(silk, top + 0.1), "silk"),
        Part("chip", box(56, 20, 5).moved(44, -26, top), "chip"),
        Part("small", box(16, 10, 4).moved(-19, 1, top), "chip"),
        Part("plug", box(18, 52, 16).moved(92, 30, top), "plug"),
        Part("can", rod(9, 18).moved(-62, -40, top), "tin"),
    )
    lamps = (
        Lamp("LED0", (-190, 0, 240), SPOT, 36),
        Lamp("LED1", (120, -190, 260), SPOT, 36),
        Lamp("LED2", (110, 180, 280), SPOT, 36),
        Lamp("LED3", (-250, -120, 110), SPOT, 30),
    )
    eyes = (
        eye("Camera0", (10, -260, 520), (0, 0, 2), 2.2),
        eye("Camera1", (-280, -160, 470), (0, 0, 2), 2.2, 6),
    )
    return Bench("board", matters, parts, lamps, eyes, Sensor(420.0), shots(4))


SCENES = {"rich": rich, "metal": metal, "plate": plate, "board": board, "sample": sample}


def scene(name: str, size: tuple[int, int] | None = None) -> Bench:
    """``size``: (columns, rows) px of the captures; None: the scene's own."""
    bench = SCENES[name]()
    return replace(bench, size=size or bench.size)
