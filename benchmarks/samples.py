"""Open every file of a folder of samples, and write the table of what loads and what fails, and why.

    python benchmarks/samples.py FOLDER [--out docs/samples.md]

Each file is opened as a user would, in a process of its own; one that crashes, hangs for 60 s or prints a traceback
is counted as a defect. Exit status 1 where there is one. Without a folder the sample files in assets/ are taken.
"""

import argparse
import subprocess
import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

SECONDS = 60
SKIPPED = {".md", ".txt", ".rst", ".csv", ".log", ".mb", ".mtlx", ""}

OPEN = """
import sys
from interchange.formats.base import Options
from interchange.formats.document import Document, open_file
from interchange.problems import BrightfieldError
try:
    held = open_file(sys.argv[1], Options(unit="mm"))
    if isinstance(held, Document):
        scene = held.scene()
        triangles = sum(len(b.mesh.faces) for b in scene.bodies)
        problems = [*held.problems, *held.scene_problems()]
        first = f": {problems[0].message}" if problems else ""
        print(f"loads|{len(scene.bodies)} bodies, {triangles} triangles, {len(scene.lights)} lights, "
              f"{len(scene.cameras)} cameras|{len(problems)} notes{first}" if problems else
              f"loads|{len(scene.bodies)} bodies, {triangles} triangles, {len(scene.lights)} lights, "
              f"{len(scene.cameras)} cameras|")
    else:
        print(f"loads|{type(held).__name__}|")
except BrightfieldError as error:
    lines = str(error).splitlines()
    more = f" (and {len(lines) - 1} more)" if len(lines) > 1 else ""
    print(f"refused|{lines[0]}{more}|")
"""


def opened(file: Path) -> tuple[str, str, str]:
    """("loads", what, notes), ("refused", why, "") or ("DEFECT", what happened, "")."""
    try:
        done = subprocess.run(
            [sys.executable, "-c", OPEN, str(file)],
            capture_output=True,
            text=True,
            timeout=SECONDS,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return "DEFECT", f"no answer within {SECONDS} s", ""
    line = done.stdout.strip().splitlines()[-1] if done.stdout.strip() else ""
    if done.returncode or line.count("|") < 2:
        last = done.stderr.strip().splitlines()
        return "DEFECT", f"exit status {done.returncode}: {last[-1] if last else ''}", ""
    kind, what, notes = line.split("|", 2)
    return kind, what, notes.split("|")[0]


def main() -> int:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("folder", nargs="?", default="assets", type=Path)
    arguments.add_argument("--out", type=Path)
    args = arguments.parse_args()
    files = [
        f
        for f in sorted(args.folder.rglob("*"))
        if f.is_file()
        and (f.suffix.lower() not in SKIPPED or "hostile_exr" in str(f))
        and f.name != "README.md"
    ]
    with ThreadPoolExecutor(2) as pool:
        results = []
        for file, result in zip(files, pool.map(opened, files), strict=True):
            results.append(result)
            if sys.stderr.isatty():
                print(
                    f"\r{len(results)}/{len(files)} {file.name[:60]:60}", end="", file=sys.stderr, flush=True
                )
    by_folder: dict[str, list[tuple[Path, tuple[str, str, str]]]] = {}
    for file, result in zip(files, results, strict=True):
        inside = file.relative_to(args.folder)
        by_folder.setdefault(inside.parts[0], []).append((inside, result))
    lines = ["# Sample files: what loads, what is refused, and why", ""]
    lines += [f"Made by `python benchmarks/samples.py FOLDER --out docs/samples.md`; {len(files)} files.", ""]
    lines += ["| folder | loads | refused with one clear error | defects |", "|---|---|---|---|"]
    for folder, rows in by_folder.items():
        count = Counter(r[0] for _, r in rows)
        lines.append(f"| {folder} | {count['loads']} | {count['refused']} | {count['DEFECT']} |")
    for folder, rows in by_folder.items():
        lines += ["", f"## {folder}", "", "| file | result | what or why | notes |", "|---|---|---|---|"]
        for inside, (kind, what, notes) in rows:
            row = [inside.relative_to(folder).as_posix(), kind, what, notes]
            cells = [
                cell.replace(str(args.folder.resolve()), "…").replace(str(args.folder), "…") for cell in row
            ]
            lines.append("| " + " | ".join(c.replace("|", "\\|")[:300] for c in cells) + " |")
    text = "\n".join(lines) + "\n"
    if args.out:
        args.out.write_text(text)
    else:
        print(text)
    defects = [str(f) for f, r in zip(files, results, strict=True) if r[0] == "DEFECT"]
    print(f"{len(files)} files, {len(defects)} defects. {' '.join(defects)}")
    return 1 if defects else 0


if __name__ == "__main__":
    sys.exit(main())
