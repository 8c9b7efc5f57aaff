"""The process that runs Blender: ``python -m offline.worker FOLDER``, jobs on standard input, replies on its output.

It ends with the process that started it, whatever that died of and whatever it renders then. It and the modules that
only it imports (offline.blender_*, offline.frame) are the only ones that know bpy.
"""

import os
import shutil
import sys
import threading
import time
import traceback
from pathlib import Path

LOOK_SECONDS = 0.5  # between looks at whether the process that asks is still there


def main() -> int:
    folder = Path(sys.argv[1])
    threading.Thread(target=_end_with, args=(os.getppid(), folder), daemon=True).start()
    replies = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # Blender prints on the standard output, which is the replies' from here on
    import bpy
    import numpy as np

    from offline import protocol
    from offline.blender_stage import Stage
    from offline.frame import render

    stage = Stage(folder)
    receiver = protocol.Receiver()
    version = f"Cycles, Blender {bpy.app.version_string}"
    sender = protocol.Sender()
    protocol.write(replies, sender.pack(protocol.Reply(version=version)))
    count = 0
    while (message := protocol.read(sys.stdin.buffer)) is not None:
        began = time.perf_counter()
        try:
            job = receiver.unpack(message)
            arrays, seconds = render(stage, job, folder)
            files = {}
            for name, values in arrays.items():
                path = folder / f"{count}_{name}.npy"
                np.save(path, np.asarray(values, np.float32))
                files[name] = str(path)
            seconds["worker"] = time.perf_counter() - began
            reply = protocol.Reply(files, seconds, version)
        except MemoryError:
            return 137
        except Exception as error:
            traceback.print_exc()
            reply = protocol.Reply(version=version, error=f"{type(error).__name__}: {error}")
        count += 1
        protocol.write(replies, sender.pack(reply))
    return 0


def _end_with(parent: int, folder: Path) -> None:
    """Blender runs its operators without the interpreter's lock: this looks on while it renders."""
    while os.getppid() == parent:
        time.sleep(LOOK_SECONDS)
    shutil.rmtree(folder, ignore_errors=True)
    os._exit(1)


if __name__ == "__main__":
    sys.exit(main())
