"""What a plan may say of something that is chosen by name (analysis.sweep.choices), and what becomes of it.

| in the file                                                  | is                              |
|--------------------------------------------------------------|---------------------------------|
| ``brass``                                                    | that one in every frame         |
| ``[steel, brass]``, ``{values: [steel, brass], shares: ...}`` | one of them; ``nature`` as ever |
"""

from typing import Any

from analysis.sweep.axis_file import read_shares
from analysis.sweep.choices import choose
from analysis.sweep.findings import Findings
from analysis.sweep.laws import Choice
from analysis.sweep.sampling import Axis
from interchange.problems import BrightfieldError
from interchange.scene import Scene


def read_choice(scene: Scene, address: str, spec: Any, key: str, wrong: Findings) -> Axis | str | None:
    """An axis whose values are numbers of names, or one name; None where something is wrong with it. Every name is
    tried on the scene."""
    before = len(wrong.problems)
    data = spec if isinstance(spec, dict) else {"values" if isinstance(spec, list) else "value": spec}
    wrong.strange(data, {"value", "values", "shares", "nature"}, key)
    if ("value" in data) == ("values" in data):
        wrong(key, f"It must be a name or a list of names; got {spec!r}.")
        return None
    names = [data["value"]] if "value" in data else data["values"]
    if not isinstance(names, list) or not names or not all(isinstance(n, str) and n for n in names):
        wrong(key, f"It is chosen by name, so it must be one or a list of them; got {spec!r}.")
        return None
    if len(set(names)) < len(names):
        wrong(key, "Every name must stand once.")
    for k, name in enumerate(names):
        try:
            choose(scene, address, name, scene)
        except BrightfieldError as error:
            wrong(key if "value" in data else f"{key}[{k}]", str(error))
    if "value" in data:
        return names[0] if len(wrong.problems) == before else None
    numbers = tuple(float(k) for k in range(len(names)))
    shares = read_shares(data, "shares", numbers, key, wrong)
    nature = Choice(numbers, read_shares(data, "nature", numbers, key, wrong)) if "nature" in data else None
    if nature and any(p > 0 and q == 0 for p, q in zip(nature.shares, shares, strict=True)):
        wrong(f"{key}.shares", "What there is in nature must be sampled; a share is 0.")
    axis = Axis(address, Choice(numbers, shares), nature=nature, names=tuple(names))
    return axis if len(wrong.problems) == before else None
