"""Plain data as text for people: aligned names and values, tables, trees; and as JSON's types for machines.

Units stand at the end of a name: ``focal_length_mm`` prints as "focal length (mm)".
"""

import math
import re
from numbers import Integral, Real
from typing import Any

Description = dict[str, Any]
UNITS = {
    "mm": "mm",
    "um": "µm",
    "m": "m",
    "px": "px",
    "deg": "°",
    "s": "s",
    "cd": "cd",
    "lm": "lm",
    "W": "W",
    "lm_per_W": "lm/W",
    "bytes": "bytes",
    "GB": "GB",
}
TREE_ROWS = 60
TABLE_ROWS = 40
SIDE_BY_SIDE = 4
ACROSS = ("size", "resolution", "opening")  # written with × between


def plain(value: Any) -> Any:
    """The same with JSON's types; what is not finite becomes null."""
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if hasattr(value, "tolist"):  # NumPy's
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def text(found: Description, everything: bool = False) -> str:
    """Aligned lines of names and values; tables and trees below, each under its name."""
    single = {k: v for k, v in found.items() if not _is_long(v)}
    blocks = [_lines(single)]
    for name, value in found.items():
        if not _is_long(value) or not value:
            continue
        if name == "tree":
            body = _table(_tree_rows(value), TREE_ROWS, everything)
        elif name == "materials" and isinstance(value[0], dict):
            body = _table([_material_row(m) for m in value], TABLE_ROWS, everything)
        elif name == "cameras" and len(value) <= SIDE_BY_SIDE:
            body = _side_by_side(value)
        elif name == "problems":
            body = "\n".join(f"  {p['severity']}: {p['problem']}" for p in value)
        elif isinstance(value, dict):
            body = _lines(_flat(value), "  ")
        elif isinstance(value[0], dict):
            body = _table(value, TABLE_ROWS, everything)
        else:
            body = _shortened([f"  {_short(v)}" for v in value], TABLE_ROWS, everything)
        blocks.append(f"{_title(name).upper()}\n{body}")
    return "\n\n".join(blocks)


def _is_long(value: Any) -> bool:
    if isinstance(value, dict):
        return True
    return isinstance(value, list | tuple) and (not value or not isinstance(value[0], Real))


def _title(key: str) -> str:
    for ending, unit in sorted(UNITS.items(), key=lambda item: -len(item[0])):
        if key.endswith(f"_{ending}"):
            return f"{key[: -len(ending) - 1].replace('_', ' ')} ({unit})"
    return key.replace("_", " ")


def _lines(values: Description, indent: str = "") -> str:
    titles = [_title(k) for k in values]
    width = max(map(len, titles), default=0)
    return "\n".join(
        f"{indent}{t:<{width}}  {_cell(k, v)}" for t, (k, v) in zip(titles, values.items(), strict=True)
    )


def _flat(values: Description, before: str = "") -> Description:
    """Nested names joined by dots, so that settings print as one list."""
    found: Description = {}
    for key, value in values.items():
        if isinstance(value, dict):
            found |= _flat(value, f"{before}{key}.")
        else:
            found[f"{before}{key}"] = value
    return found


def _tree_rows(tree: list[Description]) -> list[Description]:
    """Names indented by depth; what is below a material is told by the materials."""
    rows, hidden_below = [], -1
    for prim in tree:
        depth = prim["depth"]
        if 0 <= hidden_below < depth:
            continue
        hidden_below = depth if prim["type"] == "Material" else -1
        row = {k: v for k, v in prim.items() if k != "depth"}
        rows.append(row | {"name": "  " * depth + prim["name"]})
    return rows


def _material_row(material: Description) -> Description:
    """BRDF and its parameters in one cell; lists without entries are left out."""
    rest = {k: v for k, v in material.items() if k not in ("name", "brdf") and v not in ([], ())}
    cells = " · ".join(f"{k} {_short(v)}" for k, v in rest.items())
    return {"name": material["name"], "brdf": material["brdf"], "parameters": cells}


def _side_by_side(rows: list[Description]) -> str:
    """One column a row: for few things with many properties."""
    names = list(dict.fromkeys(k for r in rows for k in r))
    cells = [[_title(n), *(_cell(n, r.get(n)) for r in rows)] for n in names]
    widths = [max(len(c[i]) for c in cells) for i in range(len(rows) + 1)]
    return "\n".join(
        "  " + "  ".join(f"{x:<{w}}" for x, w in zip(c, widths, strict=True)).rstrip() for c in cells
    )


def _cell(key: str, value: Any) -> str:
    between = " × " if key.startswith(ACROSS) else ", "
    return between.join(map(_short, value)) if isinstance(value, list | tuple) else _short(value)


def _table(rows: list[Description], limit: int, everything: bool) -> str:
    columns = list(dict.fromkeys(k for r in rows for k in r))
    shown = rows if everything else rows[:limit]
    cells = [[_title(c) for c in columns], *([_cell(c, r.get(c, "")) for c in columns] for r in shown)]
    numeric = [all(_is_numeric(r[i]) for r in cells[1:]) for i in range(len(columns))]
    keep = [i for i in range(len(columns)) if any(r[i] for r in cells[1:])]
    widths = [max(len(r[i]) for r in cells) for i in range(len(columns))]
    lines = []
    for row in cells:
        parts = [f"{row[i]:>{widths[i]}}" if numeric[i] else f"{row[i]:<{widths[i]}}" for i in keep]
        lines.append("  " + "  ".join(parts).rstrip())
    return _shortened(lines, limit + 1, everything, len(rows) + 1)


def _shortened(lines: list[str], limit: int, everything: bool, total: int = 0) -> str:
    total = total or len(lines)
    if everything or total <= limit:
        return "\n".join(lines)
    return "\n".join([*lines[:limit], f"  ... {total - limit} more; --all shows them"])


def _is_numeric(cell: str) -> bool:
    return not cell or re.fullmatch(r"-?[\d,.]+(e[+-]?\d+)?( × .*)?", cell) is not None


def _short(value: Any) -> str:
    """One value in a few characters: numbers to six digits, lists with × or commas."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, Integral):
        return f"{int(value):,}"
    if isinstance(value, Real):
        return f"{float(value) + 0.0:.6g}"
    if isinstance(value, dict):
        return ", ".join(f"{k} {_short(v)}" for k, v in value.items())
    if isinstance(value, list | tuple):
        inner = [f"({_short(v)})" if isinstance(v, list | tuple) else _short(v) for v in value]
        return ", ".join(inner)
    return " ".join(str(value).splitlines())
