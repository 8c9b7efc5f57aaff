"""A stage that is edited while it is looked at: snapshots of its own layer for undo, and scenes read again in parts.

Edits go to the stage's root layer, so that files it refers to stay as they are and what others wrote stays in it.
A snapshot shares its arrays with the layer; restoring one touches only what differs.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pxr import Sdf, Tf, Usd, UsdGeom, UsdLux, UsdShade

from interchange.formats.document import Document
from interchange.formats.usd_author import new_stage
from interchange.formats.usd_material import read_material
from interchange.formats.usd_read import SceneReader, frame_times
from interchange.formats.usd_values import Finder
from interchange.material import Material
from interchange.problems import FileError, Problem, Where, errors
from interchange.scene import Scene

KEEPS_SURFACE = (
    "xformOp",
    "visibility",
    "material:binding",
)  # what moves, hides or dresses a mesh, not its shape


@dataclass(frozen=True)
class Node:
    """One line of the scene tree. ``kind``: group, mesh, light, camera, material."""

    path: str
    name: str
    kind: str
    visible: bool
    children: tuple["Node", ...] = ()

    def below(self) -> Iterator["Node"]:
        """This node and all under it, in the order of the tree."""
        yield self
        for child in self.children:
            yield from child.below()


class LiveStage:
    """A document's stage; ``scene`` gives the same records again for what no edit has touched."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self.stage: Usd.Stage = document.stage
        self.reader = SceneReader(self.stage, str(document.path))
        self._changed: set[str] = set()
        self._notice = Tf.Notice.Register(Usd.Notice.ObjectsChanged, self._notify, self.stage)

    @classmethod
    def empty(cls, path: Path) -> "LiveStage":
        """A new scene in millimetres, z up, that no file holds yet."""
        return cls(Document(new_stage(), path))

    def _notify(self, notice: Usd.Notice.ObjectsChanged, sender: Usd.Stage) -> None:
        for path in [*notice.GetResyncedPaths(), *notice.GetChangedInfoOnlyPaths()]:
            if not (path.IsPropertyPath() and path.name.startswith(KEEPS_SURFACE)):
                self._changed.add(str(path.GetPrimPath()))

    def scene(self, time: float) -> Scene:
        """Raises FileError with every problem."""
        wrong = errors(self.document.problems)
        if wrong:
            raise FileError(wrong)
        self._refresh()
        return self.reader.scene(time)

    def problems(self, time: float) -> list[Problem]:
        """What ``scene`` would leave out or refuse."""
        self._refresh()
        return [*self.document.problems, *self.reader.problems(time)]

    def times(self) -> list[float]:
        """The time codes of the frames."""
        return frame_times(self.stage)

    def _refresh(self) -> None:
        if "/" in self._changed:
            self.reader = SceneReader(self.stage, str(self.document.path))
        elif self._changed:
            self.reader.forget(self._changed)
        self._changed.clear()

    def snapshot(self) -> Sdf.Layer:
        """What the root layer says now."""
        kept = Sdf.Layer.CreateAnonymous(".usda")
        kept.TransferContent(self.stage.GetRootLayer())
        return kept

    def restore(self, snapshot: Sdf.Layer) -> None:
        """Say again what was said then."""
        self.stage.GetRootLayer().TransferContent(snapshot)

    def equals(self, snapshot: Sdf.Layer) -> bool:
        """Whether the root layer says what ``snapshot`` says, to the last opinion and in the same order."""
        return bool(self.stage.GetRootLayer().ExportToString() == snapshot.ExportToString())

    def keep_in(self, file: Path) -> None:
        """Write the root layer as it is, for ``recall``; relative paths are left as they are. Raises FileError."""
        kept = Sdf.Layer.CreateAnonymous(".usdc")
        kept.TransferContent(self.stage.GetRootLayer())
        if not kept.Export(str(file)):
            raise FileError(Problem("The autosave cannot be written.", Where(str(file))))

    def recall(self, file: Path) -> None:
        """Take over what ``keep_in`` wrote. Raises FileError where the file is damaged."""
        try:
            kept = Sdf.Layer.OpenAsAnonymous(str(file))
        except Tf.ErrorException:
            raise FileError(Problem("The autosave cannot be read.", Where(str(file)))) from None
        self.stage.GetRootLayer().TransferContent(kept)

    def outline(self) -> tuple[Node, ...]:
        """The scene tree, without the shaders inside of materials and the parts inside of meshes."""
        return tuple(_nodes(self.stage.GetPseudoRoot()))

    def exists(self, path: str) -> bool:
        return bool(path and Sdf.Path.IsValidPathString(path) and self.stage.GetPrimAtPath(path))

    def material(self, path: str, time: float) -> Material | None:
        """A material by its path, whether a body shows it or not; None where there is none that can be read."""
        prim = self.stage.GetPrimAtPath(path)
        if not prim or not prim.IsA(UsdShade.Material):
            return None
        self._refresh()
        find = Finder(str(self.document.path))
        bound = self.reader.keep(
            ("material", path),
            False,
            Usd.TimeCode(time),
            lambda: (read_material(prim, Usd.TimeCode(time), find, self.reader.texture), find.problems),
        )
        return None if errors(bound[1]) else bound[0].material

    def material_of(self, path: str) -> str:
        """The path of the material that a body shows; "" where it has none."""
        found, _ = UsdShade.MaterialBindingAPI(self.stage.GetPrimAtPath(path)).ComputeBoundMaterial()
        return str(found.GetPath()) if found else ""


def reread(document: Document) -> None:
    """USD keeps one layer a file in memory, with edits that were thrown away: take the file's own content."""
    layer = document.stage.GetRootLayer()
    if layer.dirty and not layer.anonymous:
        layer.Reload(True)


def _nodes(parent: Usd.Prim) -> Iterator[Node]:
    for prim in parent.GetFilteredChildren(Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)):
        kind = kind_of(prim)
        if kind is None:
            continue
        inner = () if kind in ("material", "mesh") else tuple(_nodes(prim))
        image = UsdGeom.Imageable(prim)
        shown = not image or image.GetVisibilityAttr().Get() != UsdGeom.Tokens.invisible
        yield Node(str(prim.GetPath()), prim.GetDisplayName() or prim.GetName(), kind, shown, inner)


def kind_of(prim: Any) -> str | None:
    """What a prim is in the tree; None for what the tree does not show."""
    if prim.HasAPI(UsdLux.LightAPI):
        return "light"
    if prim.IsA(UsdGeom.Camera):
        return "camera"
    if prim.IsA(UsdShade.Material):
        return "material"
    if prim.IsA(UsdShade.Shader) or prim.IsA(UsdGeom.Subset):
        return None
    if prim.IsA(UsdGeom.Gprim) or prim.IsA(UsdGeom.PointInstancer):
        return "mesh"
    return "group"
