"""What a camera's lens and sensor do to an image beside geometry, in the words and units of their effects."""

from dataclasses import fields
from typing import Any

from composer.aligned import Description
from interchange.camera import Camera
from interchange.effects import MODELS
from interchange.parameter import parameters

TOLD = ("quantization", "saturation")  # by bits and full well already


def camera_effects(camera: Camera) -> Description:
    """The sensor's numbers, and one line an effect that is there, in the chain's order: symbol, value and unit of what
    differs from an effect that does nothing.
    """
    sensor = camera.sensor
    found: Description = {"full_well": f"{sensor.full_well:g} e-", "K": f"{sensor.K:.4g} DN/e-"}
    if sensor.responsivity:
        found["responsivity"] = f"{sensor.responsivity:g} e- m² sr / (W s)"
    else:
        found["quantum_efficiency"] = ", ".join(f"{x:g}" for x in sensor.quantum_efficiency)
    if sensor.gain_dB:
        found["gain"] = f"{sensor.gain_dB:g} dB"
    for name, model in sorted(MODELS.items(), key=lambda item: (item[1].stage, item[1].order)):
        effect = model.of(camera)
        if name not in TOLD and effect.is_there and (said := words(effect)):
            found[name] = said
    return found


def words(model: Any) -> str:
    """What differs from the defaults of declared parameters: symbol, value and unit; a switch by its name."""
    declared, default, found = parameters(model), type(model)(), []
    for f in fields(model):
        value = getattr(model, f.name)
        if value == getattr(default, f.name):
            continue
        if (about := declared.get(f.name)) is None:
            found.append(f.name if value is True else _value(value))
        else:
            found.append(f"{about.symbol} {_value(value)}{'' if about.unit == '1' else ' ' + about.unit}")
    return ", ".join(found)


def _value(value: Any) -> str:
    if isinstance(value, tuple):
        return "(" + " ".join(_value(x) for x in value) + ")"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
