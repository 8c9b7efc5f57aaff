"""Files are written beside their place and renamed, so that what stood there is whole until the new one is."""

import os
from pathlib import Path


def written_beside(path: Path) -> Path:
    """A name in the same folder to write to before ``os.replace(name, path)``; keeps the extension."""
    return path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
