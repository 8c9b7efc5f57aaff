"""A person at the window: a screen of its own (Xvfb), and a mouse and keyboard (xdotool).

Debian: apt install xvfb xdotool. The robot runs in a thread beside the window's loop and knows of it only where
widgets are, what is in the workspace, and what the screen shows.
"""

import os
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from imgui_bundle import imgui

from composer.editor.window.app import App
from composer.editor.window.places import PLACES, Rect
from interchange.problems import BrightfieldError


def missing() -> list[str]:
    """The programs that are not installed."""
    return [name for name in ("Xvfb", "xdotool") if shutil.which(name) is None]


@contextmanager
def screen(width: int, height: int) -> Iterator[str]:
    """A screen without a monitor, whose keys do not repeat; gives the value of DISPLAY.

    BrightfieldError where Xvfb does not start.
    """
    reading, writing = os.pipe()
    process = subprocess.Popen(
        [
            "Xvfb",
            "-displayfd",
            str(writing),
            "-screen",
            "0",
            f"{width}x{height}x24",
            "-nolisten",
            "tcp",
            "-r",
        ],
        pass_fds=[writing],
        stderr=subprocess.DEVNULL,
    )
    os.close(writing)
    try:
        with os.fdopen(reading) as pipe:
            number = pipe.readline().strip()
        if not number:
            raise BrightfieldError("Xvfb could not start a screen.")
        yield f":{number}"
    finally:
        process.terminate()
        process.wait()


class Robot:
    def __init__(self, app: App, patience: float = 120.0) -> None:
        self.app, self.patience = app, patience

    def wait(self, what: str, holds: Callable[[], bool]) -> None:
        """Until something holds; BrightfieldError, naming ``what``, where it does not come about."""
        end = time.monotonic() + self.patience
        while not holds():
            if time.monotonic() > end:
                state = self.app.state
                raise BrightfieldError(
                    f"{what} was waited for in vain. Last told: {state.message or 'nothing'}"
                )
            time.sleep(0.05)

    def frames(self, count: int) -> None:
        """Until the window has been drawn so many times more."""
        goal = self.app.frames + count
        self.wait("A new frame", lambda: self.app.frames >= goal)

    def rect(self, name: str) -> Rect:
        """Where a widget is; waits until it is there and rests."""
        last: list[tuple[Rect, int]] = []

        def rests() -> bool:
            found = PLACES.get(name)
            if found is None or self.app.drawn - found[1] > 1:
                last.clear()
            elif not last or last[-1][1] != found[1]:
                last.append(found)
            return len(last) > 2 and last[-1][0] == last[-2][0] == last[-3][0]

        self.wait(f'"{name}"', rests)
        return last[-1][0]

    def middle(self, name: str) -> tuple[float, float]:
        x0, y0, x1, y1 = self.rect(name)
        return (x0 + x1) / 2, (y0 + y1) / 2

    def tool(self, *words: str | float) -> None:
        subprocess.run(["xdotool", *(str(w) for w in words)], check=True, stdout=subprocess.DEVNULL)

    def move(self, x: float, y: float) -> None:
        """Until the window has seen it: the screen hands events on when it comes to it, not between two frames."""
        goal = (round(x), round(y))
        self.tool("mousemove", *goal)
        self.wait(f"The pointer at {goal}", lambda: tuple(imgui.get_io().mouse_pos) == goal)
        self.frames(1)

    def hold(self, down: bool, button: int = 1) -> None:
        """Press a button, or let it go, until the window has seen it."""
        self.tool("mousedown" if down else "mouseup", button)
        index = {1: 0, 2: 2, 3: 1}[
            button
        ]  # the screen counts left, middle, right, the toolkit left, right, middle
        self.wait(f"Button {button}", lambda: imgui.is_mouse_down(index) == down)

    def click(self, name: str, button: int = 1) -> None:
        self.move(*self.middle(name))
        self.press(button)

    def press(self, button: int = 1) -> None:
        self.hold(True, button)
        self.frames(1)
        self.hold(False, button)
        self.frames(2)

    def scroll(self, steps: int) -> None:
        """The wheel, up where ``steps`` is above 0."""
        self.tool("click", "--repeat", abs(steps), "--delay", 5, 4 if steps > 0 else 5)
        self.frames(3)

    def drag(
        self,
        start: tuple[float, float],
        end: tuple[float, float],
        steps: int = 4,
        button: int = 1,
        held: Callable[[], None] | None = None,
    ) -> None:
        """``held`` is called before the button is let go."""
        self.move(*start)
        self.hold(True, button)
        self.frames(2)
        for k in range(1, steps + 1):
            t = k / steps
            self.move(start[0] + t * (end[0] - start[0]), start[1] + t * (end[1] - start[1]))
        if held is not None:
            held()
        self.hold(False, button)
        self.frames(3)

    def key(self, chord: str) -> None:
        """In xdotool's words: ctrl+s, Return, F2. Held for a frame or more, as by a hand: a window that is slow would
        else see a chord's keys go up before they came down together."""
        keys = chord.split("+")
        for key in keys:
            self.tool("keydown", key)
            self.frames(1)
        for key in reversed(keys):
            self.tool("keyup", key)
            self.frames(1)
        self.frames(1)

    def type(self, text: str) -> None:
        self.tool("type", "--delay", 5, text)
        self.frames(2)

    def menu(self, title: str, item: str) -> None:
        self.click(f"menu {title}")
        self.click(f"menu {item}")

    def picture(self, file: Path) -> None:
        """What the screen shows, as a PNG of up to 256 colours."""
        from PIL import Image as Pillow
        from PIL import ImageGrab

        self.frames(3)
        shot = ImageGrab.grab(xdisplay=os.environ["DISPLAY"]).convert("RGB")
        few = shot.quantize(256, method=Pillow.Quantize.MEDIANCUT, dither=Pillow.Dither.NONE)
        few.save(file, optimize=True)
