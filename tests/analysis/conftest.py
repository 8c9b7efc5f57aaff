"""One rasteriser for the tests of the analyses."""

from collections.abc import Iterator

import pytest

from realtime.renderers.rasterizer import Rasterizer


@pytest.fixture(scope="session")
def rasterizer() -> Iterator[Rasterizer]:
    with Rasterizer() as rasterizer:
        yield rasterizer
