"""OSL sources in Blender: compiled by Cycles itself and put into nodes and cameras as bytecode.

Blender's own way there needs the module ``oslquery``, which its wheel lacks.
"""

import hashlib
from functools import lru_cache
from pathlib import Path
from typing import Any

import _cycles
import bpy


class ShaderError(RuntimeError):
    """An OSL source of ours that does not compile: a fault of the program."""


@lru_cache(maxsize=256)
def compiled(source: str, folder: Path) -> tuple[str, str]:
    """Bytecode and its hash."""
    name = hashlib.md5(source.encode(), usedforsecurity=False).hexdigest()
    osl, oso = folder / f"{name}.osl", folder / f"{name}.oso"
    osl.write_text(source, encoding="utf8")
    if not _cycles.osl_compile(str(osl), str(oso)):
        raise ShaderError(f"The shader {osl} does not compile.")
    code = oso.read_text(encoding="utf8")
    osl.unlink()
    oso.unlink()
    return code, hashlib.md5(code.encode(), usedforsecurity=False).hexdigest()


SOCKET = {int: "NodeSocketInt", float: "NodeSocketFloat"}


class ScriptMaterial:
    """A Blender material that is one script node. Sockets are set only when their value is another one."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.source = ""
        self.values: dict[str, Any] = {}
        self.data = bpy.data.materials.new("material")
        self.data.use_nodes = True
        self.data.cycles.emission_sampling = "NONE"
        if hasattr(self.data.cycles, "use_bump_map_correction"):
            self.data.cycles.use_bump_map_correction = False
        tree = self.data.node_tree
        tree.nodes.clear()
        self.node = tree.nodes.new("ShaderNodeScript")
        output = tree.nodes.new("ShaderNodeOutputMaterial")
        tree.links.new(self.node.outputs.new("NodeSocketShader", "Surface"), output.inputs["Surface"])
        for name, attribute in (
            ("uv", "bf_uv"),
            ("body_normal", "bf_normal"),
            ("body_tangent", "bf_tangent"),
        ):
            source = tree.nodes.new("ShaderNodeAttribute")
            source.attribute_name = attribute
            tree.links.new(source.outputs["Vector"], self.node.inputs.new("NodeSocketVector", name))
        about = tree.nodes.new("ShaderNodeObjectInfo")
        tree.links.new(about.outputs["Color"], self.node.inputs.new("NodeSocketColor", "task"))

    def update(self, source: str, values: dict[str, Any]) -> None:
        if source != self.source:
            self.node.bytecode, self.node.bytecode_hash = compiled(source, self.folder)
            self.source = source
            self.data.node_tree.update_tag()
        for name, value in values.items():
            if self.values.get(name) == value:
                continue
            if name not in self.node.inputs:
                kind = "NodeSocketVector" if isinstance(value, tuple) else SOCKET[type(value)]
                self.node.inputs.new(kind, name)
            self.node.inputs[name].default_value = value
            self.values[name] = value
        for name in [n for n in self.values if n not in values]:
            self.node.inputs.remove(self.node.inputs[name])
            del self.values[name]

    def remove(self) -> None:
        bpy.data.materials.remove(self.data)
