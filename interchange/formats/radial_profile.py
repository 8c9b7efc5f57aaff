"""A data sheet's radial profile as a table: the angle from the axis, and the relative intensity there.

    angle (deg), relative intensity        0 .. 90 or 0 .. 180: alike all around
    -60, 0.02                              -90 .. 90: the two sides of one plane, positive ones at azimuth 0
    angle (deg), horizontal, vertical      two columns: the planes at azimuth 0 and 90 degrees, linear in between

The first column is named angle or theta, its unit deg (assumed) or rad. Whatever the scale (1, 100 %, candela), the
largest value becomes 1: ``Light.intensity`` is then the radiant intensity of the brightest direction, and
``power.with_power`` finds it from watts or lumens.
"""

import re
from pathlib import Path

import numpy as np

from interchange.formats.luminous_intensity import Photometry
from interchange.light import Profile
from interchange.measurement import Column, Measurement
from interchange.problems import FileError, Problem, Where

ANGLE = re.compile(r"^(angle|theta|θ)\b", re.IGNORECASE)


def is_radial(table: Measurement) -> bool:
    """Whether a table of numbers is a radial profile: its first column says so."""
    columns = [*table.axes, *table.values]
    return not table.labels and len(columns) in (2, 3) and bool(ANGLE.match(columns[0].name))


def parse(table: Measurement, path: Path) -> Photometry:
    """The profile that a table of numbers holds. Raises FileError with every problem."""
    where = Where(str(path))
    columns = [*table.axes, *table.values]
    if not is_radial(table):
        raise FileError(
            Problem(
                "A radial profile must have a column of angles, named angle, and one or two of intensities; got "
                f"{', '.join([c.name for c in columns] + list(table.labels))}.",
                where,
            )
        )
    angle = _degrees(columns[0], where)
    values = np.stack([c.values for c in columns[1:]])
    wrong = []
    if len(angle) < 2 or not (np.diff(angle) > 0).all():
        wrong.append("Angles must increase, two or more of them.")
    elif angle[0] < -180 or angle[-1] > 180 or angle[0] > 0:
        wrong.append(
            f"Angles must begin at 0 or below and end within 180 degrees; got {angle[0]:g} to {angle[-1]:g}."
        )
    if not np.isfinite(values).all() or not (values >= 0).all() or not values.max() > 0:
        wrong.append("Intensities must be numbers, none of them negative, and not all 0.")
    if wrong:
        raise FileError(Problem(w, where) for w in wrong)
    values = values / values.max()
    vertical = np.unique(np.abs(np.append(angle, 0.0)))
    both = angle[0] < 0
    sides = [
        np.interp(turn * vertical, angle, row, left=0.0, right=0.0) if both or turn > 0 else None
        for turn in (1, -1)
        for row in values
    ]
    planes = [s if s is not None else sides[i % len(values)] for i, s in enumerate(sides)]
    if len(planes) == 2 and not both:
        planes = planes[:1]
    horizontal = np.linspace(0, 2 * np.pi, len(planes) + 1) if len(planes) > 1 else np.zeros(1)
    candela = np.stack([*planes, planes[0]] if len(planes) > 1 else planes)  # type: ignore[list-item, arg-type]
    profile = Profile(horizontal, np.radians(vertical), candela, str(path))
    return Photometry(
        profile=profile,
        standard="radial profile",
        goniometer="C",
        symmetry="rotational" if len(planes) == 1 else "none",
        horizontal=np.degrees(horizontal),
        vertical=vertical,
        lamps=1,
        lumens=None,
        efficiency=None,
        watts=0.0,
        size=(0.0, 0.0, 0.0),
        factor=1.0 / float(np.stack([c.values for c in columns[1:]]).max()),
        keywords={f"comment {i + 1}": c for i, c in enumerate(table.comments)},
        notes=table.notes,
    )


def _degrees(column: Column, where: Where) -> np.ndarray:
    unit = column.unit.lower().strip()
    if unit in ("rad", "radian", "radians"):
        return np.degrees(column.values)
    if unit not in ("", "deg", "degree", "degrees", "°"):
        raise FileError(Problem(f"Angles must be in deg or rad; got {column.unit}.", where))
    return column.values
