"""Labels that nobody has seen: kept apart, their hash made public before the run, opened once.

``seals.json`` is committed: one entry a sealed set, with the SHA-256 of its labels. The labels hold the set's seed,
so that the hash says nothing and yet binds every case.
"""

import datetime
import hashlib
import json
import os
from pathlib import Path
from typing import Any


class SealError(RuntimeError):
    """Labels that are not those that were sealed, or that were opened before."""


def text_of(labels: dict[str, Any]) -> bytes:
    return json.dumps(labels, indent=1, sort_keys=True).encode()


def digest(labels: bytes) -> str:
    return hashlib.sha256(labels).hexdigest()


def write_atomic(path: Path, data: bytes, mode: int = 0o644) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    beside.write_bytes(data)
    beside.chmod(mode)
    beside.replace(path)


def seal(labels: dict[str, Any], vault: Path, seals: Path, name: str) -> str:
    """Puts the labels into ``vault`` and their hash into ``seals``; returns the hash. Raises SealError."""
    data = text_of(labels)
    known = json.loads(seals.read_text()) if seals.is_file() else {}
    if name in known and known[name]["sha256"] != digest(data):
        raise SealError(f"A set is sealed once; {name} has the hash {known[name]['sha256'][:12]}… already.")
    write_atomic(vault, data, 0o600)
    if name not in known:
        known[name] = {
            "sha256": digest(data), "cases": len(labels["cases"]),
            "sealed": datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC"),
        }  # fmt: skip
        write_atomic(seals, (json.dumps(known, indent=1, sort_keys=True) + "\n").encode())
    return digest(data)


def opened(vault: Path, seals: Path, name: str, again: bool = False) -> tuple[dict[str, Any], int]:
    """The labels, and how many times they were opened before. Says so in a file beside them.

    Raises SealError where they are not what was sealed, or where they were opened and ``again`` is not set.
    """
    data = vault.read_bytes()
    known = json.loads(seals.read_text()) if seals.is_file() else {}
    if name not in known:
        raise SealError(f"No set {name} is sealed in {seals.name}.")
    if known[name]["sha256"] != digest(data):
        raise SealError(f"The labels of {name} are not those that were sealed.")
    record = vault.with_suffix(".opened.json")
    before = json.loads(record.read_text()) if record.is_file() else []
    if before and not again:
        raise SealError(f"The labels of {name} were opened on {before[0]}; a set is scored once.")
    now = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC")
    write_atomic(record, json.dumps([*before, now]).encode())
    return json.loads(data), len(before)
