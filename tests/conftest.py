"""Property tests try the same examples in every run, so that a red run can be had again; others with
``pytest --hypothesis-profile=explore``."""

from hypothesis import settings

settings.register_profile("same", derandomize=True)
settings.register_profile("explore", derandomize=False)
settings.load_profile("same")
