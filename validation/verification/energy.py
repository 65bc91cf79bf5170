"""The energy budget of explicit steps: it closes, and where each transfer loses energy.

Each scene runs with a budget (`mpm_ref.energy_budget`): the sum of its terms, less the change of
the energy between the first and the last state, is round-off. On a disk that falls on a floor and
bounces, the terms of each transfer stand side by side, and at half the time step: what the transfer
takes per step shows as a loss that grows with the number of steps.
"""

from dataclasses import replace

import numpy as np

from mpm_ref.energy_budget import EnergyBudget, Terms
from mpm_ref.scene import build, load
from mpm_ref.simulate import simulate
from mpm_ref.sweep.setting import scene_at, setting

from ..common.registry import experiment
from ..common.scenes import SCENES, threads_for

TRANSFERS = ("mls", "apic", "mls relaxation 0.004", "apic rpic 0.1", "flip 0.95", "flip", "pic")
CFL = (0.5, 0.25)
ROUND_OFF = 1e-11           # of the sum of the terms' sizes


def budget_of(scene, end):
    """Return the `EnergyBudget` of a scene until a time [s], and the number of its steps."""
    problem, budget = build(scene), EnergyBudget()
    clock = replace(problem.clock, end=end, steps=None, every=None, interval=None)
    with threads_for(problem.bodies):
        *_, last = simulate(replace(problem, clock=clock, budget=budget))
    return budget, last.state.step


@experiment("verification.energy", title="Energy budget: transfer, walls, return map, time",
            profiles=("quick", "standard"), budget={"quick": 20, "standard": 120})
def energy(run):
    """Record how well the budget closes, and the terms of each transfer."""
    ends = run.choose(quick={"hello": 0.3, "column_collapse": 0.05},
                      standard={"hello": 1.5, "column_collapse": 0.5, "nsf_jelly": 0.3,
                                "dam_break": 0.3, "colliding_disks": 1.0})
    for name, end in run.progress(ends.items(), "scenes"):
        budget, steps = budget_of(load(SCENES / f"{name}.toml"), end)
        run.record(f"verification.energy.{name}.gap",
                   abs(budget.gap) / np.abs(budget.terms).sum(), comparator="<=", bound=ROUND_OFF,
                   scale=f"{steps} steps", note="sum of the terms less the change of the energy, "
                                                "relative to the sum of their sizes")
    record_transfers(run, run.choose(quick=0.5, standard=1.0))


def record_transfers(run, end):
    """Record how the loss by each transfer depends on the time step."""
    disk, rows = load(SCENES / "hello.toml"), []
    for transfer in run.progress(TRANSFERS, "transfers"):
        lost = []
        for cfl in CFL:
            budget, steps = budget_of(scene_at(disk, setting(transfer=transfer, cfl=cfl)), end)
            lost.append(-budget.terms.transfer)
            rows.append((transfer, cfl, steps, *budget.terms, budget.last - budget.first))
        run.record(f"verification.energy.{transfer.replace(' ', '-')}.per_step",
                   lost[1] / lost[0], comparator="info", scale=f"cfl {CFL[0]} and {CFL[1]}",
                   note="loss by the transfer at half the step over that at the whole step: 2 for "
                        "a loss per step, 1 for one per time")
    run.table("transfers", ("transfer", "cfl", "steps", *Terms._fields, "change"), rows)
