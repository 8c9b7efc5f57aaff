"""An object that defects have cut into pieces: ``/World/Plate`` is what is sound, ``/World/Plate|scratch_0|dent_0``
what lies in both of those defects. No prim's name holds the bar.
"""

from collections.abc import Iterable, Sequence

from interchange.scene import Body, Scene

BAR = "|"


def piece(name: str, label: str) -> str:
    """The piece of a piece that also lies in the defect ``label``."""
    return f"{name}{BAR}{label}"


def object_of(name: str) -> str:
    return name.partition(BAR)[0]


def pieces_of(scene: Scene, objects: Sequence[str]) -> tuple[Body, ...]:
    return tuple(b for b in scene.bodies if object_of(b.name) in objects)


def names_of(names: Iterable[str], target: str, label: str = "") -> list[str]:
    """Of ``names`` those of an object's pieces; with ``label`` those that lie in that defect."""
    own = [n for n in names if object_of(n) == target]
    return [n for n in own if label in n.split(BAR)[1:]] if label else own
