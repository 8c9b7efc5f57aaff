"""What COLLADA has no words for, in <extra>: USD attributes of lamps, cameras and shaders, exactly.

    <extra><technique profile="brightfield">
      <prim type="RectLight" apis="ShapingAPI">
        <attribute name="inputs:width" type="float">0.2</attribute>
        <attribute name="inputs:intensity" type="float"><sample time="0">1</sample> ... </attribute>
      </prim>
    </technique></extra>

A material's network is one <prim> a shader, with its path below the material, and <connect> where an input or an
output takes its value from another one. So a BRDF stands there by its name with its parameters, lobes included.
Other programs' <extra> is kept as it is in the prim's customData and written back.
"""

import os
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
from lxml import etree
from pxr import Gf, Sdf, Usd, Vt

from interchange.formats.collada.library import Library
from interchange.formats.usd_values import Finder

PROFILE = "brightfield"
KEPT = "collada:extra"
WORDS = {"token", "string", "asset"}


def own_extra(element: Any) -> Any:
    """Our <technique> in an element's <extra>, or None."""
    return element.find(f"extra/technique[@profile='{PROFILE}']")


def keep_name(prim: Usd.Prim, element: Any) -> None:
    """The element's name for people, as the prim's display name."""
    own = own_extra(element)
    given = None if own is None else own.find("display")
    name = element.get("name") if given is None else given.get("name")
    if name:
        prim.SetDisplayName(name)


def keep_extras(prim: Usd.Prim, element: Any) -> None:
    """Keep what other programs wrote, to give it back on export."""
    own = own_extra(element)
    kept = [e for e in element.findall("extra") if own is None or own.getparent() is not e]
    if kept:
        texts = [etree.tostring(e, encoding="unicode", with_tail=False) for e in kept]
        prim.SetCustomDataByKey(KEPT, Vt.StringArray(texts))


def author_network(material: Usd.Prim, technique: Any, lib: Library) -> None:
    """Build a material's shaders as our <extra> gives them."""
    stage, root = material.GetStage(), material.GetPath()
    for given in technique.findall("prim"):
        below = given.get("path", "")
        if below and not (Sdf.Path.IsValidPathString(below) and not Sdf.Path(below).IsAbsolutePath()):
            lib.find.error(f'"{below}" is no path below a material.', given)
            continue
        path = root.AppendPath(below) if below else root
        kind = given.get("type")
        if not path.HasPrefix(root) or (below and kind not in ("Shader", "NodeGraph")):
            lib.find.error(f"A material holds Shader and NodeGraph; got {kind}.", given)
            continue
        author_attributes(stage.DefinePrim(path, kind) if below else material, given, lib, root)


def author_attributes(prim: Usd.Prim, given: Any, lib: Library, root: Any = None) -> None:
    """Set the attributes of a <prim>. ``root``: the prim that connections start from."""
    for name in given.get("apis", "").split():
        prim.AddAppliedSchema(name)
    for child in given.findall("attribute"):
        name, kind = child.get("name", ""), Sdf.ValueTypeNames.Find(child.get("type", ""))
        if not kind or not Sdf.Path.IsValidNamespacedIdentifier(name):
            lib.find.error(
                f'An attribute must have a name and a USD type; got "{name}", "{child.get("type")}".', child
            )
            continue
        attribute = prim.CreateAttribute(name, kind, child.get("custom") == "1")
        if child.get("variability") == "uniform":
            attribute.SetVariability(Sdf.VariabilityUniform)
        if child.get("interpolation"):
            attribute.SetMetadata("interpolation", child.get("interpolation"))
        try:
            plain = not len(child) or child[0].tag == "item"
            if plain and child.get("empty") != "1":
                attribute.Set(_parsed(child, kind, lib))
            for sample in child.findall("sample"):
                attribute.Set(_parsed(sample, kind, lib), Usd.TimeCode(float(sample.get("time", "nan"))))
            if child.find("default") is not None:
                attribute.Set(_parsed(child.find("default"), kind, lib))
        except (ValueError, TypeError, OverflowError) as error:
            lib.find.error(f"{name} must hold a {kind}: {error}.", child)
        for link in child.findall("connect"):
            target = (link.text or "").strip()
            if root is None or not Sdf.Path.IsValidPathString(target) or Sdf.Path(target).IsAbsolutePath():
                lib.find.error(f'"{target}" is no path to connect to.', link)
                continue
            attribute.AddConnection(Sdf.Path(target).MakeAbsolutePath(root))


def _parsed(element: Any, kind: Any, lib: Library) -> Any:
    scalar = kind.scalarType
    name, array = str(scalar), kind.isArray
    if name in WORDS:
        words = [(i.text or "") for i in element.findall("item")] if array else [element.text or ""]
        if name == "asset":
            words = [_path(w, element, lib) for w in words]
            return Sdf.AssetPathArray([Sdf.AssetPath(w) for w in words]) if array else Sdf.AssetPath(words[0])
        return type(kind.defaultValue)(words) if array else words[0]
    default = scalar.defaultValue
    numbers = (element.text or "").split()
    if isinstance(default, bool):
        values = np.array([n in ("1", "true") for n in numbers], bool)
    elif np.asarray(default).dtype.kind in "iu":
        values = np.array(numbers, np.int64)
    else:
        values = np.array(numbers, np.float64)
    width = _width(default)
    if len(values) % width or (not array and len(values) != width):
        raise ValueError(f"{len(values)} numbers")
    rows = [_scalar(default, values[i : i + width]) for i in range(0, len(values), width)]
    return type(kind.defaultValue)(rows) if array else rows[0]


def _width(default: Any) -> int:
    if isinstance(default, (Gf.Quatf, Gf.Quatd, Gf.Quath)):
        return 4
    return int(np.size(np.asarray(default))) if not isinstance(default, (bool, int, float)) else 1


def _scalar(default: Any, values: np.ndarray) -> Any:
    if isinstance(default, (bool, int, float)):
        return type(default)(values[0])
    return type(default)(*[v.item() for v in values])


def _path(text: str, element: Any, lib: Library) -> str:
    if not text:
        return ""
    path = lib.file(text, element, "The file")
    return "" if path is None else str(path)


def prim_element(prim: Usd.Prim, names: list[str], folder: Path, find: Finder, root: Any = None) -> Any:
    """A <prim> with the named attributes. ``folder``: of the file, which paths become relative to."""
    element = etree.Element("prim", type=str(prim.GetTypeName()))
    apis = prim.GetPrimTypeInfo().GetAppliedAPISchemas()
    if apis:
        element.set("apis", " ".join(apis))
    for name in names:
        attribute = prim.GetAttribute(name)
        kind = attribute.GetTypeName()
        if not Sdf.ValueTypeNames.Find(str(kind)):
            find.loss(f'The attribute is of the unknown type "{kind}" and is left out.', prim, name)
            continue
        child = etree.SubElement(element, "attribute", name=name, type=str(kind))
        if attribute.IsCustom():
            child.set("custom", "1")
        if attribute.GetVariability() == Sdf.VariabilityUniform:
            child.set("variability", "uniform")
        if attribute.GetMetadata("interpolation"):
            child.set("interpolation", str(attribute.GetMetadata("interpolation")))
        times = attribute.GetTimeSamples()
        default = attribute.GetResolveInfo(Usd.TimeCode.Default()).HasAuthoredValue()
        value = attribute.Get() if default else None
        if times or attribute.GetConnections():
            if value is not None:
                _write(etree.SubElement(child, "default"), value, kind, folder)
            for time in times:
                _write(etree.SubElement(child, "sample", time=repr(time)), attribute.Get(time), kind, folder)
            for target in attribute.GetConnections():
                below = target.MakeRelativePath(root) if root is not None else target
                etree.SubElement(child, "connect").text = str(below)
        elif value is not None:
            _write(child, value, kind, folder)
        else:
            child.set("empty", "1")
    return element


def _write(element: Any, value: Any, kind: Any, folder: Path) -> None:
    name = str(kind.scalarType)
    if name in WORDS:
        words = list(value) if kind.isArray else [value]
        texts = [relative_uri(w, folder) if name == "asset" else str(w) for w in words]
        if kind.isArray:
            for text in texts:
                etree.SubElement(element, "item").text = text
        else:
            element.text = texts[0]
        return
    default = kind.scalarType.defaultValue
    if isinstance(default, (Gf.Quatf, Gf.Quatd, Gf.Quath)):
        rows = [[q.GetReal(), *q.GetImaginary()] for q in (value if kind.isArray else [value])]
        numbers = np.array(rows, np.float64).ravel()
    else:
        numbers = np.asarray(value).ravel()
    element.text = format_numbers(numbers)


def format_numbers(numbers: np.ndarray) -> str:
    """Decimals that read back as the same numbers of their own precision."""
    if numbers.dtype.kind in "iub":
        return " ".join(map(str, numbers.astype(np.int64).tolist()))
    if numbers.dtype == np.float64:
        return " ".join(map(repr, numbers.tolist()))
    return " ".join(f"{n:.9g}" for n in numbers.tolist())


def relative_uri(asset: Any, folder: Path) -> str:
    """A URI of a file as seen from ``folder``."""
    path = asset.resolvedPath or asset.path
    if not path:
        return ""
    if os.path.isabs(path):
        path = Path(os.path.relpath(path, folder)).as_posix()
    return quote(path)
