"""What is wrong with a COLLADA file, with the element at which it was noticed."""

import os
from dataclasses import replace
from typing import Any

from interchange.problems import FileError, Problem, Severity, Where

MOST = 200  # findings kept: a file of rubbish must not fill the memory with messages about it


def place(element: Any) -> Where:
    """File, and path from the nearest element with an id: ``geometry#cube/mesh/triangles (line 33)``."""
    steps: list[str] = []
    node = element
    while node is not None and node.getparent() is not None:
        name = node.get("id")
        steps.append(f"{node.tag}#{name}" if name else str(node.tag))
        if name:
            break
        node = node.getparent()
    path = "/".join(reversed(steps)) or str(element.tag)
    return Where(element.getroottree().docinfo.URL or "", f"{path} (line {element.sourceline})")


class Findings:
    """Collects problems; ``check`` raises one FileError for all that make the file unusable."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.problems: list[Problem] = []
        self.left_out = 0
        self._known: set[Problem] = set()

    def _add(self, severity: Severity, message: str, element: Any) -> None:
        where = Where(self.file) if element is None else place(element)
        if where.file == os.path.abspath(self.file):
            where = replace(where, file=self.file)  # as the user named it
        problem = Problem(message, where, severity)
        if problem in self._known:
            return
        if len(self.problems) >= MOST:
            self.left_out += 1
            if severity is not Severity.ERROR or any(p.severity is Severity.ERROR for p in self.problems):
                return
        self._known.add(problem)
        self.problems.append(problem)

    def error(self, message: str, element: Any = None) -> None:
        self._add(Severity.ERROR, message, element)

    def loss(self, message: str, element: Any = None) -> None:
        self._add(Severity.LOSS, message, element)

    def note(self, message: str, element: Any = None) -> None:
        self._add(Severity.NOTE, message, element)

    def check(self) -> None:
        """Raise FileError with every error found so far, if there is one."""
        errors = [p for p in self.problems if p.severity is Severity.ERROR]
        if errors:
            if self.left_out:
                errors.append(Problem(f"{self.left_out} more findings are not listed.", Where(self.file)))
            raise FileError(errors)
