"""The OpenGL context: headless through EGL, and what the rasteriser needs beyond moderngl's reach."""

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

import moderngl

from interchange.problems import BrightfieldError

VERSION = 410  # of GLSL and of the context; glClipControl (GL 4.5 or ARB_clip_control) on top
LOWER_LEFT, ZERO_TO_ONE, NEGATIVE_ONE_TO_ONE = 0x8CA1, 0x935F, 0x935E
COLOR, DEPTH = 0x1800, 0x1801
TEXTURE_2D, DEPTH_COMPONENT, DEPTH_COMPONENT32F, FLOAT = 0x0DE1, 0x1902, 0x8CAC, 0x1406
DEPTH_STENCIL, DEPTH32F_STENCIL8, FLOAT_WITH_STENCIL = 0x84F9, 0x8CAD, 0x8DAD


def headless_context() -> moderngl.Context:
    """A context without a window. BrightfieldError where EGL or a driver is missing."""
    try:
        return moderngl.create_context(require=VERSION, standalone=True, backend="egl")  # type: ignore[arg-type]
    except Exception as error:  # moderngl and glcontext raise bare Exception
        raise BrightfieldError(
            f"The real-time renderer needs OpenGL {VERSION / 100:.1f} through EGL, and none could be started "
            f"({error}). On Debian or Ubuntu: apt install libegl1 libgl1 libgl1-mesa-dri."
        ) from error


def gl_function(name: bytes, *arguments: Any) -> Any:
    """An OpenGL function of the current context that moderngl does not offer."""
    for library, loader in (("libEGL.so.1", "eglGetProcAddress"), ("libGL.so.1", "glXGetProcAddressARB")):
        try:
            load = getattr(ctypes.CDLL(library), loader)
        except (OSError, AttributeError):
            continue
        load.restype, load.argtypes = ctypes.c_void_p, [ctypes.c_char_p]
        if address := load(name):
            return ctypes.CFUNCTYPE(None, *arguments)(address)
    raise BrightfieldError(
        f"The real-time renderer needs OpenGL's {name.decode()}, which this driver does not offer."
    )


@cache
def _clip_control() -> Any:
    return gl_function(b"glClipControl", ctypes.c_uint, ctypes.c_uint)


@cache
def _texture_storage() -> tuple[Any, Any]:
    kinds = [ctypes.c_uint, *[ctypes.c_int] * 5, ctypes.c_uint, ctypes.c_uint, ctypes.c_void_p]
    return gl_function(b"glBindTexture", ctypes.c_uint, ctypes.c_uint), gl_function(b"glTexImage2D", *kinds)


def depth_texture(
    context: moderngl.Context, size: tuple[int, int], stencil: bool = False
) -> moderngl.Texture:
    """A depth texture of 32-bit floats; moderngl's own has 24 fixed bits, too few where 1 is near and 0 is far.
    ``stencil``: with eight bits for realtime.stencil."""
    texture = context.depth_texture(size)
    bind, allocate = _texture_storage()
    bind(TEXTURE_2D, texture.glo)
    if stencil:
        allocate(TEXTURE_2D, 0, DEPTH32F_STENCIL8, *size, 0, DEPTH_STENCIL, FLOAT_WITH_STENCIL, None)
    else:
        allocate(TEXTURE_2D, 0, DEPTH_COMPONENT32F, *size, 0, DEPTH_COMPONENT, FLOAT, None)
    texture.compare_func = ""
    texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    texture.repeat_x = texture.repeat_y = False
    return texture


@cache
def _clear(name: bytes, *arguments: Any) -> Any:
    return gl_function(name, *arguments)


_FLOATS = ctypes.POINTER(ctypes.c_float)


def clear_color(number: int, value: tuple[float, float, float, float]) -> None:
    """One colour attachment of the bound framebuffer; moderngl clears all of them."""
    clear = _clear(b"glClearBufferfv", ctypes.c_uint, ctypes.c_int, _FLOATS)
    clear(COLOR, number, (ctypes.c_float * 4)(*value))


def clear_whole(number: int, value: tuple[int, int, int, int]) -> None:
    """One colour attachment of unsigned integers of the bound framebuffer."""
    clear = _clear(b"glClearBufferuiv", ctypes.c_uint, ctypes.c_int, ctypes.POINTER(ctypes.c_uint))
    clear(COLOR, number, (ctypes.c_uint * 4)(*value))


def clear_depth(value: float) -> None:
    """Of the bound framebuffer."""
    clear = _clear(b"glClearBufferfv", ctypes.c_uint, ctypes.c_int, _FLOATS)
    clear(DEPTH, 0, (ctypes.c_float * 1)(value))


def clear_depth_and_stencil(value: float, mark: int) -> None:
    """Of the bound framebuffer."""
    clear = _clear(b"glClearBufferfi", ctypes.c_uint, ctypes.c_int, ctypes.c_float, ctypes.c_int)
    clear(DEPTH_STENCIL, 0, value, mark)


@contextmanager
def reversed_depth(context: moderngl.Context) -> Iterator[None]:
    """Clip depth in [0, 1], 1 at the near plane: float depth is then equally fine at every distance.

    The context is current inside, and the one before it current again outside.
    """
    with context:
        clip_control = _clip_control()
        clip_control(LOWER_LEFT, ZERO_TO_ONE)
        try:
            yield
        finally:
            clip_control(LOWER_LEFT, NEGATIVE_ONE_TO_ONE)
