"""The command `brightfield`: one file a command in ``composer/commands``, found by folder.

A command is a module with ``HELP``, ``configure(parser)`` and ``run(args) -> exit status``; its file name is the
command's. Only the module that is asked for is imported: `brightfield doctor` runs where others could not start.
Status 0 is success, 1 a finding (``doctor``: something is missing), 2 an error, told in one line a problem.
"""

import argparse
import importlib
import importlib.metadata
import os
import pkgutil
import sys
from collections.abc import Sequence

import composer.commands
from interchange.problems import BrightfieldError, did_you_mean

MOST_LINES = 20  # problems that are told, of a file that has more


def names() -> list[str]:
    """Every command."""
    return sorted(i.name.replace("_", "-") for i in pkgutil.iter_modules(composer.commands.__path__))


def overview() -> str:
    lines = ["usage: brightfield COMMAND ...", "", "A simulator of machine-vision systems. Commands:", ""]
    for name in names():
        try:
            text = _module(name).HELP
        except ImportError as error:
            text = f"(cannot start: {error}; see brightfield doctor)"
        lines.append(f"  {name:10} {text}")
    return "\n".join([*lines, "", "brightfield COMMAND --help tells more."])


def main(argv: Sequence[str] | None = None) -> int:
    words = list(sys.argv[1:] if argv is None else argv)
    try:
        if not words or words[0] in ("-h", "--help", "help"):
            print(overview())
            return 0 if words else 2
        if words[0] == "--version":
            print(f"brightfield {importlib.metadata.version('brightfield')}")
            return 0
        return _run(words[0], words[1:])
    except BrightfieldError as error:
        lines = str(error).splitlines()
        for line in lines[:MOST_LINES]:
            print(f"brightfield: {line}", file=sys.stderr)
        if len(lines) > MOST_LINES:
            print(f"brightfield: ... and {len(lines) - MOST_LINES} more.", file=sys.stderr)
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


def _run(name: str, words: list[str]) -> int:
    if name not in names():
        message = (
            f'There is no command "{name}".{did_you_mean(name, names())} There are {", ".join(names())}.'
        )
        raise BrightfieldError(message)
    try:
        module = _module(name)
    except ImportError as error:
        raise BrightfieldError(
            f"{name} cannot start: {error}. brightfield doctor tells what is missing."
        ) from None
    parser = argparse.ArgumentParser(prog=f"brightfield {name}", description=module.HELP)
    module.configure(parser)
    return int(module.run(parser.parse_args(words)))


def _module(name: str) -> argparse.Namespace:
    module = importlib.import_module(f"composer.commands.{name.replace('-', '_')}")
    return argparse.Namespace(HELP=module.HELP, configure=module.configure, run=module.run)


if __name__ == "__main__":
    sys.exit(main())
