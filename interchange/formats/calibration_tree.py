"""Words and numbers of a calibration file with the lines they stand on, from YAML or XML, read without harm.

YAML becomes nodes alone: no tag makes an object. Aliases are followed up to a bounded size. XML has no document type.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from interchange.problems import FileError, Problem, Where, did_you_mean

MOST_BYTES = 16 << 20
MOST_YAML = 2 << 20  # bytes; PyYAML reads some 100 kB a second
MOST_NODES = 200_000
DEEPEST = 20


@dataclass(frozen=True)
class Entry:
    """``value``: text, a list of entries, or entries by name."""

    value: "str | list[Entry] | dict[str, Entry]"
    line: int
    file: str

    def fail(self, message: str) -> NoReturn:
        raise FileError(Problem(message, Where(self.file, f"line {self.line}")))

    def __contains__(self, name: str) -> bool:
        return isinstance(self.value, dict) and name in self.value

    def names(self) -> list[str]:
        return list(self.value) if isinstance(self.value, dict) else []

    def __getitem__(self, name: str) -> "Entry":
        if name not in self:
            self.fail(f'There must be a "{name}" here.{did_you_mean(name, self.names())}')
        assert isinstance(self.value, dict)
        return self.value[name]

    def first(self, *names: str) -> "Entry | None":
        """The first of the names that is here."""
        return next((self[n] for n in names if n in self), None)

    def text(self) -> str:
        if not isinstance(self.value, str):
            self.fail("A word was expected here.")
        return self.value

    def numbers(self, count: int | None = None) -> np.ndarray:
        """(n,) finite numbers of a list, a list of lists, a matrix with its ``data``, or one number."""
        leaves = list(self["data"]._leaves() if "data" in self else self._leaves())
        found = []
        for leaf in leaves:
            try:
                number = float(leaf.text())
            except ValueError:
                leaf.fail(f'A number was expected; got "{leaf.text()[:40]}".')
            if not np.isfinite(number):
                leaf.fail(f"Every number must be finite; got {leaf.text()[:40]}.")
            found.append(number)
        if count is not None and len(found) != count:
            self.fail(f"{count} numbers must stand here; got {len(found)}.")
        return np.array(found)

    def number(self) -> float:
        return float(self.numbers(1)[0])

    def whole(self) -> int:
        """A whole number."""
        number = self.number()
        if number != int(number):
            self.fail(f"A whole number was expected; got {number:g}.")
        return int(number)

    def _leaves(self) -> Iterator["Entry"]:
        if isinstance(self.value, str):
            words = self.value.split()
            for word in words if len(words) > 1 else [self.value]:
                yield Entry(word, self.line, self.file)
        elif isinstance(self.value, list):
            for entry in self.value:
                yield from entry._leaves()
        else:
            self.fail("Numbers were expected here.")


def read_text(path: Path) -> str:
    """The text of a calibration file. Raises FileError."""
    where = Where(str(path))
    try:
        if path.stat().st_size > MOST_BYTES:
            raise FileError(
                Problem(f"A calibration file must be smaller than {MOST_BYTES >> 20} MiB.", where)
            )
        data = path.read_bytes()
    except OSError as error:
        raise FileError(Problem(f"The file cannot be read: {error.strerror}.", where)) from None
    if b"\0" in data:
        raise FileError(Problem("A calibration file must be text; this is not.", where))
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def read_yaml(path: Path) -> Entry:
    """A YAML file, also OpenCV's (its first line, ``%YAML:1.0``, is not YAML). Raises FileError."""
    import yaml

    text = re.sub(r"\A\s*%YAML[: ]1\.\d[^\n]*", "", read_text(path))
    if len(text) > MOST_YAML:
        message = f"A calibration in YAML must be smaller than {MOST_YAML >> 20} MiB."
        raise FileError(Problem(message, Where(str(path))))
    try:
        node = yaml.compose(text, Loader=yaml.SafeLoader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = f"line {mark.line + 1}" if mark else ""
        raise FileError(
            Problem(f"The file is not YAML: {error.problem or error.context}.", Where(str(path), line))
        ) from None
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        reason = "it is nested too deep" if isinstance(error, RecursionError) else str(error)
        raise FileError(Problem(f"The file is not YAML: {reason}.", Where(str(path)))) from None
    if node is None:
        raise FileError(Problem("The file holds nothing.", Where(str(path))))
    count = 0

    def entry(node: Any, depth: int) -> Entry:
        nonlocal count
        count += 1
        line = node.start_mark.line + 1
        if depth > DEEPEST or count > MOST_NODES:
            message = f"A calibration must have at most {MOST_NODES} values, {DEEPEST} deep."
            raise FileError(Problem(message, Where(str(path), f"line {line}")))
        if isinstance(node, yaml.ScalarNode):
            return Entry(node.value, line, str(path))
        if isinstance(node, yaml.SequenceNode):
            return Entry([entry(n, depth + 1) for n in node.value], line, str(path))
        named: dict[str, Entry] = {}
        for key, value in node.value:
            name = key.value if isinstance(key, yaml.ScalarNode) else ""
            if not name or name in named:
                message = f'"{name}" is there twice.' if name else "A name was expected before the colon."
                raise FileError(Problem(message, Where(str(path), f"line {key.start_mark.line + 1}")))
            named[name] = entry(value, depth + 1)
        return Entry(named, line, str(path))

    return entry(node, 0)


def read_xml(path: Path) -> Entry:
    """OpenCV's XML. Raises FileError."""
    from lxml import etree

    where = Where(str(path))
    text = read_text(path)
    if "<!DOCTYPE" in text.upper() or "<!ENTITY" in text.upper():
        raise FileError(Problem("A document type is refused; OpenCV's files have none.", where))
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False)
    try:
        root = etree.fromstring(text.encode("utf-8"), parser)
    except etree.XMLSyntaxError as error:
        line = f"line {error.lineno}" if error.lineno else ""
        raise FileError(
            Problem(f"The file is not well-formed XML: {error.msg}.", Where(str(path), line))
        ) from None
    except ValueError:
        raise FileError(
            Problem("The file is not well-formed XML: its encoding is not known.", where)
        ) from None
    if root.tag != "opencv_storage":
        message = f"OpenCV's XML begins with <opencv_storage>; this with <{root.tag}>."
        raise FileError(Problem(message, Where(str(path), f"line {root.sourceline}")))

    def entry(element: Any, depth: int) -> Entry:
        line = element.sourceline or 0
        children = [c for c in element if isinstance(c.tag, str)]
        if depth > DEEPEST:
            message = f"Elements must not be nested more than {DEEPEST} deep."
            raise FileError(Problem(message, Where(str(path), f"line {line}")))
        if not children:
            return Entry((element.text or "").strip(), line, str(path))
        if all(c.tag == "_" for c in children):
            return Entry([entry(c, depth + 1) for c in children], line, str(path))
        return Entry({c.tag: entry(c, depth + 1) for c in children}, line, str(path))

    return entry(root, 0)
