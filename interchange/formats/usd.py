"""USD files: .usda, .usd, .usdc, .usdz. What is read is kept as it is; a save changes what was edited and no more."""

import os
import re
import shutil
from pathlib import Path
from typing import Any

from interchange.formats.atomic import written_beside
from interchange.formats.base import Format, Options
from interchange.formats.document import Document
from interchange.formats.isolation import isolated
from interchange.problems import FileError, Problem, Severity, Where

PRELOAD = ("pxr.Usd",)
_checked: set[tuple[str, int, int]] = set()  # files that a process of its own has read without harm


class UsdFormat(Format):
    name = "USD"
    extensions = (".usda", ".usd", ".usdc", ".usdz")
    writes = True

    def recognises(self, head: bytes) -> bool:
        return head.startswith((b"#usda", b"PXR-USDC"))

    def read(self, path: Path, options: Options) -> Document:
        """Open a stage. What it refers to and cannot be found is an error of the scene, not of the opening."""
        where = Where(str(path))
        stat = path.stat()
        key = (str(path.resolve()), stat.st_mtime_ns, stat.st_size)
        if key not in _checked:
            wrong = isolated(probe, path)
            if wrong:
                raise FileError([Problem(w, where) for w in wrong])
            _checked.add(key)
        from pxr import Usd, UsdUtils

        delegate = UsdUtils.CoalescingDiagnosticDelegate()  # keeps USD's own messages off the terminal
        stage = Usd.Stage.Open(str(path))
        problems = [
            Problem(_plain(str(e)), Where(str(path), str(e.rootSite.path)), Severity.ERROR)
            for e in stage.GetCompositionErrors()
        ]
        problems += [
            Problem(_plain(d.commentary), where, Severity.NOTE) for d in _warnings(delegate, problems)
        ]
        return Document(stage, path, problems)

    def write(self, document: Document, path: Path) -> list[Problem]:
        """Write the stage's root layer where it was a USD file, so that its references and overrides stay what they
        are; a stage made from another format is written whole. Relative paths are anchored anew."""
        from pxr import Sdf, UsdUtils

        delegate = UsdUtils.CoalescingDiagnosticDelegate()
        beside = written_beside(path)
        root = document.stage.GetRootLayer()
        try:
            if path.suffix.lower() == ".usdz":
                _write_package(document, beside)
            else:
                layer = Sdf.Layer.CreateNew(str(beside))
                packed = root.realPath.endswith(".usdz")  # its inner paths mean nothing outside
                layer.TransferContent(document.stage.Flatten() if packed else root)
                if root.anonymous:
                    _bring_pictures(layer, path)
                elif not packed and Path(root.realPath).parent.resolve() != path.parent.resolve():
                    _anchor(layer, Path(root.realPath).parent, path.parent)
                if not layer.Save():
                    raise OSError("USD could not write it")
                del layer
            os.replace(beside, path)
        except (OSError, RuntimeError) as error:
            beside.unlink(missing_ok=True)
            reason = getattr(error, "strerror", None) or _tf_messages(str(error))[0]
            raise FileError(
                Problem(f"The file cannot be written: {reason.rstrip('.')}.", Where(str(path)))
            ) from None
        del delegate
        return []


def probe(path: str) -> list[str]:
    """Open and compose a stage; what stops it, one sentence each. Runs in a process of its own."""
    from pxr import Tf, Usd, UsdUtils

    delegate = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        stage = Usd.Stage.Open(path)
    except Tf.ErrorException as error:
        return list(dict.fromkeys(m.removeprefix(f"{path}:") for m in _tf_messages(str(error))))
    for prim in stage.TraverseAll():
        for attribute in prim.GetAuthoredAttributes():
            attribute.GetNumTimeSamples()
            attribute.Get()
    del delegate
    return []


def _tf_messages(text: str) -> list[str]:
    found = re.findall(r"at line \d+ in file \S+ : '(.*?)'\s*(?=\n\s*Error in|\Z)", text, re.DOTALL)
    found = [m for m in found if not m.startswith("Failed to open layer")] or found
    return [_plain(m) for m in found] or [_plain(text)]


def _plain(text: str) -> str:
    return " ".join(text.split())[:400]


def _warnings(delegate: Any, known: list[Problem]) -> list[Any]:
    said = " ".join(p.message for p in known)
    return [d for d in delegate.TakeUncoalescedDiagnostics() if _plain(d.commentary)[:60] not in said][:20]


def _anchor(layer: object, old: Path, new: Path) -> None:
    """Turn relative asset paths of a layer that moved so that they still reach the same files."""
    from pxr import UsdUtils

    def moved(asset: str) -> str:
        target = old / asset.split("[")[0]
        if not asset or asset.startswith(("/", "anon:")) or "://" in asset or not target.exists():
            return asset
        inside = asset[len(asset.split("[")[0]) :]
        return Path(os.path.relpath(target, new)).as_posix() + inside

    UsdUtils.ModifyAssetPaths(layer, moved)


def _bring_pictures(layer: object, path: Path) -> None:
    """Point a stage made from another format to its pictures by relative paths; those that were inside the source
    file, and so are in the user's cache alone, are copied to a folder beside the scene."""
    from pxr import UsdUtils

    def brought(asset: str) -> str:
        source = Path(asset)
        if not source.is_absolute() or not source.is_file():
            return asset
        if "brightfield/pictures" in source.as_posix():
            folder = path.with_name(f"{path.stem}_pictures")
            folder.mkdir(exist_ok=True)
            beside = written_beside(folder / source.name)
            shutil.copyfile(source, beside)
            os.replace(beside, folder / source.name)
            source = folder / source.name
        return Path(os.path.relpath(source, path.parent.resolve())).as_posix()

    UsdUtils.ModifyAssetPaths(layer, brought)


def _write_package(document: Document, beside: Path) -> None:
    from pxr import Sdf, UsdUtils

    folder = beside.with_suffix(".package")
    folder.mkdir()
    try:
        flat = folder / "scene.usdc"
        document.stage.Flatten().Export(str(flat))
        if not UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(flat)), str(beside)):
            raise OSError("USD could not make the package")
    finally:
        shutil.rmtree(folder)
