"""What a camera cannot see of a workpiece, drawn red over its picture, and told as shares of the surface."""

from dataclasses import dataclass
from typing import Any

import moderngl
import numpy as np
from imgui_bundle import imgui

from analysis.view.visibility import visibility
from composer.editor.window.state import State
from interchange.camera import Camera
from interchange.problems import BrightfieldError

WIDTH = 360  # px of the picture that it is found on
RED = (255, 50, 40, 150)


@dataclass
class Hidden:
    """``workpiece``: the paths that are meant; none of them, and nothing is drawn."""

    state: State
    workpiece: tuple[str, ...] = ()
    text: str = ""
    texture: moderngl.Texture | None = None
    found: Any = None

    def toggle(self) -> None:
        """For what is selected, or no more."""
        workspace = self.state.workspace
        chosen = tuple(p for p in workspace.selection if workspace.kind(p) in ("mesh", "group"))
        if self.workpiece:
            self.workpiece, self.text, self.found = (), "", None
        elif chosen:
            self.workpiece = chosen
        else:
            self.state.tell("Select the workpiece first: what else stands before it is then shown red.", True)

    def update(self, camera: Camera) -> None:
        """Find it anew where the scene has changed, and rests."""
        state = self.state
        key = (state.scene_key, state.workspace.time, camera.name, self.workpiece)
        if not self.workpiece or key == self.found or not state.quiet:
            return
        self.found = key
        if state.renderer is None or state.context is None:
            return
        before = state.context.detect_framebuffer()
        small = camera.resized(min(WIDTH, camera.sensor.resolution[0]))
        try:
            seen = visibility(state.renderer, state.scene, small, list(self.workpiece), count=5000)
        except BrightfieldError as error:
            self.text, self.texture = str(error), None
            return
        finally:
            before.use()
        parts = [f"seen {100 * seen.seen:.1f} %", f"out of view {100 * seen.outside:.1f} %"]
        parts.append(f"by itself {100 * seen.by_itself:.1f} %")
        parts += [f"by {name.rsplit('/', 1)[-1]} {100 * share:.1f} %" for name, share in seen.hidden.items()]
        self.text = "   ".join(parts)
        picture = np.where(seen.mask[..., None], np.array(RED, np.uint8), np.zeros(4, np.uint8))
        height, width = seen.mask.shape
        if self.texture is not None:
            self.texture.release()
        self.texture = state.context.texture((width, height), 4, np.ascontiguousarray(picture).tobytes())
        self.texture.filter = (moderngl.NEAREST, moderngl.NEAREST)

    def draw(self, draw: Any, low: Any, high: Any) -> None:
        if self.workpiece and self.texture is not None:
            draw.add_image(imgui.ImTextureRef(self.texture.glo), low, high)
