"""What a consumer in another process asks for: settings, triggers and motion, as JSON objects.

| path | body |
|---|---|
| ``NAME/settings`` | any of those of ``SETTINGS`` |
| ``NAME/trigger`` | ``{}`` |
| ``NAME/pose`` | ``{"world_from_camera": (4, 4) or null}`` |
| ``scene`` | any of ``bodies`` {prim: (4, 4) or null}, ``joints`` {name: rad or m}, ``conveyors`` {name: m/s} |

The answer says what now is; a request with a mistake changes nothing and is told the mistake.
"""

from collections.abc import Mapping
from typing import Any

from interchange.problems import BrightfieldError, did_you_mean
from realtime.virtual_camera.camera import VirtualCamera
from realtime.virtual_camera.publisher import Publisher

SETTINGS = {
    "exposure_s": "t_exp",
    "gain_dB": "gain_dB",
    "frame_rate": "frame_rate",
    "format": "format",
    "region": "region",
    "triggered": "triggered",
    "trigger_period_s": "trigger_period",
}


def answer(cameras: Mapping[str, Publisher], path: str, body: Any) -> dict[str, Any]:
    """Do what is asked. Raises BrightfieldError where that cannot be."""
    if not isinstance(body, dict):
        raise BrightfieldError(f"A request must be a JSON object; got {type(body).__name__}.")
    if path == "scene":
        _known(body, ("bodies", "joints", "conveyors"))
        numbers = {
            kind: {n: _number(v, n) for n, v in _object(body, kind).items()}
            for kind in ("joints", "conveyors")
        }
        for scene in {id(p.camera.scene): p.camera.scene for p in cameras.values()}.values():
            scene.change(bodies=_object(body, "bodies"), **numbers)
        return {"done": True}
    name, _, what = path.partition("/")
    if name not in cameras or what not in ("settings", "trigger", "pose"):
        raise BrightfieldError(
            f'Nothing is at "{path}"; there are scene and, of {", ".join(cameras)}, settings, trigger and pose.'
        )
    camera = cameras[name].camera
    if what == "settings":
        _known(body, tuple(SETTINGS))
        try:
            camera.configure(**{SETTINGS[k]: v for k, v in body.items()})
        except (TypeError, AttributeError) as error:
            raise BrightfieldError(f"A camera's setting is of the wrong kind: {error}.") from None
        return told(camera)
    if what == "trigger":
        camera.trigger()
    else:
        _known(body, ("world_from_camera",))
        camera.set_pose(body.get("world_from_camera"))
    return {"done": True}


def told(camera: VirtualCamera) -> dict[str, Any]:
    """The settings as JSON has them."""
    s = camera.settings
    values = {name: getattr(s, field) for name, field in SETTINGS.items()}
    return values | {"format": s.format.name, "region": list(s.region)}


def _known(body: dict[str, Any], names: tuple[str, ...]) -> None:
    for word in body:
        if word not in names:
            raise BrightfieldError(
                f'Nothing is called "{word}" here.{did_you_mean(word, names)} There are {", ".join(names)}.'
            )


def _object(body: dict[str, Any], name: str) -> dict[str, Any]:
    found = body.get(name, {})
    if not isinstance(found, dict):
        raise BrightfieldError(f"{name} must be a JSON object; got {type(found).__name__}.")
    return found


def _number(value: Any, name: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise BrightfieldError(f"{name} must be a number; got {value!r}.")
    return float(value)
