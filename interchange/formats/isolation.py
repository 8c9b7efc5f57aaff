"""Run a parser where it can do no harm: a process of its own, with bounds on time and memory.

A damaged or hostile file can make native code read out of bounds, allocate a hundred gigabytes or loop for
ever. ``isolated`` calls a module-level function in a fresh process; whatever happens there comes back as the
function's result or as one ``FileError`` that names the file.

    main process ──> nursery (one, small, single-threaded; imports the parser's module once)
                        └─ fork ─> guard (keeps the clock, collects stderr) ─ fork ─> worker (limits, parser)

The nursery is started once a process, so a call costs two forks of a small process, not an interpreter's
start. Results travel as pickles with arrays out of band; only plain data, arrays and this program's own
classes are accepted, since the worker that writes them may have been taken over by the file.
"""

import atexit
import contextlib
import importlib
import io
import json
import os
import pickle
import resource
import select
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

from interchange.problems import BrightfieldError, FileError, Problem, Where

P = ParamSpec("P")
R = TypeVar("R")

SECONDS = 60.0
MEMORY_BYTES = 4 * 1024**3
_LENGTH = struct.Struct("<Q")
_ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
_PR_SET_PDEATHSIG = 1


def isolated(
    function: Callable[..., R],
    path: str | os.PathLike[str],
    *args: Any,
    seconds: float = SECONDS,
    memory_bytes: int = MEMORY_BYTES,
) -> R:
    """``function(path, *args)``, called in a process of its own. ``path`` is the file that messages name.

    ``function`` must be importable by its module and name. Libraries that it imports itself, so that the main
    process need not, can be named in its module's ``PRELOAD``: they then load once, not once a call. Arguments
    and result must pickle; the result may hold plain data, NumPy arrays and classes of ``interchange``. What the
    function prints is dropped.

    ``seconds``: wall-clock limit. ``memory_bytes``: what the call may allocate, and how large its result may
    be. Raises FileError, one sentence a problem: those that the function raised itself, or that it crashed,
    ran out of time or memory, or raised another exception.
    """
    if "<" in function.__qualname__ or function.__module__ == "__main__":
        raise TypeError(f"{function.__qualname__} must be importable by its module and name.")
    job = (function.__module__, function.__qualname__, (os.fspath(path), *args), seconds, memory_bytes)
    here, there = socket.socketpair()
    read_status, write_status = os.pipe()
    with here, os.fdopen(read_status, "rb") as status_file:
        try:
            _nursery.ask(function.__module__, [there.fileno(), write_status])
        finally:
            there.close()
            os.close(write_status)
        value: Any
        try:
            _send(here, pickle.dumps(job, protocol=5), [])
            kind, value = _receive(here, memory_bytes)
        except _TooLarge as error:
            raise _file_error(path, _too_much_memory(memory_bytes)) from error
        except pickle.UnpicklingError as error:
            raise _file_error(path, "Its parser sent back what is not data; the file is hostile.") from error
        except OSError:
            kind, value = "", None  # the worker died; the guard says how
        if kind == "value":
            return value
        if kind == "problems":
            raise FileError(value)
        if kind == "sentence":
            raise BrightfieldError(value)
        if kind == "exception":
            raise _file_error(path, f"It cannot be read: {value}")
        here.close()
        status = json.loads(status_file.read() or b"{}")
    raise _file_error(path, _what_happened(kind, status, seconds, memory_bytes))


def _what_happened(kind: str, status: dict[str, Any], seconds: float, memory_bytes: int) -> str:
    if status.get("late"):
        return f"Reading it took longer than the allowed {seconds:g} s."
    if kind == "memory" or any(sign in status.get("stderr", "") for sign in ("bad_alloc", "MemoryError")):
        return _too_much_memory(memory_bytes)
    if number := status.get("signal"):
        return f"It crashed its parser ({signal.Signals(number).name}); the file is damaged."
    return "Its parser ended without a result; the file is damaged."


def _too_much_memory(memory_bytes: int) -> str:
    return f"Reading it needs more than the allowed {memory_bytes / 1e9:.3g} GB of memory."


def _file_error(path: str | os.PathLike[str], message: str) -> FileError:
    return FileError(Problem(message, Where(os.fspath(path))))


class _Nursery:
    """The small process that forks guards. Started on first use, ended with this process."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._control: socket.socket | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._owner = 0

    def ask(self, module: str, fds: list[int]) -> None:
        """Have it import ``module`` and fork a guard that gets ``fds`` (job socket, status pipe)."""
        message = json.dumps([module, sys.path]).encode()
        with self._lock:
            for attempt in (0, 1):
                if self._control is None or self._owner != os.getpid() or attempt:
                    self._start()
                assert self._control is not None
                try:
                    socket.send_fds(self._control, [message], fds)
                    return
                except OSError:  # someone ended it: start another
                    if attempt:
                        raise

    def _start(self) -> None:
        self.stop()
        here, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        boot = (
            "import json, sys; sys.path[:] = json.loads(sys.argv[2]); "
            "from interchange.formats.isolation import _serve; _serve(int(sys.argv[1]))"
        )
        with there:
            self._process = subprocess.Popen(
                [sys.executable, "-c", boot, str(there.fileno()), json.dumps(sys.path)],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                pass_fds=[there.fileno()],
                start_new_session=True,  # Ctrl-C is for the main process, which then hangs up
                env=os.environ | _ONE_THREAD,  # forking a process with threads is undefined
            )
        self._control, self._owner = here, os.getpid()

    def stop(self) -> None:
        if self._control is not None:
            self._control.close()
        if self._process is not None and self._owner == os.getpid():
            self._process.kill()  # it keeps nothing; its guards go on by themselves
            self._process.wait()
        self._control = self._process = None


_nursery = _Nursery()
atexit.register(_nursery.stop)


def _serve(control_fd: int) -> None:
    """The nursery's loop: one message, one guard; ends when the main process hangs up."""
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # guards are reaped by the kernel
    with socket.socket(fileno=control_fd) as control:
        while True:
            message, fds, _, _ = socket.recv_fds(control, 1 << 20, 2)
            if not message:
                return
            module, sys.path[:] = json.loads(message)
            with contextlib.suppress(Exception):  # the worker imports again, and reports
                for name in getattr(importlib.import_module(module), "PRELOAD", ()):
                    importlib.import_module(name)
            if os.fork() == 0:
                control.close()
                _guard(*fds)
            for fd in fds:
                os.close(fd)


def _guard(job_fd: int, status_fd: int) -> None:
    """Fork the worker, keep the clock, report how it ended. Never returns."""
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    status: dict[str, Any] = {}
    try:
        job_socket = socket.socket(fileno=job_fd)
        module, name, args, seconds, memory_bytes = _receive(job_socket, 1 << 32, trusted=True)
        read_stderr, write_stderr = os.pipe()
        worker = os.fork()
        if worker == 0:
            os.close(status_fd)
            _work(job_socket, write_stderr, module, name, args, seconds, memory_bytes)
        os.close(write_stderr)
        job_socket.close()
        deadline = time.monotonic() + seconds
        tail = b""
        ended = os.pidfd_open(worker)
        poll = select.poll()
        poll.register(ended, select.POLLIN)
        poll.register(read_stderr, select.POLLIN)
        poll.register(status_fd, 0)  # POLLERR: the main process hung up
        while True:
            left = deadline - time.monotonic()
            events = dict(poll.poll(left * 1e3)) if left > 0 else {}
            if not events or status_fd in events:
                status["late"] = True
                os.kill(worker, signal.SIGKILL)
                break
            if read_stderr in events and (chunk := os.read(read_stderr, 1 << 16)):
                tail = (tail + chunk)[-4096:]
            elif ended in events:
                break
            else:
                poll.unregister(read_stderr)  # closed; the worker goes on
        _, code = os.waitpid(worker, 0)
        if os.WIFSIGNALED(code):
            status["signal"] = os.WTERMSIG(code)
        status["stderr"] = tail.decode(errors="replace")
        os.write(status_fd, json.dumps(status).encode())
    finally:
        os._exit(0)


def _work(
    job_socket: socket.socket,
    stderr_fd: int,
    module: str,
    name: str,
    args: tuple[Any, ...],
    seconds: float,
    memory_bytes: int,
) -> None:
    """Set the limits, call the function, send what comes of it. Never returns."""
    try:
        _die_with_parent()
        os.dup2(stderr_fd, 1)
        os.dup2(stderr_fd, 2)
        if stderr_fd > 2:
            os.close(stderr_fd)
        used = int(open("/proc/self/statm").read().split()[5]) * resource.getpagesize()  # noqa: SIM115
        for limit, value in (
            (resource.RLIMIT_DATA, used + memory_bytes),  # private writable memory: no library's text counts
            (resource.RLIMIT_FSIZE, memory_bytes),
            (resource.RLIMIT_CORE, 0),
        ):
            resource.setrlimit(limit, (value, value))
        try:
            function: Any = importlib.import_module(module)
            for part in name.split("."):
                function = getattr(function, part)
            answer: tuple[str, Any] = ("value", function(*args))
            buffers: list[pickle.PickleBuffer] = []
            data = pickle.dumps(answer, protocol=5, buffer_callback=buffers.append)
        except FileError as error:
            data, buffers = pickle.dumps(("problems", error.problems)), []
        except BrightfieldError as error:
            data, buffers = pickle.dumps(("sentence", str(error))), []
        except MemoryError:
            data, buffers = pickle.dumps(("memory", None)), []
        except Exception as error:
            text = (str(error) if type(error) is ValueError else f"{type(error).__name__}: {error}")[:500]
            data, buffers = pickle.dumps(("exception", text)), []
        _send(job_socket, data, buffers)
    finally:
        os._exit(0)


def _die_with_parent() -> None:
    import ctypes

    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


class _TooLarge(Exception):
    pass


def _send(sink: socket.socket, data: bytes, buffers: list[pickle.PickleBuffer]) -> None:
    """Number of parts, their lengths, the parts: the pickle, then its arrays."""
    parts = [memoryview(data), *(b.raw() for b in buffers)]
    sink.sendall(b"".join(_LENGTH.pack(n) for n in (len(parts), *(p.nbytes for p in parts))))
    for part in parts:
        sink.sendall(part)


def _receive(source: socket.socket, limit: int, trusted: bool = False) -> Any:
    """What ``_send`` sent; raises OSError if the sender died, _TooLarge beyond ``limit`` bytes."""
    (count,) = _LENGTH.unpack(_read(source, _LENGTH.size))
    if count > limit // _LENGTH.size:
        raise _TooLarge
    lengths = struct.unpack(f"<{count}Q", _read(source, _LENGTH.size * count))
    if sum(lengths) > limit:
        raise _TooLarge
    data, *buffers = (_read(source, n) for n in lengths)
    unpickler = pickle.Unpickler if trusted else _PlainUnpickler
    return unpickler(io.BytesIO(data), buffers=buffers).load()


def _read(source: socket.socket, length: int) -> bytearray:
    data = bytearray(length)
    view = memoryview(data)
    while view:
        n = source.recv_into(view)
        if n == 0:
            raise ConnectionError
        view = view[n:]
    return data


class _PlainUnpickler(pickle.Unpickler):
    """Unpickles plain data, NumPy arrays and classes of this program; nothing that could run a command."""

    NUMPY = frozenset({"_frombuffer", "_reconstruct", "scalar", "dtype", "ndarray"})
    BUILTINS = frozenset({"set", "frozenset", "complex", "slice", "range", "bytearray"})

    def find_class(self, module: str, name: str) -> Any:
        plain = (module == "builtins" and name in self.BUILTINS) or (
            module.partition(".")[0] == "numpy" and name in self.NUMPY
        )
        found = super().find_class(module, name) if plain or module.startswith("interchange.") else None
        if found is None or not (plain or isinstance(found, type)):
            raise pickle.UnpicklingError(f"{module}.{name} is not data.")
        return found
