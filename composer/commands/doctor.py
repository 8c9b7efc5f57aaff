"""`brightfield doctor`: what is installed, which devices can draw and render, and the command that mends the rest.

Only Python's own library is imported here, and whatever could crash (OpenGL, Blender) runs in a child process:
the doctor must work where nothing else does.
"""

import argparse
import importlib.metadata
import importlib.util
import json
import os
import platform
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from composer.aligned import Description, text

HELP = "tell what is installed, which OpenGL and Cycles devices there are, and how to mend what is missing"
SECONDS = 60.0
LIBRARIES = {  # what Debian and Ubuntu call the package
    "libEGL.so.1": "libegl1",
    "libGL.so.1": "libgl1",
    "libXrender.so.1": "libxrender1",
    "libXi.so.6": "libxi6",
    "libxkbcommon.so.0": "libxkbcommon0",
    "libSM.so.6": "libsm6",
    "libXfixes.so.3": "libxfixes3",
    "libXxf86vm.so.1": "libxxf86vm1",
    "libICE.so.6": "libice6",
    "libX11.so.6": "libx11-6",
    "libXext.so.6": "libxext6",
    "libgomp.so.1": "libgomp1",
}
NEEDED = tuple(LIBRARIES)[:8]  # the others come with them; asked for only where bpy misses them
MEMORY_GB, DISK_GB = 4.0, 2.0

LOAD = """
import ctypes, json, sys
missing = {}
for name in sys.argv[1:]:
    try:
        ctypes.CDLL(name)
    except OSError as error:
        missing[name] = str(error)
print("@" + json.dumps(missing))
"""
OPENGL = """
import ctypes, json
egl = ctypes.CDLL("libEGL.so.1")
egl.eglGetProcAddress.restype = ctypes.c_void_p
egl.eglGetProcAddress.argtypes = [ctypes.c_char_p]
address = egl.eglGetProcAddress(b"eglQueryDevicesEXT")
count = ctypes.c_int(1)
if address:
    kind = ctypes.CFUNCTYPE(
        ctypes.c_uint, ctypes.c_int, ctypes.POINTER(ctypes.c_void_p), ctypes.POINTER(ctypes.c_int)
    )
    kind(address)(64, (ctypes.c_void_p * 64)(), ctypes.byref(count))
import moderngl
rows = []
for i in range(count.value):
    try:
        context = moderngl.create_standalone_context(backend="egl", device_index=i)
        info = context.info
        rows.append({"device": i, "renderer": info["GL_RENDERER"], "version": info["GL_VERSION"],
                     "code": context.version_code, "largest_texture_px": info["GL_MAX_TEXTURE_SIZE"]})
        context.release()
    except Exception as error:
        rows.append({"device": i, "error": str(error)})
print("@" + json.dumps(rows))
"""
CYCLES = """
import json
import bpy, _cycles
found = [{"type": "CPU", "device": d[0]} for d in _cycles.available_devices("CPU") if d[1] == "CPU"]
preferences = bpy.context.preferences.addons["cycles"].preferences
for kind, *_ in preferences.get_device_types(bpy.context):
    if kind != "NONE":
        devices = preferences.get_devices_for_type(kind)
        found += [{"type": d.type, "device": d.name} for d in devices if d.type == kind]
print("@" + json.dumps({"blender": bpy.app.version_string, "osl": bool(_cycles.with_osl), "devices": found}))
"""


def configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--json", action="store_true", help="for machines: everything, as JSON")


def run(args: argparse.Namespace) -> int:
    found = examine()
    print(json.dumps(found, indent=1, ensure_ascii=False) if args.json else text(found, everything=True))
    if not args.json:
        print(
            "\nEverything that is needed is there."
            if found["healthy"]
            else "\nSomething is missing: see TO DO."
        )
    return 0 if found["healthy"] else 1


def examine() -> Description:
    """What this machine and this environment have. ``to_do`` holds commands; it is empty where nothing lacks."""
    gl, cycles = _start(OPENGL), _start(CYCLES)  # both while the rest is looked at
    to_do: list[str] = []
    python = needed_python()
    if (fit := compare(platform.python_version(), python)) != "ok":
        to_do.append(f"Python {python} is needed; {platform.python_version()} is {fit}.")
    packages = [package(r) for r in requirements()]
    broken = [p for p in packages if p["state"] != "ok"]
    if broken:
        wanted = " ".join(f"'{p['package']}{p['extras']}{p['needs']}'" for p in broken)
        to_do.append(f"{sys.executable} -m pip install {wanted}")
    for row in packages:
        del row["extras"]
    libraries = missing_libraries()
    if libraries:
        to_do.append("sudo apt-get install -y " + " ".join(dict.fromkeys(r["package"] for r in libraries)))
    devices, gl_error = _answer(gl)
    drawing = [d for d in devices or [] if "error" not in d and d["code"] >= 330]
    if not drawing and not any(p["package"] == "moderngl" and p["state"] == "missing" for p in packages):
        to_do.append("sudo apt-get install -y libegl1 libgl1 libgl1-mesa-dri")
    renderer, cycles_error = _answer(cycles)
    machine, short = _machine()
    to_do += short
    found: Description = {
        "python": platform.python_version(),
        "system": _system(),
        "healthy": False,
        "machine": machine,
        "packages": packages,
        "libraries": libraries or "all there",
        "opengl": devices if devices else f"no device: {gl_error}",
    }
    if renderer:
        found["blender"], found["open_shading_language"] = renderer["blender"], renderer["osl"]
        found["cycles"] = renderer["devices"]
    else:
        found["cycles"] = f"no device: {cycles_error}"
    found["notes"] = _notes(drawing, renderer)
    found["to_do"] = list(dict.fromkeys(to_do))
    found["healthy"] = not found["to_do"] and bool(renderer) and bool(drawing)
    if not found["healthy"] and not found["to_do"]:
        found["to_do"] = ["The devices above cannot be used; their messages say why."]
    return found


def requirements() -> list[str]:
    """The requirements as pyproject.toml beside the program states them, else as the installed distribution does."""
    stated = _project().get("dependencies") or importlib.metadata.requires("brightfield") or []
    return [r for r in stated if "extra ==" not in r]


def needed_python() -> str:
    stated = (
        _project().get("requires-python") or importlib.metadata.metadata("brightfield")["Requires-Python"]
    )
    return str(stated).replace(" ", "")


def _project() -> Description:
    file = Path(__file__).parents[2] / "pyproject.toml"
    project: Description = tomllib.loads(file.read_text())["project"] if file.exists() else {}
    return project if project.get("name") == "brightfield" else {}


def package(requirement: str) -> Description:
    """One requirement against what is installed: state "ok", "missing", "too old" or "too new"."""
    match = re.match(r"^\s*([\w.-]+)\s*(\[[^\]]*\])?\s*\(?([^;)]*)", requirement)
    if match is None:
        return {"package": requirement, "extras": "", "needs": "", "found": "", "state": "not understood"}
    name, extras, needs = match[1], match[2] or "", match[3].replace(" ", "")
    try:
        found = importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        found = ""
    row = {"package": name, "extras": extras, "needs": needs, "found": found}
    return row | {"state": compare(found, needs) if found else "missing"}


def compare(version: str, needs: str) -> str:
    """Whether a version fits "``>=1.2,<2``": "ok", "too old", "too new" or "excluded"."""
    have = _release(version)
    for clause in filter(None, needs.split(",")):
        match = re.match(r"(>=|<=|==|!=|~=|>|<)\s*([\d.]+)", clause)
        if match is None:
            continue
        sign, want = match[1], _release(match[2])
        length = max(len(have), len(want))
        a, b = have + (0,) * (length - len(have)), want + (0,) * (length - len(want))
        if (sign in (">=", "==", "~=") and a < b) or (sign == ">" and a <= b):
            return "too old"
        if (sign in ("<=", "==") and a > b) or (sign == "<" and a >= b):
            return "too new"
        if sign == "~=" and a[: len(want) - 1] > b[: len(want) - 1]:
            return "too new"
        if sign == "!=" and a == b:
            return "excluded"
    return "ok"


def _release(version: str) -> tuple[int, ...]:
    match = re.match(r"\d+(\.\d+)*", version)
    return tuple(map(int, match[0].split("."))) if match else ()


def missing_libraries() -> list[Description]:
    """System libraries that cannot be loaded, those that Blender's own are linked to included."""
    missing, error = _answer(_start(LOAD, *NEEDED))
    if missing is None:
        missing = dict.fromkeys(NEEDED, error)
    names = dict.fromkeys([*missing, *_unresolved()])
    return [{"library": n, "package": LIBRARIES.get(n, f"the package that has {n}")} for n in names]


def _unresolved() -> list[str]:
    """What the dynamic linker does not find for Blender's module."""
    spec = importlib.util.find_spec("bpy")
    ldd = shutil.which("ldd")
    if spec is None or spec.origin is None or ldd is None:
        return []
    result = subprocess.run([ldd, spec.origin], capture_output=True, text=True, check=False, timeout=SECONDS)
    return re.findall(r"^\s*(\S+) => not found", result.stdout, re.MULTILINE)


def _start(script: str, *arguments: str) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [sys.executable, "-c", script, *arguments],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
    )


def _answer(child: "subprocess.Popen[str]") -> tuple[Any, str]:
    """What a child printed after "@", and why there is none."""
    try:
        out, err = child.communicate(timeout=SECONDS)
    except subprocess.TimeoutExpired:
        child.kill()
        child.communicate()
        return None, f"no answer within {SECONDS:g} s"
    lines = [line[1:] for line in out.splitlines() if line.startswith("@")]
    if child.returncode == 0 and lines:
        return json.loads(lines[-1]), ""
    if child.returncode < 0:
        return None, f"the process crashed (signal {-child.returncode})"
    last = [line for line in err.splitlines() if line.strip()]
    return None, last[-1].strip() if last else f"the process ended with status {child.returncode}"


def _machine() -> tuple[Description, list[str]]:
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9
    disk = shutil.disk_usage(Path.cwd()).free / 1e9
    machine = {"cores": cores, "memory_GB": round(memory, 1), "free_disk_GB": round(disk, 1)}
    short = []
    if memory < MEMORY_GB:
        short.append(f"At least {MEMORY_GB:g} GB of memory are needed; this machine has {memory:.1f} GB.")
    if disk < DISK_GB:
        short.append(
            f"At least {DISK_GB:g} GB of free disk are needed; there are {disk:.1f} GB in {Path.cwd()}."
        )
    return machine, short


def _system() -> str:
    try:
        name = platform.freedesktop_os_release().get("PRETTY_NAME", "")
    except OSError:
        name = ""
    return f"{name or platform.system()}, {platform.machine()}"


def _notes(drawing: Sequence[Description], renderer: Description | None) -> list[str]:
    notes = []
    if drawing and all("llvmpipe" in d["renderer"] or "softpipe" in d["renderer"] for d in drawing):
        notes.append("OpenGL draws by software; with a graphics card and its driver it is many times faster.")
    if renderer and all(d["type"] == "CPU" for d in renderer["devices"]):
        notes.append("Cycles renders on the processor; no CUDA, OptiX, HIP or oneAPI device was found.")
    if renderer and not renderer["osl"]:
        notes.append(
            "This Blender has no Open Shading Language; lens distortion and Lafortune lobes need it."
        )
    return notes


if __name__ == "__main__":  # where even the command line's own imports fail
    options = argparse.ArgumentParser(description=HELP)
    configure(options)
    sys.exit(run(options.parse_args()))
