"""An effect that the evidence supports: its name and stage, how probable it is, and its numbers."""

from collections.abc import Sequence
from dataclasses import dataclass

PRESENT = 0.5  # from which probability on an effect is called
LIKELIEST = 0.25  # the same of the likeliest of several that captures do not tell apart
TIED = 4.0  # times less probable than the likeliest: what is no less may as well be there
STAGES = {
    "scene": ("camera_pose", "object_pose", "geometry", "light_position", "light_intensity", "light_beam", "light_size",
              "light_spectrum", "ambient_light", "interreflection", "shadow"),
    "material": ("albedo", "gloss", "anisotropy", "texture", "translucency"),
    "optics": ("lens_distortion", "principal_point", "vignetting", "defocus", "lateral_chromatic_aberration",
               "veiling_glare", "motion_blur", "rolling_shutter"),
    "sensor": ("sensor_noise", "exposure", "saturation", "color_crosstalk", "fixed_pattern"),
    "readout": ("black_level", "response_curve", "white_balance", "jpeg", "quantization"),
}  # fmt: skip


def stage_of(effect: str) -> str:
    return next(stage for stage, names in STAGES.items() if effect in names)


@dataclass(frozen=True)
class Estimate:
    value: float
    sigma: float
    unit: str


@dataclass(frozen=True)
class Finding:
    """One effect that the evidence supports. ``gap_without``: χ on held-out captures with all others but it, which
    are fitted anew then; alone, of the file at its best.

    ``share`` of the mean χ² before that it takes off (Shapley's): those of all effects, what is outside the
    catalogue, what stays unexplained and the noise add up to 1. Noise moves no mean, so its share is 0.
    """

    name: str
    probability: float
    parameters: dict[str, Estimate]
    rivals: tuple[tuple[str, float], ...]
    separate_by: str | None
    gap_without: float
    gap_with: float
    share: float
    cameras: tuple[str, ...] = ()  # those that alone have it; none where all have
    targets: tuple[str, ...] = ()  # lamps, materials or objects that it is about, where it is about some
    grounds: str = ""  # of what was known before anything was fitted
    words: str = ""  # for it, where its name alone says too little

    @property
    def called(self) -> str:
        """ "vignetting of Camera1", "albedo of paint and tin", "light position of all lamps"."""
        of = " and ".join(self.cameras or self.targets)
        return (self.words or self.name.replace("_", " ")) + (f" of {of}" if of else "")

    @property
    def tied(self) -> tuple[str, ...]:
        """Rivals that may as well be there, in words."""
        alike = (name for name, p in self.rivals if p > self.probability / TIED)
        return tuple(name.replace("_", " ") for name in alike)


def names(findings: Sequence[Finding]) -> str:
    """ "vignetting, defocus (or motion blur) and exposure"."""
    words = [f.called + (f" (or {' or '.join(f.tied)})" if f.tied else "") for f in findings]
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
