"""Where widgets were drawn last, by name: for whoever drives the window from outside, as a person would."""

from imgui_bundle import imgui

Rect = tuple[float, float, float, float]
PLACES: dict[str, tuple[Rect, int]] = {}  # with the frame in which they were there


def mark(name: str) -> None:
    """Note where the last widget is."""
    low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
    mark_rect(name, (low.x, low.y, high.x, high.y))


def mark_rect(name: str, rect: Rect) -> None:
    PLACES[name] = rect, imgui.get_frame_count()
