"""One case from its plan: causes by lot, amplitudes for the severities asked for, captures and their label."""

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.blind import chain, errors, proposals, truth, usd
from benchmarks.blind.apart import errors as apart_errors
from benchmarks.blind.apart import proposals as apart_proposals
from benchmarks.blind.apart import world as apart_world
from benchmarks.blind.bench import Bench, Shot
from benchmarks.blind.chain import Cause
from benchmarks.blind.errors import Tolerances
from benchmarks.blind.picture import write_png
from benchmarks.blind.proposals import Proposal
from benchmarks.blind.scenes import scene
from benchmarks.blind.severity import OutOfReach, severity, solve
from benchmarks.blind.strata import SCENES, Plan
from benchmarks.blind.tracing import Quality, guide

TRIES = 12
CLOSE = 0.04  # of a severity, on the fine grid


@dataclass(frozen=True)
class Settings:
    """``seed``: of the set: its worlds, so that another set stands on other calibration errors. ``still``: scenes
    stand as they are written, and errors are those of the images alone."""

    cache: Path
    seed: int
    size: tuple[int, int] | None = None  # each scene's own
    samples: int = 25
    fine: int = 3
    still: bool = False


def made(plan: Plan, settings: Settings, folder: Path) -> dict[str, Any]:
    """Writes the case and returns its label; captures.json is the last file."""
    nominal = scene(plan.scene, settings.size)
    tolerances = Tolerances()
    key = [settings.seed, SCENES.index(plan.scene), plan.world]
    world = np.random.default_rng([*key, 1] if plan.apart else key)
    disturbed = apart_world.disturbed if plan.apart else errors.disturbed
    bench = nominal if settings.still else disturbed(nominal, tolerances, world)
    shots = tuple(replace(s, repeats=plan.repeats) if s.repeats > 2 else s for s in nominal.shots)
    bench, nominal = replace(bench, shots=shots), replace(nominal, shots=shots)
    rng = np.random.default_rng(plan.seed)
    drawn = (apart_errors.draw if plan.apart else errors.draw)(bench, tolerances, rng, plan.scale)
    quality = Quality(settings.samples, settings.fine)
    seed = int(world.integers(1 << 30))
    fine = truth.Setup(bench, drawn, quality, seed, settings.cache, plan.filter)
    pilot = replace(fine, quality=Quality(9, 1), filter="box")
    still = truth.means(pilot, []) if plan.effects else []
    way = apart_proposals if plan.apart else proposals

    def propose(name: str, bench: Bench, rng: np.random.Generator) -> Proposal:
        p = way.propose(name, bench, rng)
        return replace(p, cause=replace(p.cause, eye=plan.eye))

    causes = [_cause(name, s, propose, fine, pilot, still, rng) for name, s in plan.effects]
    fine = replace(fine, quality=replace(quality, margin=truth.margin(fine, causes)))
    without = truth.means(fine, [])
    causes = [
        c if s == 0 else _refined(c, s, fine, without) for c, (_, s) in zip(causes, plan.effects, strict=True)
    ]
    mean = truth.means(fine, causes) if causes else without
    well = bench.sensor.full_well
    effects = [
        {
            **told(c, plan.apart),
            "wanted": s,
            "severity": severity(without, truth.means(fine, [c]), well) if len(causes) > 1 else None,
            "parameters": way.parameters(c, bench),
        }
        for c, (_, s) in zip(causes, plan.effects, strict=True)
    ]
    if len(causes) == 1:
        effects[0]["severity"] = severity(without, mean, well)
    _write(folder, nominal, tolerances, fine, causes, mean, rng)
    return {
        "case": plan.case, "stratum": plan.stratum, "scene": plan.scene, "world": plan.world, "seed": plan.seed,
        "apart": plan.apart, "eye": plan.eye, "scale": plan.scale, "filter": plan.filter, "repeats": plan.repeats,
        "effects": effects, "severity": severity(without, mean, well),
    }  # fmt: skip


def told(cause: Cause, apart: bool) -> dict[str, Any]:
    """Of apart/ a label does not say which form it is, nor its numbers: the set's seed binds them all the same."""
    return {"name": cause.name, "form": "apart", "place": "", "eye": cause.eye} if apart else asdict(cause)


def _cause(
    name: str,
    wanted: float,
    propose: Callable[[str, Bench, np.random.Generator], Proposal],
    fine: truth.Setup,
    pilot: truth.Setup,
    still: list[np.ndarray],
    rng: np.random.Generator,
) -> Cause:
    """Drawn again where the severity is out of its reach, or where it would be seen itself."""
    bench = fine.bench
    for _ in range(TRIES):
        p = propose(name, bench, rng)
        if p.cause.form in chain.NOISE or p.cause.form == "steps":
            return p.cause.at(p.start)

        def of(a: float, cause: Cause = p.cause) -> float:
            return severity(still, truth.means(pilot, [cause.at(a)]), bench.sensor.full_well)

        try:
            a, _ = solve(of, wanted, p.low, p.high, p.start * wanted / 0.01, 0.03)
        except OutOfReach:
            continue
        cause = p.cause.at(a)
        if name != "occluder" or not _seen(pilot, cause):
            return cause
    raise OutOfReach(f"{name} at {wanted:g} in {bench.name}: no draw of {TRIES} gives it.")


def _seen(pilot: truth.Setup, cause: Cause) -> bool:
    bench = truth.changed(pilot.bench, [cause])
    k = len(bench.parts) - 1
    return any((guide(bench, e, 0, pilot.quality, pilot.cache)["part"] == k).any() for e in bench.eyes)


def _refined(cause: Cause, wanted: float, fine: truth.Setup, without: list[np.ndarray]) -> Cause:
    """The pilot's grid is coarse: one step nearer on the fine one, where that costs no rendering."""
    cheap = chain.is_chain(cause) or cause.form in (*truth.LIGHT, "light_beam")
    for _ in range(3 if cheap else 0):
        s = severity(without, truth.means(fine, [cause]), fine.bench.sensor.full_well)
        if s == 0 or abs(s / wanted - 1) < CLOSE:
            break
        power = 2.0 if cause.form in chain.ALL["fine"] else 1.0
        cause = cause.at(cause.amplitude * (wanted / s) ** (1 / power))
    return cause


def _write(
    folder: Path, nominal: Bench, tolerances: Tolerances, setup: truth.Setup, causes: list[Cause],
    means: list[np.ndarray], rng: np.random.Generator,
) -> None:  # fmt: skip
    (folder / "images").mkdir(parents=True, exist_ok=True)
    usd.write_scene(nominal, folder / "scene.usda")
    entries = []
    for shot, mean in zip(nominal.shots, means, strict=True):
        for repeat in range(shot.repeats):
            name = f"images/{len(entries):03d}.png"
            own = [c for c in causes if c.of(shot.eye)]
            write_png(folder / name, truth.capture(setup, own, shot, mean, rng, repeat))
            entries.append(_entry(nominal, shot, name))
    head = {"scene": "scene.usda", "tolerances": tolerances.as_dict(), "captures": entries}
    beside = folder / ".captures.json"
    beside.write_text(json.dumps(head, indent=1))
    beside.replace(folder / "captures.json")


def _entry(bench: Bench, shot: Shot, image: str) -> dict[str, Any]:
    camera = f"/World/{bench.eyes[shot.eye].name}"
    return {"image": image, "camera": camera, "time": usd.time_of(bench, shot), "exposure": shot.exposure}
