"""Effects that show in which DN occur: fewer bits than claimed, a lower full well."""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.noise.finding import NoiseFinding, Number, certainty
from analysis.gap.sensor.expected import noise_variance

COMB = 1.4  # DN from one value that occurs to the next, from which on it is a comb
LEAST_VALUES = 24  # that must occur
LEAST_LEVELS = 12  # that must lie between the lowest and the highest code, for a period to be told
FINE = 16  # frequencies that are looked at, for each of the counts' own
TOGETHER = 0.8  # mean resultant length of codes that come again
SPIKE = 5.0  # times as many pixels as at the DN below, at which an image is cut off
LEAST_CUT = 30  # pixels
# that a full well must lie below the data sheet's: a black level 1 DN off lowers the cut as well
LEAST_LOWER = 0.01
SURELY = 0.9  # probability of steps, from which on everything else is judged with them


def code_findings(conditions: Sequence[Condition], simulations: Sequence[np.ndarray]) -> list[NoiseFinding]:
    """Of quantization and saturation, those that the captures' files let be judged."""
    found: dict[str, NoiseFinding] = {}
    for camera in dict.fromkeys(c.camera.name for c in conditions):
        pairs = zip(conditions, simulations, strict=True)
        own = [(c, s) for c, s in pairs if c.camera.name == camera and c.captures[0].has_codes]
        if not own:
            continue
        of, said = [c for c, _ in own], [s for _, s in own]
        told = [quantization(of), saturation(of, said)]
        for f in told:  # of several cameras the one that says most
            if f is not None and (f.name not in found or f.probability > found[f.name].probability):
                found[f.name] = f
    return list(found.values())


def with_steps(conditions: Sequence[Condition]) -> list[Condition]:
    """The conditions with the step from one code to the next that their camera's files surely have."""
    steps: dict[str, float] = {}
    for camera in dict.fromkeys(c.camera.name for c in conditions):
        own = [c for c in conditions if c.camera.name == camera and c.captures[0].has_codes]
        told = quantization(own) if own else None
        if told is not None and told.probability > SURELY:
            steps[camera] = 2.0 ** (own[0].camera.sensor.bits_out - told.parameters["bits"].value)
    return [replace(c, step=steps.get(c.camera.name, 1.0)) for c in conditions]


def quantization(conditions: Sequence[Condition]) -> NoiseFinding | None:
    """Of the DN between the first and the last percentile, how many occur, against how many would if DN were drawn from
    the histogram smoothed over 64 of them; the step is their period, as codes may lie a DN beside the steps'."""
    sensor = conditions[0].camera.sensor
    top = 2**sensor.bits_out - 1
    counts = np.zeros(top + 1)
    for c in conditions:
        for capture in c.captures:
            values = np.clip(capture.pixels[c.mask], 0, top).astype(np.int64).reshape(-1)
            counts += np.bincount(values, minlength=top + 1)
    cumulative = np.cumsum(counts) / counts.sum()
    low, high = int(np.searchsorted(cumulative, 0.01)), int(np.searchsorted(cumulative, 0.99))
    inside = counts[low : high + 1]
    if len(inside) < LEAST_VALUES:
        return None
    smooth = np.maximum(cv2.blur(inside[:, None], (1, min(64, len(inside)))).reshape(-1), 0)
    likely = 1 - np.exp(-smooth)
    expected, occur = float(likely.sum()), float((inside > 0).sum())
    if expected < LEAST_VALUES:
        return None
    step = expected / max(occur, 1.0)
    spread = np.sqrt(float((likely * (1 - likely)).sum()) + (0.03 * expected) ** 2)
    z = max((expected - occur) / spread, 0.0)
    log_odds = 0.5 * z**2 - 3 if step >= COMB else -3.0
    off = spread / max(occur, 1.0)
    if step >= COMB and (found := _period(counts[1:-1], step)) is not None:
        step, off = found, found / FINE / top
    bits = sensor.bits_out - float(np.log2(max(step, 1.0)))
    numbers = {"bits": Number(bits, float(off / np.log(2)), "1")}
    return NoiseFinding("quantization", certainty(log_odds), numbers)


def _period(counts: np.ndarray, least: float) -> float | None:
    """The longest distance, DN, from ``least`` on at which codes come again: all their phases lie together, |Σ n_k
    exp(2πi k / P)| / Σ n_k near 1, which parts of it share and multiples do not. None where codes are too few to tell,
    or nothing comes again.

    Mardia, Jupp: Directional statistics. Wiley 2000 (mean resultant length).
    """
    codes = np.flatnonzero(counts)
    longest = float(codes[-1] - codes[0]) / LEAST_LEVELS
    length = FINE * len(counts)
    first, last = int(np.ceil(length / max(longest, 1.0))), int(min(length / (0.9 * least), length / 2))
    along = np.abs(np.fft.rfft(counts, length)) / counts.sum()
    alike = along[first : last + 1] > TOGETHER
    if last < first or not alike.any():
        return None
    near = first + int(np.argmax(alike))
    end = near + int(np.argmin(np.append(alike, False)[near - first :]))  # of the longest ones that are alike
    return length / (near + int(np.argmax(along[near:end])))


def saturation(conditions: Sequence[Condition], simulations: Sequence[np.ndarray]) -> NoiseFinding | None:
    """The highest DN of a channel lies below the sensor's and holds many more pixels than those below it, where the
    simulation is brighter still. None where nothing is bright enough to tell."""
    sensor = conditions[0].camera.sensor
    cut = flat_top(conditions, simulations)
    brightest = max(
        float(s[c.mask].max()) for c, s in zip(conditions, simulations, strict=True) if c.mask.any()
    )
    if cut is None:
        if brightest < 0.5 * (2**sensor.bits_out - 1):
            return None
        return NoiseFinding("saturation", certainty(-3.0), {"full_well": Number(sensor.full_well, 0.0, "e-")})
    level, pixels = cut
    if level > (1 - LEAST_LOWER) * (2**sensor.bits_out - 1):
        return NoiseFinding("saturation", certainty(-3.0), {"full_well": Number(sensor.full_well, 0.0, "e-")})
    of_the_converter = level * (2**sensor.bit_depth - 1) / (2**sensor.bits_out - 1)
    full = (of_the_converter - sensor.black_level) / sensor.K
    log_odds = min(pixels / 10, 50.0) - 3
    return NoiseFinding(
        "saturation",
        certainty(log_odds),
        {"full_well": Number(full, float(1 / np.sqrt(12) / sensor.K), "e-")},
    )


def flat_top(conditions: Sequence[Condition], simulations: Sequence[np.ndarray]) -> tuple[float, int] | None:
    """The DN below the highest that an image is cut off at, and how many pixels are. None where it is not.

    Nothing at and above it can be compared: it would be taken for a response curve.
    """
    top = 2 ** conditions[0].camera.sensor.bits_out - 1
    level = max((float(c.captures[0].pixels[c.mask].max()) for c in conditions if c.mask.any()), default=top)
    if level >= top:
        return None
    at, below, brighter = 0, np.zeros(12), 0
    surely = 1.02 * level + 3 * float(np.sqrt(noise_variance(np.array([level]), conditions[0].camera)[0][0]))
    for c, simulation in zip(conditions, simulations, strict=True):
        for capture in c.captures:
            values = capture.pixels[c.mask]
            here = values >= level
            at += int(here.sum())
            brighter += int((simulation[c.mask][here] > surely).sum())
            below += np.array([((values >= level - k - 1) & (values < level - k)).sum() for k in range(12)])
    if at < LEAST_CUT or at < SPIKE * max(float(below.mean()), 1.0) or brighter < max(LEAST_CUT, 0.3 * at):
        return None
    return level, at


def without_flat_tops(conditions: Sequence[Condition]) -> list[Condition]:
    """The conditions without the pixels, and their neighbours within 3 px, at which a camera's images are cut off."""
    cut: dict[str, float | None] = {}
    for camera in dict.fromkeys(c.camera.name for c in conditions):
        own = [c for c in conditions if c.camera.name == camera and c.captures[0].has_codes]
        told = flat_top(own, [c.simulated().dn for c in own]) if own else None
        cut[camera] = None if told is None else told[0]
    return [c if (level := cut[c.camera.name]) is None else _below(c, level) for c in conditions]


def _below(c: Condition, level: float) -> Condition:
    hot = np.any([x.pixels.max(axis=2) >= level for x in c.captures], axis=0)
    wide = cv2.dilate(hot.astype(np.uint8), np.ones((7, 7), np.uint8)) > 0
    return replace(c, mask=c.mask & ~wide)
