"""Trials of a search, kept line by line while it runs, so that one that was broken off goes on.

A search draws the same trials from the same arguments. It is therefore begun anew, and what is in the file is not done
again: a trial that was kept answers for the one of the same number and the same parameters. The outcome is that of a
search that was never broken off. The first line says by a key what the trials are of; those of anything else are
dropped, and so is a line that was cut off.
"""

import hashlib
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from interchange.formats.atomic import written_beside

VERSION = 1  # of what trials say: raised where a measure of the program comes to mean something else


def key_of(*about: object) -> str:
    return hashlib.sha256(json.dumps([VERSION, *(repr(a) for a in about)]).encode()).hexdigest()


class Kept:
    """``path`` None keeps nothing. ``answered``: how many trials were not done again."""

    def __init__(self, path: Path | None, key: str) -> None:
        self.path = path
        self._known = _read(path, key) if path else []
        self.answered = 0
        if path is None:
            return
        path.parent.mkdir(parents=True, exist_ok=True)
        beside = written_beside(path)
        beside.write_text("".join(json.dumps(line) + "\n" for line in [{"key": key}, *self._known]), "utf-8")
        os.replace(beside, path)

    def result(self, number: int, parameters: Mapping[str, Any]) -> Any:
        """What trial ``number`` gave before, None where it was not done with these parameters."""
        if number < len(self._known) and self._known[number]["parameters"] == dict(parameters):
            self.answered += 1
            return self._known[number]["result"]
        return None

    def keep(self, parameters: Mapping[str, Any], result: Any) -> None:
        if self.path is not None:
            with open(self.path, "a", encoding="utf-8") as stream:
                stream.write(json.dumps({"parameters": dict(parameters), "result": result}) + "\n")


def _read(path: Path, key: str) -> list[dict[str, Any]]:
    try:
        head, *lines = path.read_text(encoding="utf-8").splitlines()
        if json.loads(head) != {"key": key}:
            return []
    except (OSError, ValueError):  # there is none that can be read
        return []
    found = []
    for line in lines:
        try:
            one = json.loads(line)
        except ValueError:
            break  # cut off in the middle of it
        found.append({"parameters": one["parameters"], "result": one["result"]})
    return found
