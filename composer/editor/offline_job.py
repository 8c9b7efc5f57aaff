"""A view rendered by path tracing while the editor goes on: better with every batch, stopped at any time.

Each batch is one frame of a worker process with a seed of its own; the mean of the batches is the image.
"""

import threading
from dataclasses import replace
from typing import Any

import numpy as np

from interchange.camera import Camera
from interchange.image import Image
from interchange.problems import BrightfieldError
from interchange.scene import Scene


class OfflineJob:
    """Starts at once. ``image`` is the mean so far, None before the first batch; ``error`` what went wrong."""

    def __init__(
        self, scene: Scene, camera: Camera, samples: int = 64, batch: int = 8, threads: int = 0
    ) -> None:
        self.scene, self.camera, self.samples = scene, camera, samples
        self.batch, self.threads = min(batch, samples), threads
        self.image: Image | None = None
        self.error = ""
        self.done_samples = 0
        self.version = 0  # grows with every batch
        self._stop = threading.Event()
        self._lock = threading.Lock()
        self._worker: Any = None
        self._thread = threading.Thread(target=self._run, name="offline render", daemon=True)
        self._thread.start()

    @property
    def running(self) -> bool:
        return self._thread.is_alive()

    @property
    def fraction(self) -> float:
        return self.done_samples / self.samples

    def cancel(self) -> None:
        """Ends the worker process at once; what is there of the image stays."""
        self._stop.set()
        threading.Thread(target=self._end, name="offline cancel", daemon=True).start()

    def _end(self) -> None:
        while self.running:  # a worker that died is started anew once, for the frame's sake
            with self._lock:
                if self._worker is not None:
                    self._worker.close()
            self._thread.join(0.2)

    def wait(self, seconds: float | None = None) -> None:
        self._thread.join(seconds)

    def _run(self) -> None:
        from offline.renderers.cycles import Cycles
        from offline.settings import CyclesSettings

        total: np.ndarray | None = None
        try:
            with Cycles() as cycles:
                self._worker = cycles
                seed = 0
                while self.done_samples < self.samples and not self._stop.is_set():
                    count = min(self.batch, self.samples - self.done_samples)
                    settings = CyclesSettings(samples=count, seed=seed, threads=self.threads)
                    image = cycles.render(self.scene, self.camera, settings)
                    if self._stop.is_set():
                        break
                    part = image.pixels.astype(np.float64) * count
                    total = part if total is None else total + part
                    self.done_samples += count
                    seed += 1
                    mean = (total / self.done_samples).astype(np.float32)
                    self.image = replace(image, pixels=mean)
                    self.version += 1
        except BrightfieldError as error:
            if not self._stop.is_set():
                self.error = str(error)
        finally:
            with self._lock:
                self._worker = None
