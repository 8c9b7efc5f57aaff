"""A surface whose highlights are wider by a factor, where it has any."""

from interchange.brdf.lobes import has_lobes
from interchange.effects.shine import shone
from interchange.material import Material


def roughened(material: Material, factor: float) -> Material:
    """A matte surface stays as it is. Raises ParameterError where a model's bounds end."""
    return shone(material, factor, factor, 1.0) if factor != 1 and has_lobes(material.brdf) else material
