"""How far a batch is, on the terminal."""

import sys


def progress_line(done: int, total: int, left: float | None, failed: int = 0, what: str = "frames") -> None:
    """One line that is rewritten on a terminal, and a line a frame elsewhere."""
    if total < 2:
        return
    rest = "" if left is None else f", {duration(left)} left"
    text = f"{done}/{total} {what}{f', {failed} failed' if failed else ''}{rest}"
    if sys.stderr.isatty():
        print(f"\r{text:60}", end="\n" if done + failed >= total else "", file=sys.stderr, flush=True)
    else:
        print(text, file=sys.stderr, flush=True)


def duration(seconds: float) -> str:
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
