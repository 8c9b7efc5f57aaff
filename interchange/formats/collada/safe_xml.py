"""XML that cannot do harm: no entities, no network, bounded size and depth.

A first pass with expat refuses a document type before anything of it is used and bounds the nesting; only
then is the tree built. COLLADA's elements lose their namespace (1.4 and 1.5 are told apart by the root's).
"""

from pathlib import Path
from typing import Any
from xml.parsers import expat

from lxml import etree

from interchange.problems import FileError, Problem, Where

NAMESPACES = {
    "http://www.collada.org/2005/11/COLLADASchema": "1.4",
    "http://www.collada.org/2008/03/COLLADASchema": "1.5",
}
MOST_BYTES = 512 * 2**20
DEEPEST = 256  # elements within elements


class _Refused(Exception):
    pass


def read_bytes(path: Path) -> bytes:
    """A regular file's content; refuses devices, pipes and files above ``MOST_BYTES``."""
    where = Where(str(path))
    try:
        if not path.is_file():
            raise FileError(Problem("The file is not there, or is not a regular file.", where))
        if path.stat().st_size > MOST_BYTES:
            raise FileError(Problem(f"An XML file must be smaller than {MOST_BYTES >> 20} MiB.", where))
        return path.read_bytes()
    except OSError as error:
        raise FileError(Problem(f"The file cannot be read: {error.strerror}.", where)) from None
    except ValueError:  # a name with a null byte
        raise FileError(Problem("The file's name is not a valid one.", where)) from None


def _inspect(data: bytes) -> None:
    depth = 0

    def start(_: str, __: Any) -> None:
        nonlocal depth
        depth += 1
        if depth > DEEPEST:
            raise _Refused(f"Elements must not be nested more than {DEEPEST} deep.")

    def end(_: str) -> None:
        nonlocal depth
        depth -= 1

    def doctype(_: str, system: str | None, public: str | None, internal: int) -> None:
        if internal or system or public:
            raise _Refused(
                "A document type with declarations or an external part is refused; COLLADA has none."
            )

    parser = expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.StartDoctypeDeclHandler = doctype
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        reason = expat.ErrorString(error.code)
        raise _Refused(
            f"The file is not well-formed XML: {reason} at line {error.lineno}, column {error.offset + 1}."
        ) from None
    except (ValueError, LookupError, UnicodeError):
        raise _Refused("The file is not well-formed XML: its encoding is not known.") from None


def parse(path: Path) -> tuple[Any, str]:
    """The root element and "1.4" or "1.5". Raises FileError for what is not a COLLADA file."""
    data = read_bytes(path)
    where = Where(str(path))
    try:
        _inspect(data)
        parser = etree.XMLParser(
            resolve_entities=False,
            no_network=True,
            load_dtd=False,
            huge_tree=True,  # a float array may be longer than 10 MB; depth and entities are checked above
            remove_comments=True,
            remove_pis=True,
        )
        root = etree.fromstring(data, parser, base_url=str(path))
    except _Refused as refused:
        raise FileError(Problem(str(refused), where)) from None
    except (etree.XMLSyntaxError, ValueError) as error:
        raise FileError(Problem(f"The file is not well-formed XML: {error}.", where)) from None
    name = etree.QName(root)
    version = NAMESPACES.get(name.namespace or "")
    if name.localname != "COLLADA" or version is None:
        wanted = " or ".join(NAMESPACES)
        message = f"The root must be COLLADA in the namespace {wanted}; got {root.tag}."
        raise FileError(Problem(message, where))
    prefix = f"{{{name.namespace}}}"
    for element in root.iter(f"{prefix}*"):
        element.tag = element.tag[len(prefix) :]
    return root, version
