"""Property tests try the same examples in every run, so that a red run can be had again; others with
``pytest --hypothesis-profile=explore``."""

import gc
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as many tests run as there are cores: threads would wait
import interchange  # noqa: F401  before NumPy (interchange.blas)

from hypothesis import settings  # isort: skip

settings.register_profile("same", derandomize=True)
settings.register_profile("explore", derandomize=False)
settings.load_profile("same")


def pytest_collection_finish() -> None:
    """What imports made stays: collections of garbage need not go through it."""
    gc.collect()
    gc.freeze()
