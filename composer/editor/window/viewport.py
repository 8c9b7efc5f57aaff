"""The overview: the scene in perspective, orbited, picked and moved with the mouse."""

import time
from typing import Any

import numpy as np
from imgui_bundle import imgui, imguizmo

from composer.editor import glyphs
from composer.editor.commands import Transform
from composer.editor.modal import Modal, meant
from composer.editor.orbit import gl_matrices
from composer.editor.picking import body_at, line_at
from composer.editor.solid_look import SolidLook
from composer.editor.window import theme
from composer.editor.window.actions import drop_material
from composer.editor.window.display import Display, Look
from composer.editor.window.places import mark_rect
from composer.editor.window.state import Dragged, State
from interchange.camera import Camera
from interchange.lamps.exposed import steady
from interchange.problems import BrightfieldError

GIZMO = imguizmo.im_guizmo
OPERATIONS = {
    "move": GIZMO.OPERATION.translate,
    "rotate": GIZMO.OPERATION.rotate,
    "scale": GIZMO.OPERATION.scale,
}
BUDGET = 0.040  # s: a picture that takes longer is drawn coarser while the view moves
DIGITS = "0123456789"


class Viewport:
    def __init__(self, state: State) -> None:
        self.state = state
        self.look = SolidLook()
        self.display: Display | None = None
        self.drawn: Any = None
        self.seconds = 0.0  # of the last picture at full size
        self.coarse = 1
        self.gain = 1.0
        self.modal: Modal | None = None
        self.press: tuple[float, float] | None = None
        self.turning = False
        self.origin, self.size = (0.0, 0.0), (16, 16)
        self.camera = state.orbit.camera(16, 16)
        self.hovered = False

    def gui(self) -> None:
        area = imgui.get_content_region_avail()
        width, height = max(16, int(area.x)), max(16, int(area.y))
        corner = imgui.get_cursor_screen_pos()
        self.origin, self.size = (corner.x, corner.y), (width, height)
        self.camera = self.state.orbit.camera(width, height)
        self._picture(width, height)
        draw = imgui.get_window_draw_list()
        end = imgui.ImVec2(corner.x + width, corner.y + height)
        draw.push_clip_rect(corner, end, True)
        draw.add_rect_filled(corner, end, theme.color32((*theme.BACKGROUND, 1.0)))
        self._grid(draw)  # behind the picture, which is clear where nothing is
        if self.display is not None and self.display.ready:
            draw.add_image(self.display.texture, corner, end)
        mark_rect("viewport", (corner.x, corner.y, corner.x + width, corner.y + height))
        imgui.dummy(imgui.ImVec2(width, height))  # ImGuizmo grabs nothing while an item is hovered
        self._dropped()
        self.hovered = imgui.is_window_hovered() and not imgui.is_any_item_hovered()
        self._overlay(draw)
        over = self._gizmo()
        if self.modal is not None:
            self._run_modal()
        elif not over:
            self._mouse()
        draw.pop_clip_rect()
        self._toolbar(corner)

    # the picture

    def _picture(self, width: int, height: int) -> None:
        state = self.state
        if state.renderer is None or state.context is None:
            return
        if self.display is None:
            self.display = Display(state.context)
        moving = not state.quiet
        coarse = self.coarse if moving else 1
        samples = 1 if moving else 4
        key = (state.scene_key, state.orbit, state.shading, width, height, coarse, samples)
        if key == self.drawn:
            return
        camera = self.camera if coarse == 1 else state.orbit.camera(width // coarse, height // coarse)
        scene = steady(state.scene)  # no exposure, but a look around
        solid = state.shading == "solid"
        if solid:
            scene = self.look.scene(scene, camera.world_from_camera)
        before = state.context.detect_framebuffer()
        began = time.perf_counter()
        try:
            image = state.renderer.render(scene, camera, samples=samples)
        except BrightfieldError as error:
            state.tell(str(error), error=True)
            self.drawn = key
            return
        finally:
            before.use()
        taken = time.perf_counter() - began
        if samples == 1:
            full = taken * coarse**2
            self.seconds = full
            self.coarse = 1 if full < BUDGET else 2 if full < 4 * BUDGET else 3
        if not solid and not moving:
            brightest = image.pixels.max(axis=-1)
            top = float(np.percentile(brightest, 99.5)) if brightest.size else 0.0
            self.gain = 1 / top if top > 0 else 1.0
        self.display.upload(image.pixels)
        self.display.draw(Look.SHADED if solid else Look.SRGB, 1.0 if solid else self.gain, theme.BACKGROUND)
        self.drawn = key

    # what is drawn over it

    def _overlay(self, draw: Any) -> None:
        state = self.state
        for path, segments in self.lines().items():
            chosen = self._chosen(path)
            plain = theme.LAMP if self._is_light(path) else theme.CAMERA
            self._lines(draw, segments, theme.SELECTED if chosen else plain, 2.0 if chosen else 1.3)
        for path in state.workspace.selection:
            bounds = self._body_bounds(path)
            if bounds is not None:
                self._lines(draw, glyphs.box(bounds), theme.SELECTED, 1.3)
        self._triad(draw)

    def _grid(self, draw: Any) -> None:
        state = self.state
        if state.show_grid:
            lines, pitch = glyphs.grid(state.orbit.distance)
            n = len(lines) // 2
            middle = [n // 2, n + n // 2]
            rest = np.delete(lines, middle, axis=0)
            self._lines(draw, rest, theme.GRID, 1.0)
            self._lines(draw, lines[[n + n // 2]], theme.GRID_X, 1.2)
            self._lines(draw, lines[[n // 2]], theme.GRID_Y, 1.2)
            x, y = self.origin[0] + 12, self.origin[1] + self.size[1] - 24
            draw.add_text(imgui.ImVec2(x + 74, y), theme.color32(theme.MUTED), f"grid {pitch * 1e3:g} mm")

    def _chosen(self, path: str) -> bool:
        return any(path == p or path.startswith(p + "/") for p in self.state.workspace.selection)

    def _is_light(self, path: str) -> bool:
        return any(x.name == path for x in self.state.scene.lights)

    def _body_bounds(self, path: str) -> np.ndarray | None:
        workspace = self.state.workspace
        if workspace.kind(path) not in ("mesh", "group"):
            return None
        dragged = self.state.dragged
        bounds = workspace.bounds([path])
        if bounds is not None and dragged is not None:
            corners = glyphs.box(bounds).reshape(-1, 3)
            moved = corners @ dragged.by[:3, :3].T + dragged.by[:3, 3]
            return np.stack([moved.min(0), moved.max(0)])
        return bounds

    def lines(self) -> dict[str, np.ndarray]:
        """Segments of every lamp and camera, by path."""
        state = self.state
        size = state.orbit.distance * 0.08
        found = {x.name: glyphs.lamp(x, size, self._chosen(x.name)) for x in state.scene.lights}
        for camera in state.scene.cameras:
            chosen = self._chosen(camera.name) and state.show_field
            far = self._reach(camera) if chosen else size
            found[camera.name] = glyphs.frustum(camera, min(size, far) * 0.6, far)
        return found

    def _reach(self, camera: Camera) -> float:
        """Depth to which the field of view is drawn: of the scene's middle, as the camera sees it."""
        bounds = self.state.workspace.bounds()
        if bounds is None:
            return camera.lens.focus_distance or self.state.orbit.distance
        pose = camera.world_from_camera
        depth = float((bounds.mean(axis=0) - pose[:3, 3]) @ pose[:3, 2])
        return camera.lens.focus_distance or max(depth, self.state.orbit.distance * 0.05)

    def _lines(
        self, draw: Any, segments: np.ndarray, rgba: tuple[float, float, float, float], width: float
    ) -> None:
        pixels, _ = glyphs.on_screen(self.camera, segments)
        color = theme.color32(rgba)
        x0, y0 = self.origin
        w, h = self.size
        a, b = pixels[:, 0], pixels[:, 1]
        inside = (
            (np.maximum(a, b) > 0).all(1)
            & (np.minimum(a[:, 0], b[:, 0]) < w)
            & (np.minimum(a[:, 1], b[:, 1]) < h)
        )
        for (ax, ay), (bx, by) in (pixels[inside] + [x0, y0]).tolist():
            draw.add_line((ax, ay), (bx, by), color, width)

    def _triad(self, draw: Any) -> None:
        """Which way x, y and z point."""
        axes = self.state.orbit.axes
        cx, cy = self.origin[0] + 42, self.origin[1] + self.size[1] - 44
        order = sorted(range(3), key=lambda k: -axes[k, 2])
        for k in order:
            dx, dy = axes[k, 0] * 28, axes[k, 1] * 28
            rgba = [(0.90, 0.35, 0.35, 1.0), (0.50, 0.78, 0.36, 1.0), (0.36, 0.58, 0.95, 1.0)][k]
            color = theme.color32(rgba)
            draw.add_line((cx, cy), (cx + dx, cy + dy), color, 2.0)
            draw.add_circle_filled((cx + dx, cy + dy), 7.5, color)
            draw.add_text((cx + dx - 4, cy + dy - 8), theme.color32((0.05, 0.05, 0.05, 1)), "XYZ"[k])

    # moving things

    def _pivot(self) -> np.ndarray | None:
        """Pose of what the gizmo is put at: the last that was selected."""
        paths = self.state.workspace.movable()
        if not paths:
            return None
        pose = self.state.workspace.pose(paths[-1])
        bounds = self.state.workspace.bounds([paths[-1]])
        if bounds is not None and self.state.workspace.kind(paths[-1]) in ("mesh", "group"):
            pose = pose.copy()
            pose[:3, 3] = bounds.mean(axis=0)  # parts from CAD have their origin anywhere
        return pose

    def _gizmo(self) -> bool:
        """Whether the mouse is the gizmo's."""
        state = self.state
        if self.modal is not None:
            return False
        pose = state.dragged.start if state.dragged is not None else self._pivot()
        if pose is None:
            return False
        now = state.dragged.by @ pose if state.dragged is not None else pose
        R, scale = now[:3, :3], np.linalg.norm(now[:3, :3], axis=0)
        shown = now.copy()
        if state.operation != "scale":
            shown[:3, :3] = R / np.where(scale > 0, scale, 1)
        GIZMO.begin_frame()
        GIZMO.set_orthographic(state.orbit.orthographic)
        GIZMO.set_drawlist()
        GIZMO.set_rect(self.origin[0], self.origin[1], float(self.size[0]), float(self.size[1]))
        view, projection = gl_matrices(self.camera)
        matrix = _gl(shown)
        mode = GIZMO.MODE.local if state.local or state.operation == "scale" else GIZMO.MODE.world
        snap = None
        if state.snapping != imgui.get_io().key_ctrl:
            step = {"move": state.snap_mm * 1e-3, "rotate": state.snap_degrees, "scale": 0.1}[state.operation]
            snap = GIZMO.Matrix3([step, step, step])
        changed = GIZMO.manipulate(
            _gl(view), _gl(projection), OPERATIONS[state.operation], mode, matrix, None, snap
        )
        at = self.camera.project(now[:3, 3]) + 0.5 + self.origin
        if np.isfinite(at).all():
            mark_rect("gizmo", (at[0] - 1, at[1] - 1, at[0] + 1, at[1] + 1))
        using = GIZMO.is_using()
        if using and state.dragged is None:
            state.dragged = Dragged(state.workspace.movable(), pose.copy())
        if state.dragged is not None and changed:
            new = np.array(matrix.values, np.float64).reshape(4, 4).T
            state.dragged.by = meant(state.operation, state.dragged.start, new)
        if state.dragged is not None and not using:
            self.drop()
        return bool(using or GIZMO.is_over())

    def drop(self) -> None:
        """The drag ends: it becomes one step."""
        dragged, self.state.dragged = self.state.dragged, None
        if dragged is not None and not np.allclose(dragged.by, np.eye(4), atol=1e-9):
            by = tuple(tuple(float(x) for x in row) for row in np.round(dragged.by, 9))
            self.state.do(Transform(dragged.paths, by))

    def begin_modal(self, kind: str) -> None:
        pose = self._pivot()
        if pose is None or self.modal is not None:
            return
        mouse = imgui.get_mouse_pos()
        x, y, z = (float(v) for v in pose[:3, 3])
        start = (mouse.x - self.origin[0], mouse.y - self.origin[1])
        self.modal = Modal(kind, (x, y, z), start)
        self.state.dragged = Dragged(self.state.workspace.movable(), pose.copy())

    def _run_modal(self) -> None:
        state, modal = self.state, self.modal
        assert modal is not None
        assert state.dragged is not None
        for axis in "xyz":
            if imgui.is_key_pressed(getattr(imgui.Key, axis), False):
                modal = modal.held_to(axis)
        for digit in DIGITS:
            keys = (getattr(imgui.Key, f"_{digit}"), getattr(imgui.Key, f"keypad{digit}"))
            if any(imgui.is_key_pressed(k, False) for k in keys):
                modal = modal.with_key(digit)
        for key, word in (
            (imgui.Key.period, "."), (imgui.Key.keypad_decimal, "."), (imgui.Key.minus, "-"),
            (imgui.Key.keypad_subtract, "-"), (imgui.Key.backspace, "backspace"),
        ):  # fmt: skip
            if imgui.is_key_pressed(key, False):
                modal = modal.with_key(word)
        self.modal = modal
        mouse = imgui.get_mouse_pos()
        cursor = (mouse.x - self.origin[0], mouse.y - self.origin[1])
        step = {"move": state.snap_mm, "rotate": state.snap_degrees, "scale": 0.1}[modal.kind]
        snap = step if state.snapping != imgui.get_io().key_ctrl else 0.0
        state.dragged.by = modal.motion(self.camera, cursor, snap)
        state.tell(modal.told())
        if imgui.is_key_pressed(imgui.Key.escape) or imgui.is_mouse_clicked(imgui.MouseButton_.right):
            self.modal, state.dragged = None, None
            state.tell("Cancelled.")
        elif imgui.is_mouse_clicked(imgui.MouseButton_.left) or any(
            imgui.is_key_pressed(k) for k in (imgui.Key.enter, imgui.Key.keypad_enter)
        ):
            self.modal = None
            state.message = ""
            self.drop()

    # looking round and choosing

    def _mouse(self) -> None:
        state, io = self.state, imgui.get_io()
        mouse = imgui.get_mouse_pos()
        at = (mouse.x - self.origin[0], mouse.y - self.origin[1])
        buttons = imgui.MouseButton_
        if self.hovered and io.mouse_wheel:
            state.orbit = state.orbit.zoomed(io.mouse_wheel)
        every = (buttons.left, buttons.middle, buttons.right)
        if self.hovered and any(imgui.is_mouse_clicked(b) for b in every):
            self.press, self.turning = at, False
        if self.press is None:
            return
        left, middle, right = (imgui.is_mouse_down(b) for b in (buttons.left, buttons.middle, buttons.right))
        if left or middle or right:
            far = max(abs(at[0] - self.press[0]), abs(at[1] - self.press[1])) > 4
            self.turning = self.turning or far
            dx, dy = io.mouse_delta.x, io.mouse_delta.y
            if self.turning and (dx or dy):
                if right or io.key_shift:
                    state.orbit = state.orbit.panned(dx, dy, self.size[1])
                elif io.key_ctrl:
                    state.orbit = state.orbit.zoomed(-dy * 0.05)
                else:
                    state.orbit = state.orbit.turned(dx * 0.008, dy * 0.008)
            return
        if not self.turning and imgui.is_mouse_released(buttons.left):
            self._pick(at, io.key_shift or io.key_ctrl)
        self.press, self.turning = None, False

    def _dropped(self) -> None:
        """A material that is let go over a body."""
        if not imgui.begin_drag_drop_target():
            return
        if imgui.accept_drag_drop_payload_py_id("material") is not None:
            mouse = imgui.get_mouse_pos()
            drop_material(self.state, self._body_at((mouse.x - self.origin[0], mouse.y - self.origin[1])))
        imgui.end_drag_drop_target()

    def _body_at(self, at: tuple[float, float]) -> str:
        """Its prim; "" where there is none."""
        state = self.state
        assert state.renderer is not None
        assert state.context is not None
        before = state.context.detect_framebuffer()
        try:
            return body_at(state.renderer, state.scene, self.camera, at)[0].split("[")[0]
        except BrightfieldError as error:
            state.tell(str(error), error=True)
            return ""
        finally:
            before.use()

    def _pick(self, at: tuple[float, float], more: bool) -> None:
        path = line_at(self.camera, self.lines(), at).split("[")[0] or self._body_at(at)
        workspace = self.state.workspace
        if more and path:
            kept = [p for p in workspace.selection if p != path]
            workspace.select(kept if path in workspace.selection else [*kept, path])
        else:
            workspace.select([path] if path else [])

    def _toolbar(self, corner: Any) -> None:
        from composer.editor.window.toolbar import toolbar

        imgui.set_cursor_screen_pos(imgui.ImVec2(corner.x + 10, corner.y + 10))
        toolbar(self.state, self)


def _gl(m: np.ndarray) -> Any:
    return GIZMO.Matrix16(m.T.reshape(-1).tolist())
