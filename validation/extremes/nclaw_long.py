"""Learned laws for five times as long as in training."""

from typing import NamedTuple

import numpy as np

from mpm_ref.energy import kinetic
from mpm_ref.monitor import volume_ratio
from mpm_ref.nclaw.bodies import copy_body
from mpm_ref.nclaw.strain_watch import strain_report
from mpm_ref.nclaw.study.compare import RunBroken, positions
from mpm_ref.scene import build

from ..common.registry import experiment
from ..common.scenes import threads_for
from .nclaw_runs import laws, scene_for

STEPS = {"quick": 500, "standard": 5000}
EVERY = 50          # steps between rows
TAIL = 5            # means are over the last fifth of a run
COMPARED = {"kinetic": "J", "volume": "1", "height": "m"}


class Row(NamedTuple):
    """A learned run beside the true one, at a time."""

    step: int
    error: float            # mean squared [m^2]
    kinetic: float          # [J]
    true_kinetic: float
    volume: float           # mean J
    true_volume: float
    height: float           # mean [m]
    true_height: float
    beyond: float           # how far the farthest point is out of bounds, in their width


@experiment("extremes.nclaw.long", title="NCLaw: runs of 5 000 steps",
            profiles=("quick", "standard"), budget={"quick": 15, "standard": 300})
def long_run(run):
    """Whether a body comes to rest, keeps its volume and stays where the true one is."""
    table = []
    for law in run.progress(laws(run), "laws"):
        rows, said = drawn_out(law, scene_for(run, law.environment, every=EVERY,
                                              steps=STEPS[run.profile]))
        table += [(law.name, *row) for row in rows]
        record_drift(run, law, rows, said)
    run.table("drift", ("law", *Row._fields), table)


def drawn_out(law, scene):
    """`Row`s of a long run, and the sentence with which it stopped."""
    problem, beside = build(scene), build(scene)
    body, true = law.make(problem.bodies[0]), copy_body(beside.bodies[0])
    rows, said = [], ""
    with threads_for(problem.bodies):
        run = positions(problem, (body,))
        for k, x in enumerate(positions(beside, (true,))):
            try:
                at = next(run)
            except RunBroken as end:
                said = str(end)
                break
            rows.append(row(k * scene.every, (body, true), (at, x), law.bounds))
    return rows, said


def row(step, bodies, x, bounds):
    """`Row` of the learned and the true body, and their positions x in the bodies' own order."""
    state = [(float(kinetic(body.particles).sum()), float(volume_ratio(body.particles).mean()),
              float(at[:, 1].mean())) for body, at in zip(bodies, x, strict=True)]
    pairs = [a for pair in zip(*state, strict=True) for a in pair]
    return Row(step, float(np.mean((x[0] - x[1]) ** 2)), *pairs,
               strain_report(bodies[0], bounds).excess)


def record_drift(run, law, rows, said):
    """Record how a run went on and ended."""
    name, tail = f"extremes.nclaw.long.{law.name}", rows[-max(len(rows) // TAIL, 1):]
    rule = {"scale": f"{STEPS[run.profile]} steps, 1000 particles"}
    run.record(f"{name}.steps", rows[-1].step, unit="steps", comparator="=",
               paper=STEPS[run.profile], note=said, **rule)
    rule["comparator"] = "info"
    farthest = max(row.beyond for row in rows)
    run.record(f"{name}.error", mean(rows, "error"), unit="m^2", note="of the last fifth "
               f"{mean(tail, 'error'):.3g} m^2; farthest out of the bounds of strains "
               f"{farthest:.2g} widths", **rule)
    for word, unit in COMPARED.items():
        run.record(f"{name}.{word}", mean(tail, word), unit=unit, note="mean of the last fifth; "
                   f"the true one's {mean(tail, f'true_{word}'):.4g}", **rule)


def mean(rows, name):
    """Mean of a field."""
    return float(np.mean([getattr(row, name) for row in rows]))
