"""Tables as Apache Parquet: a column a name, one row a frame; what the table as a whole says in the file's metadata."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from interchange.formats.atomic import written_beside
from interchange.problems import FileError, Problem, Where


def write(path: Path | str, rows: Sequence[Mapping[str, Any]], about: Mapping[str, str]) -> None:
    """``rows`` of numbers, words, truth values and None, each with all columns or some; a missing one is null.
    Written beside and renamed."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    path = Path(path)
    names = list(dict.fromkeys(name for row in rows for name in row))
    table = pa.table({name: [row.get(name) for row in rows] for name in names})
    table = table.replace_schema_metadata({**(table.schema.metadata or {}), **about})
    beside = written_beside(path)
    try:
        pq.write_table(table, beside)
        os.replace(beside, path)
    finally:
        beside.unlink(missing_ok=True)


def read(path: Path | str) -> tuple[list[dict[str, Any]], dict[str, str]]:
    """The rows, and what the file says of them. Raises FileError."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(path)
    except (OSError, pa.ArrowInvalid) as error:
        raise FileError(Problem(f"The file must be Parquet: {error}", Where(str(path)))) from None
    about = {k.decode(): v.decode() for k, v in (table.schema.metadata or {}).items()}
    return table.to_pylist(), about
