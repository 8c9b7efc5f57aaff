"""What is wrong with a file: every finding at once, each with its place, in one sentence.

A reader collects ``Problem`` records and raises one ``FileError`` that holds all of them; what does not
stop the reading (a thing that a format cannot carry, say) is kept as a note.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from enum import StrEnum


class Severity(StrEnum):
    NOTE = "note"  # nothing is lost
    LOSS = "loss"  # something was left out, and the rest is right
    ERROR = "error"  # the file cannot be used as it is


@dataclass(frozen=True)
class Where:
    """A place in a file: ``Where("scene.usda", "/World/Lamp", "inputs:intensity")``."""

    file: str = ""
    prim: str = ""
    attribute: str = ""

    def __str__(self) -> str:
        place = f"{self.prim}.{self.attribute}" if self.attribute else self.prim
        return f"{self.file}: {place}" if self.file and place else self.file or place


@dataclass(frozen=True)
class Problem:
    message: str
    where: Where = Where()
    severity: Severity = Severity.ERROR

    def __str__(self) -> str:
        text = " ".join(self.message.split())  # one line, whatever a library's own message looks like
        return f"{self.where}: {text}" if str(self.where) else text


class BrightfieldError(Exception):
    """An error that is told to the user as it is, without a traceback."""


class FileError(BrightfieldError):
    """A file that cannot be used. ``problems`` holds every reason, in the order of the file."""

    def __init__(self, problems: Problem | Iterable[Problem]) -> None:
        self.problems = [problems] if isinstance(problems, Problem) else list(problems)
        super().__init__("\n".join(map(str, self.problems)))

    def __reduce__(self) -> tuple[type["FileError"], tuple[list[Problem]]]:
        return type(self), (self.problems,)


def errors(problems: Iterable[Problem]) -> list[Problem]:
    return [p for p in problems if p.severity is Severity.ERROR]


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """`` Did you mean "Lafortune"?`` with a leading blank, or nothing where no known word is near."""
    near = get_close_matches(word, list(known), n=1, cutoff=0.6)
    return f' Did you mean "{near[0]}"?' if near else ""
