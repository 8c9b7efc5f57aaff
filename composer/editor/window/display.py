"""Pixels on the screen: a float image becomes a texture of the window, by exposure and sRGB or in false colour."""

from enum import StrEnum

import moderngl
import numpy as np
from imgui_bundle import imgui

VERTEX = """#version 410
out vec2 uv;
void main() {
    uv = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2);
    gl_Position = vec4(uv * 2.0 - 1.0, 0.0, 1.0);
}"""
FRAGMENT = """#version 410
in vec2 uv;
out vec4 color;
uniform sampler2D image;
uniform int mode;
uniform float gain;
uniform vec3 background;
vec3 turbo(float t) {  // Mikhailov 2019, as a polynomial
    const vec4 r4 = vec4(0.13572138, 4.61539260, -42.66032258, 132.13108234);
    const vec4 g4 = vec4(0.09140261, 2.19418839, 4.84296658, -14.18503333);
    const vec4 b4 = vec4(0.10667330, 12.64194608, -60.58204836, 110.36276771);
    const vec2 r2 = vec2(-152.94239396, 59.28637943);
    const vec2 g2 = vec2(4.27729857, 2.82956604);
    const vec2 b2 = vec2(-89.90310912, 27.34824973);
    t = clamp(t, 0.0, 1.0);
    vec4 v4 = vec4(1.0, t, t * t, t * t * t);
    vec2 v2 = v4.zw * v4.z;
    return vec3(dot(v4, r4) + dot(v2, r2), dot(v4, g4) + dot(v2, g2), dot(v4, b4) + dot(v2, b2));
}
void main() {
    vec4 texel = texture(image, uv);
    vec3 c = texel.rgb * gain;
    if (mode == 0 || mode == 3) {
        vec3 s = clamp(c, 0.0, 1.0);
        s = mix(12.92 * s, 1.055 * pow(s, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, s));
        color = vec4(s, 1.0);
        if (mode == 3 && texel.r + texel.g + texel.b == 0.0) color = vec4(background, 0.0);
    } else if (mode == 1) {
        color = vec4(clamp(turbo((c.r + c.g + c.b) / 3.0), 0.0, 1.0), 1.0);
    } else {
        color = vec4(clamp(c, 0.0, 1.0), 1.0);
    }
}"""


class Look(StrEnum):
    """How numbers become colours."""

    SRGB = "sRGB"  # linear light, encoded for the screen
    FALSE_COLOR = "false colour"
    PLAIN = "plain"  # as digital numbers are, without a curve
    SHADED = "shaded"  # sRGB, and the background where nothing is

    @property
    def number(self) -> int:
        return list(Look).index(self)


class Display:
    """One picture, kept until it is shown anew."""

    def __init__(self, context: moderngl.Context) -> None:
        self.context = context
        self.program = context.program(vertex_shader=VERTEX, fragment_shader=FRAGMENT)
        self.array = context.vertex_array(self.program, [])
        self.source: moderngl.Texture | None = None
        self.target: moderngl.Texture | None = None
        self.framebuffer: moderngl.Framebuffer | None = None

    @property
    def ready(self) -> bool:
        return self.target is not None

    @property
    def texture(self) -> imgui.ImTextureRef:
        assert self.target is not None
        return imgui.ImTextureRef(self.target.glo)

    @property
    def size(self) -> tuple[int, int]:
        return self.target.size if self.target is not None else (0, 0)

    def upload(self, pixels: np.ndarray) -> None:
        """``pixels``: (H, W, 1) or (H, W, 3)."""
        height, width, channels = pixels.shape
        if self.source is None or self.source.size != (width, height) or self.source.components != channels:
            self._release()
            self.source = self.context.texture((width, height), channels, dtype="f4")
            self.source.filter = (moderngl.NEAREST, moderngl.NEAREST)
            if channels == 1:
                self.source.swizzle = "RRR1"
            self.target = self.context.texture((width, height), 4)
            self.target.filter = (moderngl.LINEAR, moderngl.NEAREST)
            self.framebuffer = self.context.framebuffer([self.target])
        self.source.write(np.ascontiguousarray(pixels, np.float32))

    def draw(self, look: Look, gain: float, background: tuple[float, float, float] = (0, 0, 0)) -> None:
        """Make the texture from what was uploaded, times ``gain``."""
        assert self.source is not None
        assert self.framebuffer is not None
        before = self.context.detect_framebuffer()
        self.framebuffer.use()
        self.context.disable(moderngl.DEPTH_TEST | moderngl.BLEND | moderngl.CULL_FACE)
        self.context.viewport = (0, 0, *self.source.size)
        self.source.use(0)
        self.program["image"] = 0
        self.program["mode"] = look.number
        self.program["gain"] = float(gain)
        if "background" in self.program:
            self.program["background"] = background
        self.array.render(moderngl.TRIANGLES, vertices=3)
        before.use()

    def _release(self) -> None:
        for each in (self.source, self.target, self.framebuffer):
            if each is not None:
                each.release()
        self.source = self.target = self.framebuffer = None
