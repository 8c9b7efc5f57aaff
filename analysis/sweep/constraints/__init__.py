"""What a plan may demand of its samples, one file each, under their files' names."""

from analysis.sweep.constraint import Constraint
from interchange.catalogue import catalogue

MODELS = catalogue(__name__, Constraint)

__all__ = ["MODELS", "Constraint"]
