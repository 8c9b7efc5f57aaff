"""Whether captures and scene belong together at all, before anything is fitted."""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.processed.encoded import is_linear
from interchange.camera import Camera
from interchange.effects.response_curve import ResponseCurve
from interchange.problems import BrightfieldError

OVERLAP = 0.2  # least correlation of captures and simulation that a diagnosis can start from
STRUCTURE = 3.0  # a simulation's spread over its noise, from which a correlation says something
STEEPEST = 99.0  # %, of slopes in DN/px that are edges
FAR, SURE = 1.5, 0.1  # px that registration follows; least response of a phase correlation that is believed


def must_overlap(found: Sequence[Condition]) -> None:
    """Raise BrightfieldError for the cameras whose captures are not of what the scene shows them."""
    best: dict[str, float] = {}
    for c in found:
        simulated = c.simulated()
        a, b = c.mean.mean(axis=2)[c.mask], simulated.dn.mean(axis=2)[c.mask]
        noise = float(np.sqrt(simulated.variance[c.mask].mean()))
        if c.lamps and a.std() > 0 and b.std() > STRUCTURE * noise:
            best[c.camera.name] = max(best.get(c.camera.name, -1.0), float(np.corrcoef(a, b)[0, 1]))
    wrong = {name: r for name, r in best.items() if r < OVERLAP}
    if wrong:
        told = " and ".join(f"{name} (correlation {r:.2f} at best)" for name, r in wrong.items())
        raise BrightfieldError(
            f"The captures must show what the scene shows; those of {told} do not. Check the pose of the camera, or "
            f"the order of the images. ({found[0].captures[0].where.file})"
        )


def shifts(found: Sequence[Condition]) -> dict[str, float]:
    """px by which captures lie off their simulation as a whole, for each camera where that is more than registration
    can follow: the median over its conditions. Kuglin, Hines: The phase correlation image alignment method. 1975."""
    own: dict[str, list[tuple[float, float]]] = {}
    for c in found:
        if not c.lamps or min(c.mean.shape[:2]) < 32:
            continue
        window = cv2.createHanningWindow(c.mean.shape[1::-1], cv2.CV_32F)
        simulated = c.simulated()
        planes = []
        for image in (c.mean, simulated.dn):
            gy, gx = np.gradient(cv2.GaussianBlur(image.mean(axis=2).astype(np.float32), (0, 0), 1.5))
            planes.append(np.hypot(gx, gy).astype(np.float32))
        if np.percentile(planes[1], STEEPEST) < np.sqrt(simulated.variance.mean()):
            continue  # no edge that noise does not hide: a pattern of the sensor would be all that is followed
        (dx, dy), response = cv2.phaseCorrelate(planes[1], planes[0], window)
        if response > SURE:
            own.setdefault(c.camera.name, []).append((dx, dy))
    sizes = {name: float(np.hypot(*np.median(np.array(xy), axis=0))) for name, xy in own.items()}
    return {name: size for name, size in sizes.items() if size > FAR}


def with_files_bits(found: Sequence[Condition]) -> list[Condition]:
    """8-bit files of a sensor with more bits are taken as its DN over the whole range: its output is set to 8 bits."""
    return [
        replace(c, camera=replace(c.camera, sensor=replace(c.camera.sensor, output_bit_depth=8)))
        if c.captures[0].bits == 8 and c.camera.sensor.bits_out > 8
        else c
        for c in found
    ]


def notes_on_files(found: Sequence[Condition]) -> list[str]:
    """What 8 bits cost, one sentence each."""
    few = [c for c in found if c.captures[0].bits == 8]
    if not few:
        return []
    sensor = few[0].camera.sensor
    if not is_linear(sensor):
        dark, bright = _steps(few[0].camera)
        return [
            f"8-bit images, by a curve: a step is {dark:.3g} DN of the sensor's {sensor.bit_depth} bits where it is "
            f"darkest and {bright:.3g} DN where it is brightest; effects below that are not found."
        ]
    step = (2**sensor.bit_depth - 1) / 255
    out = [
        f"8-bit images: a step is {step:.3g} DN of the sensor's {sensor.bit_depth} bits, rounding alone makes "
        f"{step / 12**0.5:.2g} DN rms, and a black level is known to half a step; effects below that are not found."
    ]
    out.append(
        "8-bit images are often processed (gamma, white balance, sharpening, JPEG): the scene says sensor:response "
        "linear, and what the camera does to its image counts as an effect here."
    )
    return out


def _steps(camera: Camera) -> tuple[float, float]:
    """Linear DN over which the first step of 8 bits goes above black, and the last below full."""
    sensor = camera.sensor
    linear = np.linspace(sensor.black_level, 2**sensor.bit_depth - 1, 16 * 2**sensor.bit_depth)
    given = ResponseCurve.of(camera).output(linear, sensor.bit_depth, sensor.black_level)
    given *= 255 / given[-1]
    first, last = np.interp([given[0] + 1, 254], given, linear)
    return float(first - linear[0]), float(linear[-1] - last)
