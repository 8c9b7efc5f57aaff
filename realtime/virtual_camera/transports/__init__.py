"""Ways to bring a live camera's frames to other software, one file a way, found by this folder."""

from functools import cache

from interchange.catalogue import catalogue
from interchange.problems import BrightfieldError, did_you_mean
from realtime.virtual_camera.transports.base import Transport


@cache
def transports() -> dict[str, type[Transport]]:
    """Every transport by its name."""
    return catalogue(__name__, Transport)


def transport(name: str) -> type[Transport]:
    """The transport of that name. Raises BrightfieldError."""
    found = transports()
    if name not in found:
        known = sorted(found)
        raise BrightfieldError(
            f'No transport is called "{name}".{did_you_mean(name, known)} There are {", ".join(known)}.'
        )
    return found[name]
