"""A worker process seen from outside: started, asked, watched, and killed when it does not answer."""

import os
import select
import shutil
import subprocess
import sys
import tempfile
import time
import weakref
from pathlib import Path
from typing import BinaryIO, cast

import psutil

from offline import protocol

ROOT = Path(__file__).resolve().parent.parent
START_SECONDS = 120.0  # importing Blender from a cold disk takes long


class WorkerDied(Exception):
    """The worker is gone, with the reason in one clause."""


class Worker:
    """``memory``: bytes of resident memory beyond which it is killed; 0 sets no limit."""

    def __init__(self, memory: int = 0) -> None:
        self.memory = memory
        self.folder = Path(tempfile.mkdtemp(prefix="brightfield-"))
        self.log = self.folder / "blender.log"
        self.sender = protocol.Sender()
        self.receiver = protocol.Receiver()
        others = os.environ.get("PYTHONPATH")  # an empty one would be the folder that it is started in
        path = [str(ROOT), others] if others else [str(ROOT)]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path)}
        with self.log.open("wb") as log:
            self.process = subprocess.Popen(
                [sys.executable, "-P", "-m", "offline.worker", str(self.folder)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=log,
                env=environment,
                start_new_session=True,  # Ctrl-C ends the batch, not the frame in the middle of a write
            )
        self.finalizer = weakref.finalize(self, _end, self.process, self.folder)
        self.version = self._wait(START_SECONDS).version

    @property
    def pid(self) -> int:
        return self.process.pid

    @property
    def resident(self) -> int:
        """Bytes of memory that it holds."""
        return psutil.Process(self.pid).memory_info().rss

    def ask(self, job: protocol.Job, timeout: float | None) -> protocol.Reply:
        """Raises WorkerDied when the worker crashes, is killed, runs out of memory or time."""
        assert self.process.stdin is not None
        try:
            protocol.write(cast(BinaryIO, self.process.stdin), self.sender.pack(job))
        except OSError:
            raise WorkerDied(self._cause()) from None
        return self._wait(timeout)

    def close(self) -> None:
        self.finalizer()

    def _wait(self, timeout: float | None) -> protocol.Reply:
        assert self.process.stdout is not None
        end = time.monotonic() + timeout if timeout else float("inf")
        while not select.select([self.process.stdout], [], [], 0.25)[0]:
            if time.monotonic() > end:
                self.process.kill()
                raise WorkerDied(f"it did not answer within {timeout:g} s")
            if self.memory and self.process.poll() is None and self.resident > self.memory:
                self.process.kill()
                raise WorkerDied(f"it needed more than {self.memory / 2**20:.0f} MiB of memory")
        message = protocol.read(cast(BinaryIO, self.process.stdout))
        if message is None:
            raise WorkerDied(self._cause())
        return self.receiver.unpack(message)

    def _cause(self) -> str:
        code = self.process.wait()
        last = [line for line in self.log.read_text(errors="replace").splitlines() if line.strip()][-1:]
        why = (
            "it ran out of memory"
            if code == 137
            else f"signal {-code}"
            if code < 0
            else f"exit status {code}"
        )
        return f"{why}: {last[0].strip()}" if last and code >= 0 else why


def _end(process: "subprocess.Popen[bytes]", folder: Path) -> None:
    process.kill()
    process.wait()
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            try:
                pipe.close()
            except OSError:  # what was still to be written has no reader any more
                continue
    shutil.rmtree(folder, ignore_errors=True)
