"""What was done, so that it can be undone: a line of steps with what the scene said before and after each."""

from dataclasses import dataclass, replace
from typing import Any

from composer.editor.commands import Command

LONGEST = (
    200  # steps; a snapshot shares its arrays with the stage, so a step costs as much as its prims' records
)


@dataclass(frozen=True, eq=False)
class Step:
    command: Command
    before: Any  # snapshots of interchange.formats.usd_edit
    after: Any
    selected_before: tuple[str, ...]
    selected_after: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class History:
    done: tuple[Step, ...] = ()
    undone: tuple[Step, ...] = ()  # the last one is redone first

    @property
    def last(self) -> Step | None:
        return self.done[-1] if self.done else None

    def then(self, step: Step, continuing: bool = False) -> "History":
        """With one more step. ``continuing``: it goes on with what the last step did, and becomes one with it."""
        last = self.last
        alike = (
            last is not None
            and step.command.target is not None
            and type(last.command) is type(step.command)
            and last.command.target == step.command.target
        )
        if continuing and alike and last is not None:
            step = replace(step, before=last.before, selected_before=last.selected_before)
            return History((*self.done[:-1], step))
        return History((*self.done, step)[-LONGEST:])

    def undo(self) -> "History":
        return History(self.done[:-1], (*self.undone, self.done[-1])) if self.done else self

    def redo(self) -> "History":
        return History((*self.done, self.undone[-1]), self.undone[:-1]) if self.undone else self
