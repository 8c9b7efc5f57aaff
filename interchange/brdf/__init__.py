"""The reflectance models, one file each."""

from interchange.brdf.base import Brdf
from interchange.catalogue import catalogue

MODELS = catalogue(__name__, Brdf)
BY_NAME = {model.__name__: model for model in MODELS.values()}  # under the name that a scene file uses

__all__ = ["BY_NAME", "MODELS", "Brdf"]
