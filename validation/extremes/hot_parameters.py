"""Implicit steps at extreme parameters: Young's modulus over ten decades, contrasts over eight in
one body, Poisson's ratio up to 0.4999, and time steps in which matter crosses many cells.
"""

from typing import NamedTuple

from mpm_ref.hot.methods import METHODS as ALL

from ..common.registry import experiment
from .blocks import DX, FRAME, brick, elastic, gravity, halves, shake
from .hot_solve import (
    METHODS,
    StepSequence,
    StepSetup,
    record_solves,
    run_by_methods,
    solve,
    solve_table,
)

SOFT = (1e2, 1e4, 1e6, 1e8, 1e10, 1e12)
CONTRAST = (1.0, 1e2, 1e4, 1e6, 1e8)
STIFFEST = 1e12
SINGLE = ALL["hot"].cycle._replace(precision="single")
RATIOS = (0.0, 0.3, 0.45, 0.49, 0.499, 0.4999)
CELLS = {2: (16, 8), 3: (8, 4, 4)}


class ModulusPair(NamedTuple):
    """A box in d dimensions: modulus of its softer half [Pa], and contrast of the halves."""

    d: int
    E: float
    contrast: float


def pairs(d, soft=SOFT, contrasts=CONTRAST):
    """Return all pairs whose stiffer half is within bounds."""
    return [ModulusPair(d, E, c) for E in soft for c in contrasts if E * c <= STIFFEST]


def strained_box(d, laws, dt=FRAME):
    """Return the `StepSetup` of a strained box of two laws in uneven motion."""
    return StepSetup(tuple(map(shake, halves(CELLS[d], laws))), DX, dt, gravity(d))


@experiment("extremes.hot.stiffness", title="Moduli from 1e2 to 1e12 Pa, contrasts up to 1e8",
            profiles=("quick", "standard"), budget={"quick": 4, "standard": 12})
def stiffness(run):
    """Solve one step of 1/24 s of a box with a soft and a stiff half, by all methods, and by HOT
    with the matrices of its smoothers in single precision.
    """
    cases = run.choose(quick=pairs(2) + pairs(3, (1e2, 1e4, 1e12), (1.0, 1e8)),
                       standard=pairs(2) + pairs(3))
    rows = []
    for case in run.progress(cases, "pairs"):
        setup = strained_box(case.d, (elastic(case.E), elastic(case.E * case.contrast)))
        rows += [(*case, solve(setup, method)) for method in METHODS]
        rows.append((*case, solve(setup, "hot", cycle=SINGLE)._replace(method="hot-single")))
    for d, cells in CELLS.items():
        record_solves(run, f"stiffness.{d}d", [end for k, *_, end in rows if k == d],
                    f"{d}D, {' x '.join(map(str, cells))} cells, {2**d} particles each")
    solve_table(run, ModulusPair._fields, rows)


@experiment("extremes.hot.poisson", title="Poisson's ratio up to 0.4999",
            profiles=("quick", "standard"), budget={"quick": 3, "standard": 10})
def poisson(run):
    """Solve one step of a box of one material that is nearly incompressible."""
    rows = []
    for d in (2, 3):
        for E in run.choose(quick=(1e6,), standard=(1e4, 1e6, 1e9)):
            for nu in RATIOS:
                setup = strained_box(d, (elastic(E, nu), elastic(E, nu)))
                rows += [(d, E, nu, solve(setup, method)) for method in METHODS]
    record_solves(run, "poisson", [row[-1] for row in rows], "2D and 3D boxes, 512 and 1024 "
                "particles, one step of 1/24 s")
    solve_table(run, ("d", "E", "nu"), rows)


STEPS = 5
TIMES = (1e-6, 1e-3, FRAME)       # [s]
CROSSED = (1.0, 3.0, 10.0)         # cells, by the fastest particle in a step
NOTES = {"time_step": "", "cfl": "slow solves start with J from -15 to 17, as neighbours crossed "
                                 "10 cells, and keep the first inverse of that state"}


def thrown_box(d, E, dt, speed):
    """Return the `StepSetup` of a box in uneven motion of a speed [m/s]."""
    return StepSetup((shake(brick(CELLS[d], elastic(E)), speed=speed),), DX, dt, gravity(d))


@experiment("extremes.hot.time_step", title="Steps of 1/24 s, and past the CFL bound",
            profiles=("quick", "standard"), budget={"quick": 5, "standard": 70})
def time_step(run):
    """Run fixed time steps; the explicit bound of the stiffest box is 4e-6 s."""
    scenes = []
    for d in run.choose(quick=(2,), standard=(2, 3)):
        for E in run.choose(quick=(1e4, 1e9), standard=(1e4, 1e6, 1e9)):
            name = f"{d}d, E = {E:.0e}"
            scenes += [StepSequence(f"{name}, dt = {dt:.2g}", thrown_box(d, E, dt, 0.5), STEPS)
                       for dt in TIMES]
            scenes += [StepSequence(f"{name}, CFL = {cells:g}",
                                    thrown_box(d, E, FRAME, cells * DX / FRAME), STEPS)
                       for cells in CROSSED]
    rows = run_by_methods(run.progress(scenes, "runs"))
    for name, word in (("time_step", "dt = "), ("cfl", "CFL = ")):
        record_solves(run, name, [end for case, end in rows if word in case],
                    f"box of 512 particles (3D: 1024), {STEPS} steps", NOTES[name])
    solve_table(run, ("run",), rows)
