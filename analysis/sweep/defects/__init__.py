"""The defects that a plan may sample, one file each, under their files' names."""

from analysis.sweep.defect import Defect
from interchange.catalogue import catalogue

MODELS = catalogue(__name__, Defect)

__all__ = ["MODELS", "Defect"]
