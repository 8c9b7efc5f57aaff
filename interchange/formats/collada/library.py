"""The documents of a COLLADA file: itself and the local ones it refers to, and what their URIs mean."""

import re
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urljoin, urlsplit

import numpy as np

from interchange.formats.collada.findings import Findings
from interchange.formats.collada.safe_xml import parse
from interchange.frames import z_up_from_x_up, z_up_from_y_up
from interchange.problems import FileError, Problem, Where, did_you_mean

MOST_DOCUMENTS = 64
UP = {"X_UP": z_up_from_x_up, "Y_UP": z_up_from_y_up, "Z_UP": np.eye(4)}


class Library:
    """Opens documents on demand, each once. ``main`` is the root of the file that was asked for."""

    def __init__(self, path: Path, find: Findings) -> None:
        self.find = find
        self._documents: dict[Path, Any] = {}
        self._ids: dict[Any, dict[str, Any]] = {}
        self._frames: dict[Any, tuple[float, str]] = {}
        self._own: dict[Any, bool] = {}
        self.versions: dict[Any, str] = {}
        self.main = self._open(path.absolute())

    def _open(self, path: Path) -> Any:
        if path not in self._documents:
            if len(self._documents) >= MOST_DOCUMENTS:
                message = f"A file may refer to {MOST_DOCUMENTS} documents at most."
                raise FileError(Problem(message, Where(str(path))))
            root, version = parse(path)
            self._documents[path] = root
            self.versions[root] = version
            ids: dict[str, Any] = {}
            for element in root.iter():
                name = element.get("id")
                if name is None:
                    continue
                if name in ids:
                    self.find.loss(f'The id "{name}" is given twice; the first one counts.', element)
                else:
                    ids[name] = element
            self._ids[root] = ids
        return self._documents[path]

    def main_of(self, element: Any) -> Any:
        return element.getroottree().getroot()

    def by_id(self, name: str, element: Any) -> Any:
        """The element with that id in the document of ``element``, or None."""
        return self._ids[self.main_of(element)].get(name)

    def file(self, uri: str, element: Any, what: str) -> Path | None:
        """The local path that a URI in ``element`` means; None, with a finding, for what is not a local file.

        Percent escapes, ``..``, blanks and ``xml:base`` are honoured. Nothing is fetched.
        """
        here = Path(element.getroottree().docinfo.URL)
        base = self.main_of(element).get("{http://www.w3.org/XML/1998/namespace}base", "")
        uri = uri.strip().replace("\\", "/")
        if base and not urlsplit(uri).scheme and not uri.startswith("/"):
            uri = urljoin(base, uri)
        if re.match(r"^/?[A-Za-z]:/", uri) or uri.startswith("//"):
            self.find.error(f'{what} "{uri}" lies on another machine; relative paths travel.', element)
            return None
        parts = urlsplit(uri)
        if parts.scheme not in ("", "file") or (
            parts.scheme == "file" and parts.netloc not in ("", "localhost")
        ):
            self.find.loss(f'{what} "{uri}" lies on a network and is not fetched.', element)
            return None
        return (here.parent / unquote(parts.path)).resolve()

    def resolve(self, uri: str | None, element: Any, kind: str | tuple[str, ...]) -> Any:
        """The element that a URI reference means, or None with a finding. ``kind``: the tag it must have."""
        kinds = (kind,) if isinstance(kind, str) else kind
        what = kinds[0]
        if not uri or not uri.strip():
            self.find.error(f"<{element.tag}> must name the {what} it uses.", element)
            return None
        before, _, fragment = uri.strip().partition("#")
        root = self.main_of(element)
        if before:
            path = self.file(before, element, f"The {what}")
            if path is None:
                return None
            try:
                root = self._open(path)
            except FileError as error:
                self.find.error(f'The {what} "{uri}" cannot be read: {error}', element)
                return None
        name = unquote(fragment)
        if not name:  # 1.4 allows a whole document where it holds one such element
            alone = [e for e in root.iter(*kinds) if e.get("id")]
            if before and len(alone) == 1:
                return alone[0]
            self.find.error(f'The {what} "{uri}" must be named by its id after a #.', element)
            return None
        ids = self._ids[root]
        found = ids.get(name, ids.get(fragment))
        if found is None:
            near = [i for i, e in ids.items() if e.tag in kinds]
            self.find.error(f'There is no {what} "{uri}".{did_you_mean(name, near)}', element)
            return None
        if found.tag not in kinds:
            self.find.error(f'"{uri}" must be a {what}; it is a {found.tag}.', element)
            return None
        return found

    def unit_and_up(self, element: Any) -> tuple[float, str]:
        """Metres per unit and the up axis that hold at an element: those of the nearest <asset>."""
        if element is None:
            return 1.0, "Y_UP"
        if element not in self._frames:
            unit, up = self.unit_and_up(element.getparent())
            asset = element.find("asset")
            if asset is not None:
                unit, up = self._asset(asset, unit, up)
            self._frames[element] = (unit, up)
        return self._frames[element]

    def frame_within(self, element: Any, context: Any, context_frame: np.ndarray) -> np.ndarray:
        """The frame of what is instanced: its own <asset>'s, else that of the ``context`` which instances it,
        else, in another document, that document's."""
        if self._has_own(element):
            return self.frame(element)
        return context_frame if self.main_of(element) is self.main_of(context) else self.frame(element)

    def _has_own(self, element: Any) -> bool:
        """Whether an <asset> below the root gives an element its own unit or up axis."""
        if element.getparent() is None:
            return False
        if element not in self._own:
            asset = element.find("asset")
            own = asset is not None and (asset.find("unit") is not None or asset.find("up_axis") is not None)
            self._own[element] = own or self._has_own(element.getparent())
        return self._own[element]

    def _asset(self, asset: Any, unit: float, up: str) -> tuple[float, str]:
        given = asset.find("unit")
        if given is not None:
            text = given.get("meter", "1")
            try:
                value = float(text)
            except ValueError:
                value = float("nan")
            if 1e-12 <= value <= 1e12:
                unit = value
            else:
                self.find.error(f"A unit must be above 0 metres; got {text!r}.", given)
        axis = (asset.findtext("up_axis") or "").strip()
        if axis in UP:
            up = axis
        elif axis:
            self.find.error(f"up_axis must be X_UP, Y_UP or Z_UP; got {axis!r}.", asset)
        return unit, up

    def frame(self, element: Any) -> np.ndarray:
        """(4, 4): from the unit and axes that hold at an element to metres and z up."""
        unit, up = self.unit_and_up(element)
        return UP[up] @ np.diag([unit, unit, unit, 1.0])
