"""YAML without its surprises: a key stands once, ``on`` and ``no`` are words, 1e-3 is a number."""

import re
from pathlib import Path
from typing import Any

import yaml

from interchange.problems import FileError, Problem, Where

FLOAT = "tag:yaml.org,2002:float"
BOOL = "tag:yaml.org,2002:bool"


def load(path: Path) -> tuple[str, dict[str, Any]]:
    """The file's text and its mapping. Raises FileError."""
    where = Where(str(path))
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise FileError(Problem(f"The file cannot be read: {error.strerror}.", where)) from None
    except UnicodeDecodeError:
        raise FileError(Problem("The file must be UTF-8 text.", where)) from None
    try:
        data = yaml.load(text, Loader=Strict)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        place = Where(str(path), f"line {mark.line + 1}") if mark else where
        raise FileError(Problem(f"The plan must be YAML: {error.problem}.", place)) from None
    except (yaml.YAMLError, RecursionError) as error:
        raise FileError(Problem(f"The plan must be YAML: {error}.", where)) from None
    if not isinstance(data, dict):
        raise FileError(Problem("The plan must be a YAML mapping with a scene.", where))
    return text, data


class Strict(yaml.SafeLoader):
    def construct_mapping(self, node: Any, deep: bool = False) -> Any:
        seen = set()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if isinstance(key, str | int | float):
                if key in seen:
                    message = f'the key "{key}" stands twice'
                    raise yaml.constructor.ConstructorError(None, None, message, key_node.start_mark)
                seen.add(key)
        return super().construct_mapping(node, deep)


Strict.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in found if tag != BOOL]
    for first, found in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
Strict.add_implicit_resolver(BOOL, re.compile(r"^(true|false)$"), list("tf"))
Strict.add_implicit_resolver(
    FLOAT, re.compile(r"^[-+]?(\d+(\.\d*)?|\.\d+)[eE][-+]?\d+$"), list("-+.0123456789")
)
