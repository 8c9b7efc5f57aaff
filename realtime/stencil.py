"""The stencil buffer, which moderngl leaves out: it says which material group each texel shows, so that a group's
program runs on its own texels only. 0 is no surface, group g is g + 1."""

import ctypes
from functools import cache
from typing import Any

import moderngl

from realtime.context import gl_function

MOST_GROUPS = 255
STENCIL_TEST, STENCIL_BUFFER_BIT, STENCIL_ATTACHMENT = 0x0B90, 0x400, 0x8D20
EQUAL, NOTEQUAL, ALWAYS, KEEP, REPLACE = 0x0202, 0x0205, 0x0207, 0x1E00, 0x1E01
FRAMEBUFFER, TEXTURE_2D = 0x8D40, 0x0DE1


@cache
def _gl(name: str, *arguments: Any) -> Any:
    return gl_function(name.encode(), *arguments)


_UINT, _INT = ctypes.c_uint, ctypes.c_int


def framebuffer(
    context: moderngl.Context, colors: list[moderngl.Texture], depth: moderngl.Texture
) -> moderngl.Framebuffer:
    """``depth``: of ``depth_texture`` with a stencil, here attached as both."""
    made = context.framebuffer(colors, depth)
    made.use()
    attach = _gl("glFramebufferTexture2D", _UINT, _UINT, _UINT, _UINT, _INT)
    attach(FRAMEBUFFER, STENCIL_ATTACHMENT, TEXTURE_2D, depth.glo, 0)
    return made


def clear() -> None:
    """Of the bound framebuffer."""
    _gl("glStencilMask", _UINT)(255)
    _gl("glClear", _UINT)(STENCIL_BUFFER_BIT)


def write(value: int) -> None:
    """What is drawn from now on leaves ``value`` behind."""
    _gl("glEnable", _UINT)(STENCIL_TEST)
    _gl("glStencilFunc", _UINT, _INT, _UINT)(ALWAYS, value, 255)
    _gl("glStencilOp", _UINT, _UINT, _UINT)(KEEP, KEEP, REPLACE)


def only(value: int | None) -> None:
    """Draw from now on only where ``value`` stands; None: where any surface is."""
    _gl("glEnable", _UINT)(STENCIL_TEST)
    _gl("glStencilFunc", _UINT, _INT, _UINT)(NOTEQUAL if value is None else EQUAL, value or 0, 255)
    _gl("glStencilOp", _UINT, _UINT, _UINT)(KEEP, KEEP, KEEP)


def off() -> None:
    _gl("glDisable", _UINT)(STENCIL_TEST)
