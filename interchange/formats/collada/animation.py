"""COLLADA's animation curves: which element's numbers change, and their values at any time.

LINEAR and STEP curves are kept by their keys; BEZIER and HERMITE are sampled ``SAMPLES_PER_FRAME`` times a frame.
A step is a pair of USD samples ``STEP_WIDTH`` frames apart. One time code is one frame.
"""

import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from interchange.formats.collada.library import Library
from interchange.formats.collada.source import Sources

FRAMES_PER_SECOND = 24.0  # where the file does not say
SAMPLES_PER_FRAME = 4
STEP_WIDTH = 1e-3  # frames
SNAP = 1e-4  # frames: keys so near to a whole frame stand on it, for seconds are rounded in the XML
MOST_SAMPLES = 100_000
MEMBERS = {
    "X": 0, "Y": 1, "Z": 2, "W": 3, "R": 0, "G": 1, "B": 2, "A": 3,
    "U": 0, "V": 1, "S": 0, "T": 1, "P": 2, "Q": 3, "ANGLE": 3,
}  # fmt: skip


@dataclass(frozen=True)
class Curve:
    """``keys`` (K,) frames, rising; ``values`` (K, w). ``left``/``right`` (K, w, 2): BEZIER control points
    (frame, value) before and after each key. ``kind`` (K,): interpolation from a key to the next."""

    keys: np.ndarray
    values: np.ndarray
    kind: np.ndarray
    left: np.ndarray
    right: np.ndarray

    def at(self, t: np.ndarray) -> np.ndarray:
        """(T, w) values at frames ``t``; the end values hold outside."""
        last = len(self.keys) - 1
        i = np.clip(np.searchsorted(self.keys, t, side="right") - 1, 0, last)
        j = np.minimum(i + 1, last)
        span = np.where(j > i, self.keys[j] - self.keys[i], 1.0)
        s = np.clip((t - self.keys[i]) / span, 0.0, 1.0)[:, None]
        s = np.where((self.kind[i] == "STEP")[:, None], np.floor(s), s)
        value = self.values[i] * (1 - s) + self.values[j] * s
        curved = self.kind[i] == "BEZIER"
        if curved.any():
            a, b, u = i[curved], j[curved], np.clip(t[curved], self.keys[0], self.keys[-1])
            x = [self.keys[a][:, None], self.right[a, :, 0], self.left[b, :, 0], self.keys[b][:, None]]
            y = [self.values[a], self.right[a, :, 1], self.left[b, :, 1], self.values[b]]
            x[1], x[2] = (np.clip(c, x[0], x[3]) for c in x[1:3])  # a curve that turns back is no function
            low, high = np.zeros_like(y[0]), np.ones_like(y[0])
            for _ in range(48):
                middle = (low + high) / 2
                before = _bezier(x, middle) < u[:, None]
                low, high = np.where(before, middle, low), np.where(before, high, middle)
            value[curved] = _bezier(y, (low + high) / 2)
        return value

    def samples(self) -> np.ndarray:
        """Frames at which USD's straight lines need a value."""
        times = [self.keys]
        step = np.flatnonzero(self.kind[:-1] == "STEP")
        gap = self.keys[step + 1] - self.keys[step]
        times.append(self.keys[step + 1] - np.minimum(STEP_WIDTH, gap / 2))
        for k in np.flatnonzero(self.kind[:-1] == "BEZIER"):
            number = (self.keys[k + 1] - self.keys[k]) * SAMPLES_PER_FRAME
            if not number < MOST_SAMPLES:
                raise ValueError(f"A curve may span {MOST_SAMPLES / SAMPLES_PER_FRAME:g} frames at most.")
            grid = np.arange(np.ceil(self.keys[k] * SAMPLES_PER_FRAME), self.keys[k + 1] * SAMPLES_PER_FRAME)
            times.append(grid / SAMPLES_PER_FRAME)
        return np.unique(np.concatenate(times))


def _bezier(p: list[np.ndarray], s: np.ndarray) -> np.ndarray:
    r = 1 - s
    return np.asarray(r**3 * p[0] + 3 * r * r * s * p[1] + 3 * r * s * s * p[2] + s**3 * p[3])


@dataclass(frozen=True)
class Track:
    """An element's numbers over time: ``base`` (n,), and curves over some of them."""

    base: np.ndarray
    channels: tuple[tuple[np.ndarray, Curve], ...]

    def samples(self) -> np.ndarray:
        return np.unique(np.concatenate([c.samples() for _, c in self.channels]))

    def at(self, t: np.ndarray) -> np.ndarray:
        """(T, n)."""
        value = np.repeat(self.base[None], len(t), axis=0)
        for index, curve in self.channels:
            value[:, index] = curve.at(t)
        return value


class Animations:
    """All channels of the main document, by the element they move."""

    def __init__(self, lib: Library, sources: Sources) -> None:
        self.lib, self.sources = lib, sources
        self.fps = _frames_per_second(lib.main)
        self._channels: dict[Any, list[tuple[np.ndarray | None, Curve, Any]]] = {}
        self._used: set[Any] = set()
        self.range: tuple[float, float] | None = None  # frames of what moves
        for channel in lib.main.iterfind("library_animations//channel"):
            self._add(channel)

    def __len__(self) -> int:
        return sum(map(len, self._channels.values()))

    def track(self, element: Any, base: np.ndarray) -> Track | None:
        """The motion of an element whose numbers at rest are ``base``; None where it rests."""
        self._used.add(element)
        channels = []
        for index, curve, channel in self._channels.get(element, []):
            index = np.arange(len(base)) if index is None else index
            if index.max() >= len(base) or curve.values.shape[1] != len(index):
                message = f"The channel gives {curve.values.shape[1]} numbers to {len(index)} of {len(base)}."
                self.lib.find.error(message, channel)
                continue
            try:
                times = curve.samples()
            except ValueError as error:
                self.lib.find.error(str(error), channel)
                continue
            channels.append((index, curve))
            low, high = self.range or (times[0], times[-1])
            self.range = min(low, float(times[0])), max(high, float(times[-1]))
        return Track(base, tuple(channels)) if channels else None

    def report_unused(self) -> None:
        """A note for every channel whose target nothing asked for."""
        for element, channels in self._channels.items():
            if element not in self._used:
                message = f"The animation of <{element.tag}> is left out; it is not drawn."
                self.lib.find.loss(message, channels[0][2])

    def _add(self, channel: Any) -> None:
        found = self._target(channel)
        sampler = self.lib.resolve(channel.get("source"), channel, "sampler")
        if found is None or sampler is None:
            return
        curve = self._curve(sampler)
        if curve is not None:
            self._channels.setdefault(found[0], []).append((found[1], curve, channel))

    def _target(self, channel: Any) -> tuple[Any, np.ndarray | None] | None:
        text = (channel.get("target") or "").strip()
        head, *steps = text.split("/")
        element = self.lib.by_id(head, channel)
        selection = ""
        for k, step in enumerate(steps):
            sid = step
            if k == len(steps) - 1:
                matched = re.match(r"^(.*?)((?:\.\w+)|(?:\(\d+\))+)?$", step)
                sid, selection = (matched[1], matched[2] or "") if matched else (step, "")
            if element is not None:
                element = next((e for e in element.iter() if e is not element and e.get("sid") == sid), None)
        if element is None or not steps:
            self.lib.find.loss(
                f'The animated target "{text}" is not there; its channel is left out.', channel
            )
            return None
        if not selection:
            return element, None
        if selection.startswith("."):
            member = selection[1:].upper()
            if member not in MEMBERS:
                self.lib.find.loss(f'The animated target "{text}" names no known member.', channel)
                return None
            return element, np.array([0 if element.tag in SCALARS else MEMBERS[member]])
        numbers = [int(n) for n in re.findall(r"\d+", selection)]
        index = numbers[0] if len(numbers) == 1 else numbers[0] + 4 * numbers[1]  # (column)(row)
        return element, np.array([index])

    def _curve(self, sampler: Any) -> Curve | None:
        find, given = self.lib.find, {}
        for one in sampler.findall("input"):
            source = self.lib.resolve(one.get("source"), one, "source")
            if source is None:
                return None
            given[one.get("semantic")] = source
        if "INPUT" not in given or "OUTPUT" not in given:
            find.error("A sampler must have INPUT and OUTPUT.", sampler)
            return None
        keys, values = self.sources.numbers(given["INPUT"]), self.sources.numbers(given["OUTPUT"])
        if keys is None or values is None:
            return None
        if len(keys) != len(values) or not len(keys):
            find.error(
                f"A sampler must have one output an input; got {len(values)} and {len(keys)}.", sampler
            )
            return None
        keys = keys[:, 0] * self.fps
        keys = np.where(np.abs(keys - np.round(keys)) < SNAP, np.round(keys), keys)
        if not (np.isfinite(keys).all() and np.isfinite(values).all() and (np.diff(keys) >= 0).all()):
            find.error("A sampler's keys must be finite and rise.", sampler)
            return None
        if len(keys) > MOST_SAMPLES or abs(keys).max() > 1e9:
            find.error(f"A sampler may have {MOST_SAMPLES} keys at most, within 1e9 frames.", sampler)
            return None
        keep = np.concatenate([np.diff(keys) > 0, [True]])  # of two keys at one time the later counts
        kind = self._kinds(given.get("INTERPOLATION"), len(keys), sampler)
        width = values.shape[1]
        left = self._tangents(given.get("IN_TANGENT"), keys, values, kind, sampler)
        right = self._tangents(given.get("OUT_TANGENT"), keys, values, kind, sampler)
        straight = np.stack([np.repeat(keys[:, None], width, axis=1), values], axis=2)
        if left is None or right is None:
            kind = np.where(kind == "STEP", "STEP", "LINEAR")
            left = right = straight
        else:
            hermite = (kind == "HERMITE")[:, None, None]
            right = np.where(hermite, straight + right / 3, right)
            arriving = np.roll(hermite, 1, axis=0)  # a key's left tangent belongs to the piece before it
            left = np.where(arriving, straight - left / 3, left)
            kind = np.where(kind == "HERMITE", "BEZIER", kind)
        return Curve(keys[keep], values[keep], kind[keep], left[keep], right[keep])

    def _kinds(self, source: Any, count: int, sampler: Any) -> np.ndarray:
        names = ["LINEAR"] * count if source is None else self.sources.names(source)
        if len(names) != count:
            self.lib.find.error(f"A sampler must have {count} interpolations; got {len(names)}.", sampler)
            names = ["LINEAR"] * count
        for other in sorted(set(names) - {"LINEAR", "STEP", "BEZIER", "HERMITE"}):
            self.lib.find.loss(f"{other} interpolation is taken as LINEAR.", sampler)
        return np.array([n if n in ("STEP", "BEZIER", "HERMITE") else "LINEAR" for n in names])

    def _tangents(
        self, source: Any, keys: np.ndarray, values: np.ndarray, kind: np.ndarray, sampler: Any
    ) -> np.ndarray | None:
        """(K, w, 2) as written, frames and values; None where no piece needs any or there are none."""
        if not np.isin(kind, ("BEZIER", "HERMITE")).any():
            return None
        numbers = None if source is None else self.sources.numbers(source)
        if numbers is None or len(numbers) != len(keys):
            self.lib.find.loss("A curve without tangents is taken as LINEAR.", sampler)
            return None
        width = values.shape[1]
        if numbers.shape[1] == 2 * width:
            out = numbers.reshape(len(keys), width, 2).copy()
        elif numbers.shape[1] == width + 1:
            out = np.stack([np.repeat(numbers[:, :1], width, axis=1), numbers[:, 1:]], axis=2)
        else:
            self.lib.find.loss(
                f"Tangents of {numbers.shape[1]} numbers are not known; LINEAR is taken.", sampler
            )
            return None
        out[..., 0] *= self.fps
        return out


SCALARS = {
    "float", "xfov", "yfov", "xmag", "ymag", "aspect_ratio", "znear", "zfar", "falloff_angle", "falloff_exponent",
    "constant_attenuation", "linear_attenuation", "quadratic_attenuation",
}  # fmt: skip


def _frames_per_second(root: Any) -> float:
    """What the file's writer said in an <extra> (ours, 3ds Max's, FCollada's), else 24."""
    for name in ("frame_rate", "frames_per_second"):
        for element in root.iterfind(f"*//extra/technique/{name}"):
            try:
                value = float(element.text or "")
            except ValueError:
                continue
            if 0 < value < 1e6:
                return value
    return FRAMES_PER_SECOND
