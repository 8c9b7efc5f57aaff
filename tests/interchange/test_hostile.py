"""Every damaged file, through the one door: it opens, or fails with a sentence a problem that names it."""

import resource
import time
from pathlib import Path

import numpy as np
import pytest

from interchange.formats.base import Options
from interchange.formats.document import Document, formats, open_file
from interchange.problems import FileError

HOSTILE = Path(__file__).parents[2] / "assets" / "hostile"
FILES = sorted(p for p in HOSTILE.rglob("*") if p.is_file() and p.name != "README.md")
SECONDS = 60.0  # alone each takes under 5; a parser that hangs is killed by its own limit of CPU time
MEGABYTES = 1000  # by which the main process may grow; its workers have a limit of their own
OPENS = {"trimesh_negative_indices.obj", "trimesh_soup.stl"}  # odd, and valid


def open_or_refuse(path, capfd):
    """The file's problems as one text, or "" where it opened. Fails on any other exception, delay or growth."""
    start, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    problems = []
    try:
        found = open_file(path, Options(unit="mm"))
        if isinstance(found, Document):
            found.scene()
    except FileError as error:
        problems = error.problems or [None]
    for problem in map(str, problems):
        assert path.name in problem
        assert "\n" not in problem
        assert "Traceback" not in problem
        assert len(problem) < 1000 + len(str(path))
    assert time.perf_counter() - start < SECONDS
    assert (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1e3 < MEGABYTES
    assert capfd.readouterr() == ("", "")  # no library speaks on the terminal
    return "\n".join(map(str, problems))


@pytest.mark.parametrize("path", FILES, ids=[f"{p.parent.name}/{p.name[:60]}" for p in FILES])
def test_a_hostile_file_opens_or_is_refused_in_one_line(path, capfd):
    text = open_or_refuse(path, capfd)
    if path.parent.name == "mesh":
        assert (text == "") == (path.name in OPENS)
    if path.parent.name == "cad":
        assert text.count("\n") == 0
        assert text


@pytest.mark.parametrize("path", [p for p in FILES if p.parent.name == "xml"], ids=lambda p: p.name)
@pytest.mark.parametrize("embedded", [False, True])
def test_xml_entities_are_refused_in_collada(path, embedded, tmp_path, capfd):
    """As the file itself, and as the prologue of a COLLADA document that uses the entity."""
    text = path.read_text()
    if embedded:
        prologue = text[: text.index("]>") + 2] if "]>" in text else ""
        name = "c" if "xmlbomb" in text else "ee" if "external" in text else ""
        title = f"&{name};" if name else "plain"
        text = (
            f"{prologue}<COLLADA xmlns='http://www.collada.org/2005/11/COLLADASchema' version='1.4.1'>"
            f"<asset><title>{title}</title></asset></COLLADA>"
        )
    target = tmp_path / f"{path.stem}.dae"
    target.write_text(text)
    said = open_or_refuse(target, capfd)
    if path.name != "simple.xml":
        assert said


def nested_usda(depth):
    return "#usda 1.0\n" + 'def Xform "a" {\n' * depth + "}\n" * depth


HEAD = "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
MADE = {
    "deep.gltf": '{"a":' * 100_000 + "1" + "}" * 100_000,
    "deep.usda": nested_usda(1000),
    "many.ply": HEAD.format(10**12)
    + "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    + "0" * 99,
    "word.obj": "v " + "1" * 2_000_000 + "\n",
    "index.obj": "v 0 0 0\n" * 3 + "f 1 2 99999999999999999999999999\n",
    "noise.stl": np.random.default_rng(0).bytes(50_000),
    "noise.glb": b"glTF" + np.random.default_rng(1).bytes(50_000),
    "noise.usdc": b"PXR-USDC" + np.random.default_rng(2).bytes(50_000),
    "noise.usdz": b"PK\3\4" + np.random.default_rng(3).bytes(50_000),
    "noise.png": b"\x89PNG\r\n\x1a\n" + np.random.default_rng(4).bytes(50_000),
    "noise.exr": b"\x76\x2f\x31\x01\x02\0\0\0" + np.random.default_rng(5).bytes(50_000),
    "noise.dae": b"<COLLADA" + np.random.default_rng(6).bytes(50_000),
    "noise.step": b"ISO-10303-21;" + np.random.default_rng(7).bytes(50_000),
    "zeros.exr": b"\0" * 1000,
    "zeros.dae": b"\0" * 1000,
    "text.png": "this is not a picture",
}


@pytest.mark.parametrize("name", MADE)
def test_a_file_made_to_hurt_is_refused(name, tmp_path, capfd):
    path = tmp_path / name
    data = MADE[name]
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    said = open_or_refuse(path, capfd)
    assert said or name == "deep.usda"


@pytest.mark.parametrize("suffix", sorted({e for f in formats() for e in f.extensions}))
@pytest.mark.parametrize(
    "data", [b"", b"\0", b"\xff" * 64, b"hello\n"], ids=["empty", "zero", "ones", "text"]
)
def test_no_format_trips_over_next_to_nothing(suffix, data, tmp_path, capfd):
    path = tmp_path / f"little{suffix}"
    path.write_bytes(data)
    said = open_or_refuse(path, capfd)
    assert said or suffix in (".csv", ".tsv")  # where a word is a table of one column
