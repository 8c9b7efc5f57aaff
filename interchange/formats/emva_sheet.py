"""A camera's data sheet by EMVA 1288, as JSON or XML, and the sensor that it describes.

    { "standard": "EMVA 1288", "release": "4.0 Linear", "model": "...", "serial_number": "...",
      "width": 640, "height": 480, "pixel_um": 5.6, "bits": 12, "wavelength_nm": 525, "gain_dB": 0, "mosaic": "mono",
      "results": { "K": {"value": 0.279, "unit": "DN/e-", "sigma": 0.001}, "eta": {"value": 45.4, "unit": "%"},
                   "sigma_d": 10.97, ... } }

A bare number has the first unit of its symbol in ``SYMBOLS``. XML is the same under ``<emva1288>``: attributes for
what stands outside the results, ``<K unit="DN/e-" sigma="0.001">0.279</K>`` for each of them; and the results file
of the standard's reference implementation (``<results>``, PyPI emva1288) is read too.
"""

import json
import math
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lxml import etree

from interchange.formats.atomic import written_beside
from interchange.parameter import ParameterError
from interchange.problems import BrightfieldError, FileError, Problem, Where, did_you_mean
from interchange.sensor import Sensor

MAX_BYTES = 64 << 20
RELEASE = "4.0 Linear"
SHARE = {"%": 0.01, "1": 1.0}
ELECTRONS = {"e-": 1.0, "ke-": 1e3}

# symbol: what it is, its units and what they are worth in the first one
SYMBOLS: dict[str, tuple[str, dict[str, float]]] = {
    "eta": ("quantum efficiency", SHARE),
    "eta.red": ("quantum efficiency of red", SHARE),
    "eta.green": ("quantum efficiency of green", SHARE),
    "eta.blue": ("quantum efficiency of blue", SHARE),
    "R": ("responsivity", {"DN/p": 1.0}),
    "K": ("overall system gain", {"DN/e-": 1.0}),
    "sigma_d": ("temporal dark noise", ELECTRONS),
    "sigma_y.dark": ("temporal dark noise", {"DN": 1.0}),
    "mu_y.dark": ("dark signal without exposure time", {"DN": 1.0}),
    "mu_I.mean": ("dark current, from the mean", {"e-/s": 1.0}),
    "mu_I.var": ("dark current, from the variance", {"e-/s": 1.0}),
    "DSNU1288": ("spread of the dark signal over the pixels", ELECTRONS),
    "PRNU1288": ("spread of the gain over the pixels", SHARE),
    "DSNU1288.row": ("spread of the dark signal over the rows", ELECTRONS),
    "DSNU1288.col": ("spread of the dark signal over the columns", ELECTRONS),
    "DSNU1288.pixel": ("what is left of it over single pixels", ELECTRONS),
    "PRNU1288.row": ("spread of the gain over the rows", SHARE),
    "PRNU1288.col": ("spread of the gain over the columns", SHARE),
    "PRNU1288.pixel": ("what is left of it over single pixels", SHARE),
    "mu_p.sat": ("photons at saturation", {"p": 1.0, "kp": 1e3}),
    "mu_e.sat": ("saturation capacity", ELECTRONS),
    "mu_p.min": ("absolute sensitivity threshold", {"p": 1.0}),
    "mu_e.min": ("absolute sensitivity threshold", ELECTRONS),
    "SNR_max": ("largest signal-to-noise ratio", {"1": 1.0}),
    "DR": ("dynamic range", {"1": 1.0}),
    "LE_min": ("linearity error, lowest", SHARE),
    "LE_max": ("linearity error, highest", SHARE),
}
# first unit of a symbol as a person reads it: a share in percent
SAID = {name: next(iter(units)) for name, (_, units) in SYMBOLS.items()}
HEAD = {
    "standard": str, "release": str, "model": str, "serial_number": str, "mosaic": str, "width": int, "height": int,
    "pixel_um": float, "bits": int, "wavelength_nm": float, "gain_dB": float,
}  # fmt: skip
REFERENCE = {  # names of the reference implementation, in the first units of ours
    "QE": "eta", "R": "R", "K": "K", "sigma_d": "sigma_d", "sigma_y_dark": "sigma_y.dark", "u_I_mean": "mu_I.mean",
    "u_I_var": "mu_I.var", "DSNU1288": "DSNU1288", "PRNU1288": "PRNU1288", "u_p_sat": "mu_p.sat",
    "u_e_sat": "mu_e.sat", "u_p_min": "mu_p.min", "u_e_min": "mu_e.min", "SNR_max": "SNR_max", "DR": "DR",
    "LE_min": "LE_min", "LE_max": "LE_max",
}  # fmt: skip


@dataclass(frozen=True)
class Result:
    """In the symbol's own quantity: shares as 0 .. 1, electrons, DN, photons, seconds."""

    value: float
    sigma: float | None = None  # standard uncertainty, where it is known


@dataclass(frozen=True)
class DataSheet:
    results: dict[str, Result]
    bits: int = 0  # 0: not said
    model: str = ""
    serial_number: str = ""
    mosaic: str = "mono"
    width: int = 0
    height: int = 0
    pixel_um: float = 0.0
    wavelength_nm: float = 0.0
    gain_dB: float = 0.0
    release: str = RELEASE
    file: str = field(default="", compare=False)

    def get(self, symbol: str, default: float = 0.0) -> float:
        return self.results[symbol].value if symbol in self.results else default

    def sensor(self, base: Sensor | None = None) -> Sensor:
        """The sensor in the program's terms; what the sheet does not say is taken from ``base``.

        The converter's highest DN is that of ``full_well`` electrons, (2^bits - 1 - black) / K: the pixel's own
        capacity µ_e.sat stands for it where K is not given. The quantum efficiency, where it is given, decides on the
        responsivity. Raises FileError where neither K nor µ_e.sat is given, or a number cannot be.
        """
        base = base or Sensor()
        where = Where(self.file)
        bits = self.bits or base.bit_depth
        black = self.get("mu_y.dark", base.black_level)
        if "K" in self.results:
            full_well = 10 ** (self.gain_dB / 20) * (2**bits - 1 - black) / self.get("K")
        elif "mu_e.sat" in self.results:
            full_well = self.get("mu_e.sat")
        else:
            raise FileError(
                Problem("A data sheet must give K (DN/e-) or mu_e.sat (e-); it has neither.", where)
            )
        nm = self.wavelength_nm
        eta = tuple(self.get(f"eta.{c}", self.get("eta")) for c in ("red", "green", "blue"))
        try:
            return Sensor(
                resolution=(self.width or base.resolution[0], self.height or base.resolution[1]),
                pixel_pitch=(self.pixel_um * 1e-6,) * 2 if self.pixel_um else base.pixel_pitch,
                responsivity=0.0 if any(eta) else base.responsivity,
                quantum_efficiency=eta if any(eta) else base.quantum_efficiency,  # type: ignore[arg-type]
                wavelength_nm=(nm,) * 3 if nm else base.wavelength_nm,
                full_well=full_well,
                bit_depth=bits,
                black_level=black,
                read_noise=self.get("sigma_d", base.read_noise),
                prnu=self.get("PRNU1288.pixel", self.get("PRNU1288", base.prnu)),
                dsnu=self.get("DSNU1288.pixel", self.get("DSNU1288", base.dsnu)),
                prnu_row=self.get("PRNU1288.row", 0.0 if "PRNU1288" in self.results else base.prnu_row),
                prnu_column=self.get("PRNU1288.col", 0.0 if "PRNU1288" in self.results else base.prnu_column),
                dsnu_row=self.get("DSNU1288.row", 0.0 if "DSNU1288" in self.results else base.dsnu_row),
                dsnu_column=self.get("DSNU1288.col", 0.0 if "DSNU1288" in self.results else base.dsnu_column),
                hot_pixels=base.hot_pixels,
                dark_current=max(self.get("mu_I.mean", base.dark_current), 0.0),
                gain_dB=self.gain_dB,
                serial_number=self.serial_number or base.serial_number,
                mosaic=self.mosaic,  # type: ignore[arg-type]
                line_time=base.line_time,
                frame_rate=base.frame_rate,
            )
        except ParameterError as error:
            raise FileError(Problem(str(error), where)) from None


def read(path: Path | str) -> DataSheet:
    """A data sheet of either kind. Raises FileError with every problem."""
    path = Path(path)
    where = Where(str(path))
    try:
        if path.stat().st_size > MAX_BYTES:
            raise FileError(Problem(f"A data sheet must fit into {MAX_BYTES >> 20} MiB.", where))
        data = path.read_bytes()
    except OSError as error:
        raise FileError(Problem(f"The file cannot be read: {error.strerror}.", where)) from None
    if data.lstrip().startswith(b"<"):
        return _from(*_xml(data, where), where)
    try:
        content = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise FileError(Problem(f"A data sheet must be JSON or XML: {error}.", where)) from None
    if not isinstance(content, dict) or not isinstance(content.get("results"), dict):
        raise FileError(Problem('A data sheet must hold an object "results" of symbols.', where))
    return _from({k: v for k, v in content.items() if k != "results"}, content["results"], where)


def write(path: Path | str, sheet: DataSheet) -> None:
    """As JSON, or XML where the name ends so, beside and renamed. Raises FileError."""
    path = Path(path)
    head = {"standard": "EMVA 1288", **{k: getattr(sheet, k) for k in HEAD if k != "standard"}}
    head = {k: v for k, v in head.items() if v or k == "gain_dB"}
    results: dict[str, Any] = {}
    for symbol, result in sheet.results.items():
        unit, scale = SAID[symbol], SYMBOLS[symbol][1][SAID[symbol]]
        results[symbol] = {"value": result.value / scale, "unit": unit}
        if result.sigma is not None:
            results[symbol]["sigma"] = result.sigma / scale
    if path.suffix.lower() == ".xml":
        root = etree.Element("emva1288", {k: str(v) for k, v in head.items()})
        for symbol, entry in results.items():
            about = {k: str(v) for k, v in entry.items() if k != "value"}
            etree.SubElement(root, symbol, about).text = repr(entry["value"])
        data = etree.tostring(root, pretty_print=True, xml_declaration=True, encoding="utf-8")
    else:
        data = (json.dumps({**head, "results": results}, indent=1, ensure_ascii=False) + "\n").encode()
    beside = written_beside(path)
    try:
        beside.write_bytes(data)
        os.replace(beside, path)
    except OSError as error:
        raise FileError(Problem(f"The file cannot be written: {error.strerror}.", Where(str(path)))) from None
    finally:
        beside.unlink(missing_ok=True)


def _xml(data: bytes, where: Where) -> tuple[dict[str, Any], dict[str, Any]]:
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, remove_comments=True)
    try:
        root = etree.fromstring(data, parser)
    except (etree.XMLSyntaxError, ValueError) as error:
        raise FileError(Problem(f"The file is not well-formed XML: {error}.", where)) from None
    if root.getroottree().docinfo.doctype:
        raise FileError(Problem("A data sheet must have no document type.", where))
    if root.tag == "results":
        found = {
            e.tag: e.findtext("value") for section in root for e in section if e.find("value") is not None
        }
        named = {REFERENCE[k]: {"value": v} for k, v in found.items() if k in REFERENCE and v != "nan"}
        return {}, {k: v for k, v in named.items() if v["value"] not in (None, "None")}
    if root.tag != "emva1288":
        raise FileError(Problem(f"The root must be emva1288 or results; got {root.tag}.", where))
    return dict(root.attrib), {str(e.tag): {"value": (e.text or "").strip(), **e.attrib} for e in root}


def _from(head: dict[str, Any], results: dict[str, Any], where: Where) -> DataSheet:
    problems: list[Problem] = []

    def wrong(message: str, place: str) -> None:
        problems.append(Problem(message, Where(where.file, place)))

    known: dict[str, Any] = {}
    for name, value in head.items():
        if name not in HEAD:
            wrong(f'"{name}" is not known.{did_you_mean(name, HEAD)}', name)
        elif HEAD[name] is str:
            known[name] = str(value)
        elif (number := _number(value)) is None or (number < 0 and name != "gain_dB"):
            wrong(f'{name} must be a number; got "{value}".', name)
        else:
            known[name] = HEAD[name](number)
    if known.pop("standard", "EMVA 1288") != "EMVA 1288":
        wrong(f'The standard must be "EMVA 1288"; got "{head["standard"]}".', "standard")
    found: dict[str, Result] = {}
    for symbol, entry in results.items():
        if symbol not in SYMBOLS:
            wrong(f'"{symbol}" is no symbol of a data sheet.{did_you_mean(symbol, SYMBOLS)}', symbol)
            continue
        entry = entry if isinstance(entry, dict) else {"value": entry}
        unit = str(entry.get("unit", SAID[symbol]))
        number = _number(entry.get("value"))
        sigma = _number(entry["sigma"]) if "sigma" in entry else None
        units = SYMBOLS[symbol][1]
        if extra := set(entry) - {"value", "unit", "sigma"}:
            wrong(f"A result must have value, unit and sigma; got {', '.join(sorted(extra))}.", symbol)
        elif number is None or ("sigma" in entry and sigma is None):
            wrong(f"{symbol} must be a number; got {entry}.", symbol)
        elif unit not in units:
            wrong(f'The unit of {symbol} must be {" or ".join(units)}; got "{unit}".', symbol)
        else:
            found[symbol] = Result(number * units[unit], None if sigma is None else sigma * units[unit])
    for symbol in ("K", "mu_e.sat", "R"):
        if symbol in found and found[symbol].value <= 0:
            wrong(f"{symbol} must be above 0; got {found[symbol].value:g}.", symbol)
    if problems:
        raise FileError(problems)
    return DataSheet(found, **known, file=where.file)


def _number(value: Any) -> float | None:
    if isinstance(value, bool) or value is None:
        return None
    try:
        number = float(value)
    except (TypeError, ValueError):
        return None
    return number if math.isfinite(number) else None


def said(symbol: str, result: Result) -> str:
    """``0.279 DN/e-``, with its uncertainty where there is one."""
    if symbol not in SYMBOLS:
        raise BrightfieldError(f'"{symbol}" is no symbol of a data sheet.{did_you_mean(symbol, SYMBOLS)}')
    unit, scale = SAID[symbol], SYMBOLS[symbol][1][SAID[symbol]]
    spread = "" if result.sigma is None else f" ± {result.sigma / scale:.2g}"
    return f"{result.value / scale:.5g}{spread}{'' if unit == '1' else ' ' + unit}"
