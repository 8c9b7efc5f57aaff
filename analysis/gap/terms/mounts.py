"""What lamps and cameras are mounted on: a ring, a bar or a frame that is off moves all lamps that hang on it alike."""

from collections.abc import Sequence

from interchange.effects.parts import members

MOUNT = 0.5  # of a lamp's tolerance: what its mount is off by; no file says, and the smaller, the rarer a bank is found
ALL = ""  # the target of all lamps, or of all cameras
CREEPING = ", creeping"  # after a camera's name: what its mount gives way by while it captures


def on_one_mount(lamps: Sequence[str]) -> list[str]:
    """Targets of several ``lamps`` at once: all, and those of them that are under one prim."""
    parents = {n[:k] for n in lamps for k, letter in enumerate(n) if letter == "/" and k}
    groups: dict[frozenset[str], str] = {}
    for parent in sorted(parents, key=len):
        groups.setdefault(frozenset(members(lamps, parent)), parent)
    several = [target for group, target in groups.items() if 1 < len(group) < len(lamps)]
    return [ALL, *several] if len(lamps) > 1 else []


def lamps_of(lamps: Sequence[str], target: str) -> list[str]:
    return list(lamps) if target == ALL else members(lamps, target)
