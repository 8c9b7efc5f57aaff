"""The skeleton of a COLLADA document that is being written: libraries, ids, sources."""

import re
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

from interchange.formats.collada.extra import KEPT, PROFILE, format_numbers, own_extra
from interchange.formats.collada.safe_xml import NAMESPACES
from interchange.formats.usd_values import Finder

LIBRARIES = (
    "animations", "cameras", "effects", "geometries", "images", "lights", "materials", "nodes", "visual_scenes",
)  # fmt: skip
_ILLEGAL = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


class Output:
    """What has been written so far, and what could not be."""

    def __init__(self, folder: Path, find: Finder, version: str = "1.4.1") -> None:
        self.folder, self.find, self.version = folder, find, version
        self.namespace = next(n for n, v in NAMESPACES.items() if version.startswith(v))
        self.root = etree.Element("COLLADA", version=version)
        self.libraries = {name: etree.Element(f"library_{name}") for name in LIBRARIES}
        self._ids: set[str] = set()
        self._images: dict[str, str] = {}

    def new_id(self, name: str) -> str:
        """An id of the document, as near to ``name`` as may be."""
        base = re.sub(r"[^\w.-]", "_", name) or "unnamed"
        base = base if re.match(r"[^\W\d]", base) else f"_{base}"
        found, count = base, 1
        while found in self._ids:
            count += 1
            found = f"{base}-{count}"
        self._ids.add(found)
        return found

    def image(self, uri: str) -> str:
        """The id of the <image> of a file."""
        if uri not in self._images:
            self._images[uri] = self.new_id(Path(uri).stem + "-image")
            image = add(self.libraries["images"], "image", id=self._images[uri])
            init = add(image, "init_from", uri if self.version == "1.4.1" else None)
            if self.version != "1.4.1":
                add(init, "ref", uri)
        return self._images[uri]

    def source(self, parent: Any, name: str, values: np.ndarray, params: str, kind: str = "float") -> str:
        """A <source> of rows (N, width), or of words, and its id. ``params``: names of the columns."""
        source_id = self.new_id(name)
        source = add(parent, "source", id=source_id)
        tag = "Name_array" if kind == "name" else "float_array"
        array_id = self.new_id(f"{name}-array")
        words = " ".join(values.tolist()) if kind == "name" else format_numbers(values.ravel())
        add(source, tag, words, id=array_id, count=str(values.size))
        width = 1 if values.ndim == 1 else values.shape[1]
        accessor = add(
            add(source, "technique_common"),
            "accessor",
            source=f"#{array_id}",
            count=str(len(values)),
            stride=str(width),
        )
        for param in params.split():
            add(accessor, "param", name=param, type=kind)
        return source_id

    def finish(self) -> bytes:
        """The document, its empty libraries left out, in COLLADA's namespace."""
        at = 1  # after <asset>
        for library in self.libraries.values():
            if len(library):
                self.root.insert(at, library)
                at += 1
        for element in self.root.iter(etree.Element):
            if not element.tag.startswith("{"):
                element.tag = f"{{{self.namespace}}}{element.tag}"
        root = etree.Element(self.root.tag, self.root.attrib, nsmap={None: self.namespace})
        root.extend(list(self.root))
        etree.cleanup_namespaces(root)
        etree.indent(root)
        data: bytes = etree.tostring(root, encoding="utf-8", xml_declaration=True)
        return data


def add(parent: Any, tag: str, text: str | None = None, **attributes: str) -> Any:
    """A new last child. Characters that XML does not allow are left out."""
    child = etree.SubElement(parent, tag, {k: _ILLEGAL.sub("", v) for k, v in attributes.items()})
    if text is not None:
        child.text = _ILLEGAL.sub("", text)
    return child


def add_extra(parent: Any) -> Any:
    """Our <technique> in an element's <extra>, the last of its children."""
    found = own_extra(parent)
    return add(add(parent, "extra"), "technique", profile=PROFILE) if found is None else found


def add_name(element: Any, prim: Any) -> None:
    """The prim's display name: as the element's name, or in <extra> where 1.4.1 does not allow it as a name."""
    name = prim.GetDisplayName()
    if not name:
        return
    if re.fullmatch(r"[^\W\d][\w.-]*", name):
        element.set("name", name)
    else:
        add(add_extra(element), "display", name=name)


def add_kept_extras(parent: Any, prim: Any) -> None:
    """What other programs had written there when the prim was read."""
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False)
    for text in prim.GetCustomDataByKey(KEPT) or []:
        try:
            extra = etree.fromstring(text, parser)
        except etree.XMLSyntaxError:
            continue  # not from a COLLADA file: someone else's customData
        for element in extra.iter(*(f"{{{n}}}*" for n in NAMESPACES)):
            element.tag = etree.QName(element).localname
        parent.append(extra)
