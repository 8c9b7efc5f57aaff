"""Lamps of machine vision made of parts: ring, dark-field ring, bar, line, backlight, dome, coaxial light.

Each builder takes its ``power`` in W (``colorimetry.watts_of`` brings lumens there) and returns a tuple of ``Light``
whose powers add up to it. A device's frame has z along its axis towards the side that the camera stands on, and it
shines along -z; ``world_from_lamp`` places it. ``beam``: an LED's own profile, as of a data sheet, else it is
Lambertian.
"""

from dataclasses import replace

import numpy as np

from interchange.camera import Camera
from interchange.lamps.placing import HERE, WHITE, Color, aimed, circle, require, share_power
from interchange.light import Light, LightKind, Profile
from interchange.power import intensity_from_power
from interchange.problems import BrightfieldError

RIGHT = np.pi / 2


def ring(
    power: float,
    radius: float,
    count: int = 24,
    tilt: float = 0.0,
    led_radius: float = 2.5e-3,
    beam: Profile | None = None,
    color: Color = WHITE,
    world_from_lamp: np.ndarray = HERE,
    name: str = "/ring",
) -> tuple[Light, ...]:
    """``count`` LEDs on a circle of ``radius`` m in z = 0, each turned by ``tilt`` rad from -z towards the axis."""
    require("A ring's radius", radius, 0)
    if count < 1 or not 0 <= tilt < np.pi:
        raise BrightfieldError(
            f"A ring must have one LED or more, tilted by 0 to 180 degrees; got {count}, {np.degrees(tilt):g}."
        )
    lights = []
    for k, place in enumerate(circle(count, radius)):
        inwards = -place / radius
        along = np.sin(tilt) * inwards + np.cos(tilt) * np.array([0.0, 0, -1])
        pose = world_from_lamp @ aimed(place, place + along)
        lights.append(Light(f"{name}/led{k}", LightKind.DISK, WHITE, pose, radius=led_radius, profile=beam))
    return share_power(lights, power, color)


def dark_field_ring(
    power: float,
    radius: float,
    elevation: float = np.radians(15),
    count: int = 48,
    led_radius: float = 1.5e-3,
    beam: Profile | None = None,
    color: Color = WHITE,
    world_from_lamp: np.ndarray = HERE,
    name: str = "/dark_field",
) -> tuple[Light, ...]:
    """A ring whose light meets the object's plane at ``elevation`` rad above it: what is flat and bright throws it past
    the camera. The ring's plane is z = 0; its axes meet in z = -radius tan(elevation)."""
    if not 0 < elevation < RIGHT:
        raise BrightfieldError(
            f"Dark field must come in between 0 and 90 degrees above the plane; got {np.degrees(elevation):g}."
        )
    return ring(power, radius, count, RIGHT - elevation, led_radius, beam, color, world_from_lamp, name)


def bar(
    power: float,
    length: float,
    width: float,
    rows: int = 0,
    columns: int = 0,
    led_radius: float = 2.5e-3,
    beam: Profile | None = None,
    color: Color = WHITE,
    world_from_lamp: np.ndarray = HERE,
    name: str = "/bar",
) -> tuple[Light, ...]:
    """A bar of ``length`` along x and ``width`` along y, m: ``rows`` by ``columns`` of LEDs, or, without them, one
    Lambertian face, as a diffuser makes it."""
    require("A bar's length", length, 0)
    require("A bar's width", width, 0)
    if not rows * columns:
        face = Light(name, LightKind.RECT, WHITE, np.array(world_from_lamp), width=length, height=width)
        return share_power([face], power, color)
    lights = []
    for i in range(rows):
        for j in range(columns):
            pose = np.array(world_from_lamp, np.float64)
            place = [((j + 0.5) / columns - 0.5) * length, ((i + 0.5) / rows - 0.5) * width, 0.0, 1.0]
            pose[:3, 3] = (world_from_lamp @ place)[:3]
            led = f"{name}/led{i * columns + j}"
            lights.append(Light(led, LightKind.DISK, WHITE, pose, radius=led_radius, profile=beam))
    return share_power(lights, power, color)


def line(
    power: float,
    length: float,
    width: float,
    half_angle: float = np.radians(10),
    color: Color = WHITE,
    world_from_lamp: np.ndarray = HERE,
    name: str = "/line",
) -> tuple[Light, ...]:
    """A narrow face along x behind a lens: its radiant intensity has fallen to half at ``half_angle`` rad from the
    axis, as a power of the cosine."""
    require("A line light's half angle", half_angle, 0, np.pi / 3, "rad")
    focus = np.log(0.5) / np.log(np.cos(half_angle)) - 1  # a face has one cosine by itself
    (face,) = bar(power, length, width, color=color, world_from_lamp=world_from_lamp, name=name)
    return share_power([replace(face, focus=max(float(focus), 0.0))], power, color)


def backlight(
    power: float,
    width: float,
    height: float,
    color: Color = WHITE,
    world_from_lamp: np.ndarray = HERE,
    name: str = "/backlight",
) -> tuple[Light, ...]:
    """A Lambertian face that the camera sees itself, behind the object; it shines along -z, so turn that to the
    camera."""
    (face,) = bar(power, width, height, color=color, world_from_lamp=world_from_lamp, name=name)
    return (replace(face, visible=True),)


def dome(
    power: float,
    radius: float,
    hole: float = 0.0,
    color: Color = WHITE,
    world_from_lamp: np.ndarray = HERE,
    name: str = "/dome",
) -> tuple[Light, ...]:
    """A white half-sphere of ``radius`` m above z = 0 with a camera's hole of diameter ``hole`` m at the top, evenly
    bright inside; ``power`` leaves it through its base.

    At its centre light comes with the same radiance from everywhere but the hole, L = P / (π² R² cos² θ_h) with
    sin θ_h = hole / 2R. It is drawn as from far away: right for objects that are small against the radius.
    """
    require("A dome's radius", radius, 0)
    if not 0 <= hole < 2 * radius:
        raise BrightfieldError(
            f"A dome's hole must be smaller than the dome, {2 * radius:g} m; got {hole:g} m."
        )
    edge = float(np.arcsin(hole / 2 / radius))
    angles = [0.0, edge, edge + 1e-5, RIGHT] if edge > 0 else [0.0, RIGHT]
    open_at = [0.0, 0.0, 1.0, 1.0] if edge > 0 else [1.0, 1.0]
    light = Light(
        name,
        LightKind.DOME,
        WHITE,
        np.array(world_from_lamp, np.float64),
        cone_angle=RIGHT,
        profile=Profile(np.zeros(1), np.array(angles), np.array([open_at])) if edge > 0 else None,
    )
    return (replace(light, intensity=intensity_from_power(light, power, color, area=np.pi * radius**2)),)


def coaxial(
    power: float,
    camera: Camera,
    width: float,
    height: float,
    distance: float = 0.0,
    reflectance: float = 0.5,
    color: Color = WHITE,
    name: str = "/coaxial",
) -> tuple[Light, ...]:
    """Light along the camera's axis: the mirror image of a Lambertian face in a beam splitter.

    ``power``: W of the face itself, of which the splitter throws the share ``reflectance`` to the object; the tuple
    has ``power · reflectance``. ``distance``: m from the camera along its axis to the image of the face, which hides
    nothing. The camera looks through the splitter, too: ``through_splitter``.
    """
    require("A beam splitter's reflectance", reflectance, 0, 1, "")
    pose = np.array(camera.world_from_camera, np.float64)
    pose[:3, :3] = pose[:3, :3] @ np.diag(
        [1.0, -1.0, -1.0]
    )  # the camera looks along +z, a lamp shines along -z
    pose[:3, 3] += distance * camera.world_from_camera[:3, 2]
    return bar(power * reflectance, width, height, color=color, world_from_lamp=pose, name=name)


def through_splitter(camera: Camera, transmittance: float = 0.5) -> Camera:
    """The camera behind a beam splitter that lets the share ``transmittance`` of the light through."""
    require("A beam splitter's transmittance", transmittance, 0, 1, "")
    lens = replace(camera.lens, transmission=camera.lens.transmission * transmittance)
    sensor = replace(camera.sensor, responsivity=camera.sensor.responsivity * transmittance)
    return replace(camera, lens=lens, sensor=sensor)
