"""What hello_imgui has no call for and its GLFW has: files dropped onto the window, and the title while it runs."""

import ctypes
from collections.abc import Callable
from pathlib import Path
from typing import Any

import imgui_bundle
from imgui_bundle import hello_imgui

_SIGNATURE = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int, ctypes.POINTER(ctypes.c_char_p))
_kept: list[Any] = []  # a callback lives as long as the window


def watch(dropped: Callable[[Path], None]) -> bool:
    """Call ``dropped`` for each file; False where the window is not GLFW's."""
    try:
        address = hello_imgui.get_glfw_window_address()  # type: ignore[attr-defined]
        library = ctypes.CDLL(str(Path(imgui_bundle.__file__).parent / "libglfw.so.3"))
    except (OSError, RuntimeError, AttributeError):
        return False
    if not address:
        return False

    def callback(window: Any, count: int, names: Any) -> None:
        for k in range(count):
            dropped(Path(names[k].decode()))

    _kept.append(_SIGNATURE(callback))
    library.glfwSetDropCallback.argtypes = [ctypes.c_void_p, _SIGNATURE]
    library.glfwSetDropCallback.restype = ctypes.c_void_p
    library.glfwSetDropCallback(ctypes.c_void_p(address), _kept[-1])
    return True


def set_title(title: str) -> None:
    """The window's title; hello_imgui sets it once."""
    try:
        address = hello_imgui.get_glfw_window_address()  # type: ignore[attr-defined]
        library = ctypes.CDLL(str(Path(imgui_bundle.__file__).parent / "libglfw.so.3"))
    except (OSError, RuntimeError, AttributeError):
        return
    library.glfwSetWindowTitle.argtypes = [ctypes.c_void_p, ctypes.c_char_p]
    library.glfwSetWindowTitle(ctypes.c_void_p(address), title.encode())
