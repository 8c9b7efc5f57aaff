"""X X' of 1500 x 4096 float32 on one core, with the kernels that NumPy's OpenBLAS takes by itself and with those that
``interchange.blas`` asks for: ``python benchmarks/matrix_kernels.py``."""

import os
import subprocess
import sys
from pathlib import Path

from interchange.blas import SETTING

ROUNDS = 7
WORK = """
import time, numpy as np
from threadpoolctl import threadpool_info
X = np.random.default_rng(0).random((1500, 4096), np.float32)
best = min((lambda t: (X @ X.T, time.perf_counter() - t)[1])(time.perf_counter()) for _ in range({rounds}))
name = next(x["architecture"] for x in threadpool_info() if "numpy" in x["filepath"])
print(f"{{name:12}} {{1500**2 * 4096 / best / 1e9:6.1f}} GF, of which a half is computed once")
"""


def main() -> None:
    own = {k: v for k, v in os.environ.items() if k != SETTING} | {"OPENBLAS_NUM_THREADS": "1"}
    for env in (own, own | {SETTING: os.environ.get(SETTING, "")}):
        subprocess.run(
            [sys.executable, "-c", WORK.format(rounds=ROUNDS)],
            env=env,
            cwd=Path(__file__).parents[1],
            check=True,
        )


if __name__ == "__main__":
    main()
