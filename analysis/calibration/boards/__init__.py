"""Calibration boards, one file each. ``boards()`` finds them by this folder."""

from functools import cache

from analysis.calibration.boards.base import Board
from interchange.catalogue import catalogue


@cache
def boards() -> dict[str, type[Board]]:
    """Every kind of board by the name that the command line has for it."""
    return {kind.name: kind for kind in catalogue(__name__, Board).values()}
