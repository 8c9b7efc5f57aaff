"""What a set-up is judged by, one file each, under their files' names."""

from analysis.optimise.measures.base import Measure
from interchange.catalogue import catalogue

MODELS = catalogue(__name__, Measure)

__all__ = ["MODELS", "Measure"]
