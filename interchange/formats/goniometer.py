"""Tables of a goniometer as BRDF measurements: what each column is, from the words and units of the header.

| header | is |
|---|---|
| theta_i, incidence, AOI · theta_s, theta_r, theta_o, exitance, scatter angle | polar angles of light and camera |
| phi_i, incidence azimuth · phi_s, exitance azimuth · delta_phi | their azimuths; the difference of the two |
| (deg), (rad), _deg, _rad behind an angle | its unit, which must be there (VARS of ASTM E1392 files: rad) |
| wavelength (nm) or channel | one row a wavelength or channel, beside one column of values |
| 550 nm, BRDF 550 nm, R, BRDF, BSDF, f, value | values in 1/sr |
| CCBSDF, BSDF*cos | values times the cosine of exitance, divided by it here |
| radiance factor, reflectance factor | pi f, divided by pi here |
| sigma ..., σ ..., std ..., u(...), each with (%) or not | one standard deviation of a column of values |

Without any azimuth the camera stays in the plane of incidence, positive on the mirror's side as in ASTM E1392. A
polar angle below zero is one on the other side.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from interchange.measurement import Column, Kind, Measurement
from interchange.problems import FileError, Problem, Severity, Where

ANGLES = {
    "theta_i": "thetai thetain incidence incidenceangle angleofincidence aoi polari polarangleofincidence",
    "phi_i": "phii phiin azimuthi incidenceazimuth azimuthofincidence",
    "theta_s": "thetas thetar thetao thetaout thetav exitance exitanceangle angleofexitance scatter scatterangle "
    "scatteringangle detector detectorangle view viewangle viewingangle polars polarangleofexitance",
    "phi_s": "phis phir phio phiout phiv azimuths azimutho exitanceazimuth azimuthofexitance scatterazimuth "
    "viewazimuth detectorazimuth",
    "delta_phi": "deltaphi dphi phidifference azimuthdifference relativeazimuth",
}
UNITS = {
    "deg": "deg",
    "degree": "deg",
    "degrees": "deg",
    "°": "deg",
    "rad": "rad",
    "radian": "rad",
    "radians": "rad",
}
SIGMA = re.compile(
    r"^(?:sigma|σ|std|stddev|standard deviation|uncertainty|u\b)[\s_:]*\(?(.*?)\)?$", re.IGNORECASE
)
COSINE = re.compile(
    r"cc[\s_-]?b[rs]df|cosine[\s_-]?corrected|b[rs]df\s*[*·x×]\s*cos|cos[\s_]*[*·x×]", re.IGNORECASE
)
FACTOR = re.compile(r"(radiance|reflectance)[\s_]*factor", re.IGNORECASE)
NM = re.compile(r"(\d+(?:\.\d+)?)\s*(nm|µm|um|micron)?\s*$", re.IGNORECASE)
PER_SR = {"", "1/sr", "sr^-1", "sr-1", "sr⁻¹", "/sr", "1 / sr"}
ORDER = {"r": 0, "red": 0, "g": 1, "green": 1, "b": 2, "blue": 2}


@dataclass(frozen=True)
class Table:
    """A text table: its numeric columns, its columns of words, and the line of each row."""

    columns: Sequence[Column]
    labels: dict[str, tuple[str, ...]]
    lines: Sequence[int]
    comments: tuple[str, ...]
    notes: tuple[Problem, ...]
    path: Path
    angle_unit: str = ""  # where a header gives none


def measurement(table: Table) -> Measurement | None:
    """The BRDF of a table whose header names angles of incidence and exitance; None for any other table.

    Raises FileError for a unit that is missing or cannot be, for an angle below the surface, and for columns that
    do not go together. Negative values are kept, and a note counts them.
    """
    named = {key: c for c in table.columns if (key := _angle(c.name))}
    worded = {key: name for name in table.labels if (key := _angle(name))}
    if not {"theta_i", "theta_s"} <= named.keys() | worded.keys():
        return None
    where = Where(str(table.path))
    if worded:
        raise FileError(
            Problem(
                f'"{name}" must hold a number in every row; got "{_first_word(table.labels[name])}".', where
            )
            for name in worded.values()
        )
    angles = _in_radians(named, table)
    others = [c for c in table.columns if not _angle(c.name)]
    values, sigma, axis = _sorted_out(others, table)
    notes = [*table.notes]
    angles, flipped = _above(angles, table)
    if "phi_s" not in named and "delta_phi" not in named:
        notes.append(
            Problem(
                "No azimuths are given: taken as in the plane of incidence, positive on the mirror's side.",
                where,
                Severity.NOTE,
            )
        )
    elif flipped:
        text = f"{flipped} polar angles are negative: taken as positive on the opposite side."
        notes.append(Problem(text, where, Severity.NOTE))
    values, sigma = _without_cosine(values, sigma, np.cos(angles["theta_s"]))
    found = Measurement(
        Kind.BRDF,
        tuple(Column(name, "rad", a) for name, a in angles.items()),
        tuple(values),
        comments=table.comments,
        file=str(table.path),
        sigma=tuple(sigma),
    )
    if axis is not None:
        found = _pivoted(found, axis, table)
    found = _by_wavelength(found)
    low = sum(int((c.values < 0).sum()) for c in found.values)
    if low:
        notes.append(Problem(f"{low} values are negative; they are kept.", where, Severity.NOTE))
    return replace(found, notes=tuple(notes))


def names_angles(header: Sequence[str]) -> bool:
    """Whether the cells of a row name both polar angles."""
    return {"theta_i", "theta_s"} <= {_angle(re.sub(r"[(\[].*", "", cell)) for cell in header}


def _plain(name: str) -> str:
    text = name.lower().replace("θ", "theta").replace("φ", "phi").replace("ϕ", "phi").replace("δ", "delta")
    return re.sub(r"[^a-z0-9°]", "", text)


def _angle(name: str) -> str:
    """Which angle a column is, "" for none; a unit may stand behind its name."""
    word = _plain(name)
    for end in ("", *sorted(UNITS, key=len, reverse=True)):
        stem = word.removesuffix(end) if end else word
        for key, words in ANGLES.items():
            if stem in words.split():
                return key
    return ""


def _first_word(cells: Sequence[str]) -> str:
    return next((c for c in cells if not re.fullmatch(r"[-+0-9.eE]*", c)), "")[:40]


def _in_radians(named: dict[str, Column], table: Table) -> dict[str, np.ndarray]:
    where = Where(str(table.path))
    wrong, found = [], {}
    units = {}
    for key, column in named.items():
        word = next((u for u in sorted(UNITS, key=len, reverse=True) if _plain(column.name).endswith(u)), "")
        unit = UNITS.get(
            column.unit.strip().lower(), "" if column.unit else UNITS.get(word, table.angle_unit)
        )
        if not unit:
            wrong.append(
                Problem(
                    f'The header must give the unit of "{column.name}", as "{column.name} (deg)" or (rad).',
                    where,
                )
            )
            continue
        if np.isnan(column.values).any():
            row = int(np.argmax(np.isnan(column.values)))
            wrong.append(Problem(f"{column.name} must be given in every row.", _line(table, row)))
        units[key] = unit
        found[key] = np.radians(column.values) if unit == "deg" else column.values
    if wrong:
        raise FileError(wrong)
    largest = {key: float(np.abs(named[key].values).max()) for key in ("theta_i", "theta_s")}
    for key, top in largest.items():
        if units[key] == "rad" and top > np.pi / 2 + 0.02:
            row = int(np.argmax(np.abs(named[key].values)))
            message = f"{named[key].name} is said to be in rad and reaches {top:g}: is it in deg?"
            raise FileError(Problem(message, _line(table, row)))
    if all(units[key] == "deg" and 0.5 < top <= 1.5709 for key, top in largest.items()):
        reach = max(largest.values())
        message = f"The polar angles are said to be in deg, and none is above {reach:.4g}: are they in rad?"
        raise FileError(Problem(message, where))
    return found


def _line(table: Table, row: int) -> Where:
    return Where(str(table.path), f"line {table.lines[row]}")


def _above(angles: dict[str, np.ndarray], table: Table) -> tuple[dict[str, np.ndarray], int]:
    """The four angles with polar ones from 0, and how many of them were negative."""
    for key in ("theta_i", "theta_s"):
        below = np.abs(angles[key]) > np.pi / 2 + 1e-6
        if below.any():
            row = int(np.argmax(below))
            degrees = np.degrees(angles[key][row])
            message = f"A BRDF's polar angles must lie within 90° of the normal; {key} is {degrees:.4g}°."
            raise FileError(Problem(message, _line(table, row)))
    zero = np.zeros(len(angles["theta_i"]))
    phi_i = angles.get("phi_i", zero)
    in_plane = "phi_s" not in angles and "delta_phi" not in angles
    phi_s = angles.get("phi_s", phi_i + angles.get("delta_phi", zero + np.pi))
    flipped = 0
    found = {}
    for key, azimuth in (("i", phi_i), ("s", phi_s)):
        theta = angles[f"theta_{key}"]
        flipped += int((theta < 0).sum()) if not in_plane else 0
        found[f"theta_{key}"] = np.abs(theta)
        found[f"phi_{key}"] = np.where(theta < 0, azimuth + np.pi, azimuth)
    return found, flipped


def _sorted_out(others: list[Column], table: Table) -> tuple[list[Column], list[Column], Column | None]:
    """Columns of values, those of their sigma (none, or as many), and the column of wavelengths of a long table."""
    where = Where(str(table.path))
    axis = next(
        (c for c in others if re.match(r"^(wave_?\s?length|wl|lambda|λ)\b", c.name, re.IGNORECASE)), None
    )
    rest = [
        replace(c, name=f"{c.name} {c.unit}", unit="") if NM.fullmatch(c.unit.strip()) else c
        for c in others
        if c is not axis
    ]
    sigma = {c.name: SIGMA.match(c.name)[1].strip() for c in rest if SIGMA.match(c.name)}  # type: ignore[index]
    values = [c for c in rest if c.name not in sigma]
    if not values:
        raise FileError(Problem("A column of BRDF values must stand beside the angles.", where))
    for c in values:
        if c.unit.strip().lower() not in PER_SR:
            message = f'BRDF values must be in 1/sr; "{c.name}" is in "{c.unit}".'
            raise FileError(Problem(message, where))
    if not sigma:
        return values, [], axis
    spread = [c for c in rest if c.name in sigma]
    if len(spread) == 1:
        return values, [_absolute(spread[0], v) for v in values], axis
    by_name = {_plain(sigma[c.name]): c for c in spread}
    if len(spread) != len(values):
        message = f"There must be one column of sigma for all values, or one each; got {len(spread)} for {len(values)}."
        raise FileError(Problem(message, where))
    return values, [_absolute(by_name.get(_plain(c.name), spread[k]), c) for k, c in enumerate(values)], axis


def _absolute(sigma: Column, value: Column) -> Column:
    return (
        replace(sigma, values=np.abs(value.values) * sigma.values / 100)
        if sigma.unit.strip() == "%"
        else sigma
    )


def _without_cosine(
    values: list[Column], sigma: list[Column], cosine: np.ndarray
) -> tuple[list[Column], list[Column]]:
    """Values and sigma in 1/sr; NaN where a cosine of zero leaves nothing to divide by."""
    factors = []
    for c in values:
        if COSINE.search(c.name):
            factors.append(np.where(cosine > 1e-3, 1 / np.maximum(cosine, 1e-3), np.nan))
        else:
            factors.append(np.full(len(cosine), 1 / np.pi if FACTOR.search(c.name) else 1.0))
    clean = [replace(c, unit="1/sr", values=c.values * k) for c, k in zip(values, factors, strict=True)]
    spread = [replace(c, unit="1/sr", values=c.values * k) for c, k in zip(sigma, factors, strict=False)]
    return clean, spread


def _pivoted(long: Measurement, wavelength: Column, table: Table) -> Measurement:
    """One row a pair of directions and one column a wavelength, of one row each; NaN where a pair lacks one."""
    if len(long.values) != 1:
        message = f"Beside a column of wavelengths there must be one of values; got {len(long.values)}."
        raise FileError(Problem(message, Where(str(table.path))))
    nm = wavelength.values * (1000 if wavelength.unit.lower() in ("µm", "um", "micron") else 1)
    if not (nm > 0).all():
        raise FileError(
            Problem("Wavelengths must be positive numbers.", _line(table, int(np.argmin(nm > 0))))
        )
    angles = np.stack([a.values for a in long.axes], axis=1)
    pairs, row = np.unique(np.round(angles, 9), axis=0, return_inverse=True)
    bands, column = np.unique(nm, return_inverse=True)
    if len(bands) * len(pairs) > 16 * len(nm) + 1000:
        raise FileError(
            Problem("Every pair of directions must have most of the wavelengths.", Where(str(table.path)))
        )
    grids = []
    for source in (long.values[0], *long.sigma):
        count = np.zeros((len(pairs), len(bands)))
        np.add.at(count, (row.ravel(), column), 1)
        total = np.zeros_like(count)
        np.add.at(total, (row.ravel(), column), source.values)
        grids.append(np.where(count > 0, total / np.maximum(count, 1), np.nan))  # repeats: their mean
    columns = [tuple(Column(f"{w:g} nm", "1/sr", grid[:, k]) for k, w in enumerate(bands)) for grid in grids]
    return replace(
        long,
        axes=tuple(replace(a, values=pairs[:, k]) for k, a in enumerate(long.axes)),
        values=columns[0],
        sigma=columns[1] if len(columns) > 1 else (),
    )


def _by_wavelength(found: Measurement) -> Measurement:
    """Columns in the order of their wavelengths, or red, green, blue, where their names say so."""
    nm = []
    for c in found.values:
        m = NM.search(c.name)
        bare = bool(m and m[2]) or bool(m and re.fullmatch(r"\d{3,4}(\.\d+)?", c.name.strip()))
        nm.append(float(m[1]) * (1 if (m[2] or "nm").lower() == "nm" else 1000) if m and bare else np.nan)
    names = [(c.name.lower().split() or [""])[-1].split("_")[-1] for c in found.values]
    if np.isfinite(nm).all():
        order = list(np.argsort(nm))
        wavelengths: np.ndarray | None = np.array(nm)[order]
    elif len(names) == 3 and {ORDER.get(n) for n in names} == {0, 1, 2}:
        order, wavelengths = sorted(range(3), key=lambda k: ORDER[names[k]]), None
    else:
        order, wavelengths = list(range(len(names))), None
    return replace(
        found,
        values=tuple(found.values[k] for k in order),
        sigma=tuple(found.sigma[k] for k in order) if found.sigma else (),
        wavelength_nm=wavelengths,
    )
