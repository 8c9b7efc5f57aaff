"""The command `brightfield`: one file a command in ``composer/commands``, found by folder.

A command is a module with ``NAME``, ``HELP``, ``configure(parser)`` and ``run(args) -> exit status``. Status 0 is
success, 1 a finding (``doctor``: something is missing), 2 an error, told in one line a problem.
"""

import argparse
import importlib
import os
import pkgutil
import sys
from collections.abc import Sequence
from types import ModuleType

import composer.commands
from interchange.problems import BrightfieldError


def commands() -> dict[str, ModuleType]:
    """Every command by name."""
    found = {}
    for info in pkgutil.iter_modules(composer.commands.__path__):
        module = importlib.import_module(f"composer.commands.{info.name}")
        if hasattr(module, "NAME"):
            found[module.NAME] = module
    return dict(sorted(found.items()))


def parser() -> argparse.ArgumentParser:
    top = argparse.ArgumentParser(
        prog="brightfield",
        description="A simulator of machine-vision systems whose pixel values mean something.",
    )
    words = top.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, module in commands().items():
        module.configure(words.add_parser(name, help=module.HELP, description=module.HELP))
    return top


def main(argv: Sequence[str] | None = None) -> int:
    args = parser().parse_args(argv)
    try:
        return int(commands()[args.command].run(args))
    except BrightfieldError as error:
        for line in str(error).splitlines():
            print(f"brightfield: {line}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("brightfield: stopped.", file=sys.stderr)
        return 130
    except BrokenPipeError:  # the reader of our output went away, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except MemoryError:
        print("brightfield: the machine has not enough memory for this.", file=sys.stderr)
        return 2
    except OSError as error:
        place = f" ({error.filename})" if error.filename else ""
        print(f"brightfield: {error.strerror or error}{place}.", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
