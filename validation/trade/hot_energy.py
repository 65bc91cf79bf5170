"""The energy of a whole run at a tolerance: the twisted bar, step after step.

The authors' code on this bar with a middle of 1e9 Pa had after 40 steps kinetic energies between
0.31 J and 0.55 J, by solver, at the paper's tolerance, and 0.914 J on which two solvers agreed at
1e-9. Here the grid is coarser: the energies are others, and by how much methods differ is what can
be compared. Several make the same steps, of fixed length, at several tolerances; the run that all
are compared with is one at a far smaller tolerance.
"""

from functools import partial
from typing import NamedTuple

import numpy as np

from mpm_ref.energy import energy
from mpm_ref.scene import build
from mpm_ref.simulate import simulate

from ..common.registry import experiment
from ..common.scenes import with_
from ..hot.stiffness import bar

PER_CELL = 8            # as those runs had
MIDDLE = 1e9            # [Pa]
DT = 1.0 / 96.0         # [s]: half a frame, which 0.6 of the CFL limit comes to at their dx
FIRST = 1e-6            # tolerance of the gradient with which a solve begins that holds an error
CONVERGED = 1e-9        # tolerance at which those runs agreed
AGREE = 0.01            # how near; theirs were 0.0013 apart
COLUMNS = ("method", "eps", "cells", "kinetic", "elastic", "total", "rms", "max", "cpu",
           "iterations", "converged")


class StopRule(NamedTuple):
    """A method and its stop: a gradient, or an error of displacement [dx]."""

    method: str
    eps: float
    cells: float = 0.0

    @property
    def name(self):
        """Part of a record's name."""
        word, value = ("cells", self.cells) if self.cells else ("eps", self.eps)
        return f"{self.method}.{word}{value:.0e}".replace("e-0", "e-")

    @property
    def options(self):
        """Options of the solver. CG is flexible where the V-cycle varies with its inexact coarsest
        solve: plain CG takes thousands of iterations in PN-MGPCG's last steps.
        """
        flexible = {"flexible": True} if self.method == "pn-mgpcg" else {}
        return {"eps": self.eps, "displacement_tolerance": self.cells, **flexible}


ANSWER = StopRule("pn-pcg", 1e-12)       # the run that others are compared with


class BarRunEnd(NamedTuple):
    """The end of a run: energies [J], positions of all particles [m], CPU time [s]."""

    kinetic: float
    elastic: float
    x: np.ndarray           # (N, 3)
    cpu: float              # of the solves
    iterations: float       # per step
    converged: bool         # every step

    @property
    def total(self):
        """Kinetic plus elastic energy [J]."""
        return self.kinetic + self.elastic


@experiment("trade.hot.energy", title="HOT: energy of a whole run at a tolerance",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 900})
def energies(run):
    """Run the bar by methods and tolerances, and compare with a nearly exact run."""
    dx, steps = run.choose(quick=(0.04, 6), standard=(0.024, 40))
    methods = run.choose(
        quick=("hot", "pn-pcg"), standard=("hot", "hot-plus", "lbfgs-h", "pn-pcg", "pn-mgpcg"))
    ladder = run.choose(quick=(1e-7, 1e-9), standard=(1e-5, 1e-7, 1e-9, 1e-11))
    displacement_tolerances = run.choose(quick=(), standard=(1e-2, 1e-3))
    for method in methods:
        full_run(dx, 1, StopRule(method, 1e-3))                       # compiles
    answer = full_run(dx, steps, ANSWER)
    rules = [StopRule(m, eps) for m in methods for eps in ladder]
    rules += [StopRule(m, FIRST, cells) for m in methods
              for cells in displacement_tolerances]
    scale = (f"{len(answer.x)} particles, dx = {dx} m, middle {MIDDLE:.0e} Pa, {steps} steps of "
             f"{DT:.4f} s")
    ends = {rule: full_run(dx, steps, rule) for rule in run.progress(rules, "runs")}
    for rule, end in ends.items():
        record_end(run, rule, end, answer, (dx, scale))
    record_agreement(run, ends, answer, scale)
    rows = {**ends, ANSWER: answer}
    run.table("ends", COLUMNS, [(*key, end.kinetic, end.elastic, end.total,
                                 *distance_in_cells(end, answer, dx), end.cpu, end.iterations,
                                 end.converged)
                                for key, end in rows.items()])


def twisted_bar(dx, steps, rule):
    """Return the bar of Figure 20, with fixed steps and fewer particles per cell."""
    scene = bar(dx, MIDDLE, rule.method, steps, **rule.options)
    count = round(PER_CELL * 0.12 * 0.12 * 0.3 / dx**3)
    bodies = tuple(with_(b, sampling=with_(b.sampling, count=count)) for b in scene.body)
    return with_(scene, body=bodies, dt=DT, cfl=None, longest=None, interval=None)


def full_run(dx, steps, rule):
    """Run the bar. Returns its `BarRunEnd`."""
    problem, reports = build(twisted_bar(dx, steps, rule)), []
    for _ in simulate(problem, on_step=lambda state, dt: reports.append(state.solve)):
        pass
    E = energy(problem.bodies, problem.gravity, problem.inertia)
    x = np.concatenate([b.particles.x[np.argsort(b.id)] for b in problem.bodies])
    return BarRunEnd(E.kinetic, E.elastic, x, sum(sum(r.seconds.values()) for r in reports),
               sum(r.iterations for r in reports) / len(reports),
               all(r.converged for r in reports))


def distance_in_cells(end, answer, dx):
    """Return root mean square and largest distance of the particles from those of the answer, in
    cells.
    """
    far = np.linalg.norm(end.x - answer.x, axis=1) / dx
    return float(np.sqrt(np.mean(far**2))), float(far.max())


def record_end(run, rule, end, answer, size):
    """Record a run's energies over those of the answer, and the distance of its particles."""
    dx, scale = size
    name = f"trade.hot.energy.{rule.name}"
    rms, most = distance_in_cells(end, answer, dx)
    record = partial(run.record, unit="1", comparator="info", scale=scale)
    late = "" if end.converged else "; not every step converged"
    record(f"{name}.kinetic", end.kinetic / answer.kinetic,
        note=f"kinetic energy at the end, {end.kinetic:.4g} J, over that at eps = {ANSWER.eps:g}"
        f"{late}")
    record(f"{name}.total", end.total / answer.total,
           note=f"kinetic and elastic: {end.total:.4g} J")
    record(f"{name}.rms", rms, note="particles' distance from there, in cells; at most "
           f"{most:.2g}; {end.cpu:.1f} CPU seconds, {end.iterations:.1f} outer iterations per step")


def record_agreement(run, ends, answer, scale):
    """Record the spread of kinetic energies over methods, by tolerance."""
    plain = {rule: end for rule, end in ends.items() if not rule.cells}
    for eps in sorted({rule.eps for rule in plain}, reverse=True):
        share = [end.kinetic / answer.kinetic for rule, end in plain.items() if rule.eps == eps]
        judged = eps <= CONVERGED
        rule = {"comparator": "<=", "bound": AGREE} if judged else {"comparator": "info"}
        run.record(f"trade.hot.energy.spread.eps{eps:.0e}".replace("e-0", "e-"),
                   max(share) - min(share), unit="1", scale=scale, **rule,
                   note="largest difference of the methods' kinetic energies, relative")
