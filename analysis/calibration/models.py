"""The lens models that a calibration can fit: which coefficients are free."""

from dataclasses import dataclass

from interchange.distortion import NAMES, LensModel
from interchange.problems import BrightfieldError, did_you_mean


@dataclass(frozen=True)
class FitModel:
    """``free``: indices of ``lens``'s coefficients that are fitted; the others stay 0."""

    name: str
    lens: LensModel
    free: tuple[int, ...]

    @property
    def coefficients(self) -> int:
        """How many numbers OpenCV's functions are given."""
        return len(NAMES[self.lens])

    @property
    def names(self) -> tuple[str, ...]:
        """Of a camera's parameters, in order."""
        return ("fx", "fy", "cx", "cy", *(NAMES[self.lens][i] for i in self.free))


MODELS = {
    m.name: m
    for m in (
        FitModel("pinhole", LensModel.OPENCV, ()),
        FitModel("4", LensModel.OPENCV, (0, 1, 2, 3)),
        FitModel("5", LensModel.OPENCV, (0, 1, 2, 3, 4)),
        FitModel("8", LensModel.OPENCV, tuple(range(8))),
        FitModel("12", LensModel.OPENCV, tuple(range(12))),
        FitModel("14", LensModel.OPENCV, tuple(range(14))),
        FitModel("tilt", LensModel.OPENCV, (0, 1, 2, 3, 4, 12, 13)),
        FitModel("fisheye", LensModel.FISHEYE, (0, 1, 2, 3)),
    )
}


def model_named(name: str) -> FitModel:
    if name not in MODELS:
        raise BrightfieldError(
            f'There is no lens model "{name}".{did_you_mean(name, MODELS)} There are {", ".join(MODELS)}.'
        )
    return MODELS[name]
