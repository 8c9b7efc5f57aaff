"""What ``interchange.blas`` asks of NumPy's OpenBLAS, beside what that does by itself.

    python benchmarks/matrix_kernels.py

X Xᵀ of 1500 x 4096 float32 on one core, by its kernels; and the inverse of a pose, by the threads it takes, on a
machine as it is and where every core has other work.
"""

import os
import subprocess
import sys
from pathlib import Path

from interchange.blas import SETTING, THREADS

ROUNDS = 7
KERNELS = f"""
import time, numpy as np
from threadpoolctl import threadpool_info
X = np.random.default_rng(0).random((1500, 4096), np.float32)
best = min((lambda t: (X @ X.T, time.perf_counter() - t)[1])(time.perf_counter()) for _ in range({ROUNDS}))
name = next(x["architecture"] for x in threadpool_info() if "numpy" in x["filepath"])
print(f"{{name:12}} {{1500**2 * 4096 / best / 1e9:6.1f}} GF, of which a half is computed once")
"""
INVERSES = """
import os, sys, time, numpy as np
from threadpoolctl import threadpool_info
pose = np.eye(4)
pose[:3, 3] = 0.1, 0.2, 0.3
began, count = time.perf_counter(), 0
while time.perf_counter() < began + 3:
    np.linalg.inv(pose)
    count += 1
threads = next(x["num_threads"] for x in threadpool_info() if "numpy" in x["filepath"])
print(f"{threads} threads, {sys.argv[1]}: {3e6 / count:8.1f} µs an inverse of 4 x 4")
"""


def run(work: str, env: dict[str, str], *words: str) -> None:
    root = Path(__file__).parents[1]
    subprocess.run([sys.executable, "-c", work, *words], env=env, cwd=root, check=True)


def main() -> None:
    own = {k: v for k, v in os.environ.items() if k != SETTING} | {THREADS: "1"}
    chosen = own | {SETTING: os.environ.get(SETTING, "")}
    for env in (own, chosen):
        run(KERNELS, env)
    all_threads = {k: v for k, v in chosen.items() if k != THREADS}
    for env in (all_threads, chosen):
        run(INVERSES, env, "the machine as it is")
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in os.sched_getaffinity(0)]
    try:
        for env in (all_threads, chosen):
            run(INVERSES, env, "all cores at work")
    finally:
        for process in busy:
            process.kill()


if __name__ == "__main__":
    main()
