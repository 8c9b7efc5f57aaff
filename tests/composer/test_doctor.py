"""The doctor: versions against ranges, and a verdict that names the mending command, whatever is missing."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from composer.commands import doctor

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(
    ("version", "needs", "state"),
    [
        ("1.26.4", ">=1.26,<2", "ok"),
        ("1.25.9", ">=1.26,<2", "too old"),
        ("2.0.0", ">=1.26,<2", "too new"),
        ("2", "<2.0", "too new"),
        ("5.0.1", "==5.0.1", "ok"),
        ("5.0.10", "==5.0.1", "too new"),
        ("4.11.0.86", ">=4.10,<4.12", "ok"),
        ("4.9", ">=4.10", "too old"),
        ("1.4.9", "~=1.4.2", "ok"),
        ("1.5.0", "~=1.4.2", "too new"),
        ("1.4.1", "~=1.4.2", "too old"),
        ("3.0", "!=3.0", "excluded"),
        ("10.0rc1", ">=9", "ok"),
        ("1.0", "", "ok"),
    ],
)
def test_a_version_against_its_range(version: str, needs: str, state: str) -> None:
    assert doctor.compare(version, needs) == state


def test_every_requirement_is_looked_at() -> None:
    rows = {r["package"]: r for r in map(doctor.package, doctor.requirements())}
    assert {"numpy", "usd-core", "moderngl", "bpy", "OpenEXR", "dask"} <= set(rows)
    assert rows["dask"]["extras"] == "[distributed]"
    assert rows["numpy"]["state"] == "ok"
    assert doctor.package("no-such-distribution>=1 ; python_version > '3'") == {
        "package": "no-such-distribution",
        "extras": "",
        "needs": ">=1",
        "found": "",
        "state": "missing",
    }


def test_what_is_missing_comes_with_its_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "requirements", lambda: ["numpy>=99", "no-such-thing[all]>=1,<2"])
    monkeypatch.setattr(doctor, "NEEDED", ("libEGL.so.1", "libnever.so.9"))
    monkeypatch.setattr(doctor, "LIBRARIES", {**doctor.LIBRARIES, "libnever.so.9": "libnever9"})
    monkeypatch.setattr(doctor, "OPENGL", "raise OSError('no driver')")
    monkeypatch.setattr(doctor, "CYCLES", "import os; os.abort()")
    found = doctor.examine()
    assert not found["healthy"]
    assert [r["state"] for r in found["packages"]] == ["too old", "missing"]
    assert f"{sys.executable} -m pip install 'numpy>=99' 'no-such-thing[all]>=1,<2'" in found["to_do"]
    assert "sudo apt-get install -y libnever9" in found["to_do"]
    assert found["opengl"] == "no device: OSError: no driver"
    assert found["cycles"] == "no device: the process crashed (signal 6)"


def test_a_child_that_hangs_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "SECONDS", 0.3)
    assert doctor._answer(doctor._start("import time; time.sleep(60)")) == (None, "no answer within 0.3 s")


def test_this_environment(capsys: pytest.CaptureFixture[str]) -> None:
    found = doctor.examine()
    assert {r["state"] for r in found["packages"]} == {"ok"}
    assert found["libraries"] == "all there"
    assert any(d["code"] >= 330 for d in found["opengl"])
    assert any(d["type"] == "CPU" for d in found["cycles"])
    assert found["healthy"]
    assert found["to_do"] == []


def test_it_works_where_nothing_is_installed(tmp_path: Path) -> None:
    bare = [sys._base_executable, "-I", "-S", "-c"]
    script = (
        f"import sys; sys.path.insert(0, {str(ROOT)!r}); from composer.commands import doctor; "
        "import argparse; sys.exit(doctor.run(argparse.Namespace(json=True)))"
    )
    result = subprocess.run(
        [*bare, script],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        check=False,
        env={**os.environ, "PYTHONHOME": ""},
    )
    assert result.returncode == 1, result.stderr
    assert result.stderr == ""
    found = json.loads(result.stdout)
    assert {r["state"] for r in found["packages"]} == {"missing"}
    assert found["to_do"][0].startswith(f"{sys._base_executable} -m pip install 'numpy")
