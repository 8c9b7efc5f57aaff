"""What the user wrote, by the name ``module:function``: a measure of images, an algorithm."""

import importlib
import os
import sys
import traceback
from typing import Any

from interchange.problems import BrightfieldError, did_you_mean


def users_own(name: str, what: str) -> Any:
    """The function or class ``module:function``, the working directory being searched first.

    ``what`` it is, for messages: "A metric". Raises BrightfieldError where there is none.
    """
    module, _, word = name.partition(":")
    if not module or not word:
        raise BrightfieldError(f'{what} must be named "module:function"; got "{name}".')
    here = os.getcwd()
    if here not in sys.path:
        sys.path.insert(0, here)
    try:
        loaded = importlib.import_module(module)
    except ModuleNotFoundError as error:
        own = error.name in (module, module.split(".")[0])
        missing = "is not there" if own else f"needs {error.name}, which is not"
        raise BrightfieldError(
            f'The module "{module}" {missing}; it is looked for in {here} and in PYTHONPATH.'
        ) from None
    except Exception as error:  # the user's own file may raise anything
        at = traceback.extract_tb(error.__traceback__)[-1]
        raise BrightfieldError(
            f'The module "{module}" cannot be imported: {type(error).__name__}: {error} '
            f"({at.filename}, line {at.lineno})."
        ) from error
    found = getattr(loaded, word, None)
    if not callable(found):
        known = [n for n, x in vars(loaded).items() if callable(x) and not n.startswith("_")]
        raise BrightfieldError(f'The module "{module}" has no function "{word}".{did_you_mean(word, known)}')
    return found
