"""How sure calls could be told: the temperature under which those of opened sets are the likeliest.

    python benchmarks/blind/temperature.py SET [SET ...] --told 2

``--told``: the temperature of the programs that answered. What errors larger than declared called is left out, but for
who is sure and wrong; what is judged on noise is told without a temperature and stays as it is.
"""

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmarks.blind.results import FOLDER, Answer, read
from benchmarks.blind.rules import calibration, calibration_by_chance, confidently_wrong, there
from benchmarks.blind.sealing import SealError

OF_NOISE = ("sensor_noise", "fixed_pattern", "quantization")
TRIED = np.arange(0.5, 4.0, 0.05)
SHOWN = (1.0, 1.25, 1.5, 2.0)
HALF = 0.5  # of log likelihood: one standard deviation


def log_odds(p: float | np.ndarray) -> float | np.ndarray:
    return np.log(p / (1 - p))


def anew(a: Answer, told: float, temperature: float) -> Answer:
    """The answer with calls as ``temperature`` tells them."""
    said = {
        n: p if n in OF_NOISE else float(1 / (1 + np.exp(-log_odds(p) * told / temperature)))
        for n, p in a.said.items()
    }
    return replace(a, said=said)


def main() -> None:
    p = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    p.add_argument("sets", nargs="+")
    p.add_argument("--told", type=float, required=True)
    args = p.parse_args()
    try:
        cases = [c for name in args.sets for c in read(FOLDER / f"{name}.json").cases]
    except SealError as problem:
        p.error(str(problem))
    declared = [(x, a) for x, a in cases if x["stratum"] != "stress"]
    calls = [
        (s, n in there(x))
        for x, a in declared
        for n, s in a.said.items()
        if n not in OF_NOISE and s >= 0.5  # the likeliest of a tie may be called with less
    ]
    odds, right = args.told * log_odds(np.array([s for s, _ in calls])), np.array([r for _, r in calls])
    likelihood = np.array([-np.logaddexp(0, -np.where(right, odds, -odds) / T).sum() for T in TRIED])
    near = TRIED[likelihood > likelihood.max() - HALF]
    print(f"{len(cases)} cases; {len(calls)} calls, {right.sum()} right")
    print(f"likeliest under {TRIED[likelihood.argmax()]:.2f} ({near[0]:.2f} to {near[-1]:.2f})")
    for T in SHOWN:
        told = [(s, n in there(x)) for x, a in declared for n, s in anew(a, args.told, T).said.items()]
        wrong = sum(bool(confidently_wrong(x, anew(a, args.told, T))) for x, a in cases)
        chance, high = calibration_by_chance(told)
        print(
            f"{T:.2f}: calibration error {calibration(told):.3f} of {len(told)} (chance {chance:.3f}, {high:.3f} or "
            f"less in 95 %); sure and wrong {wrong} of {len(cases)}"
        )


if __name__ == "__main__":
    main()
