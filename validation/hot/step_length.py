"""Iterations of HOT on the bar of Figure 20 by the length of its steps.

Numbers of a run of the authors' public code on this bar (30 720 particles, dx 0.015 m) have been
noted, but not its log: over 60 steps it took 2.5, 3.1 and 3.0 outer iterations a step for a middle
of 1e5, 1e7 and 1e9 Pa. The lengths of its steps are not among them, but energies of its converged
runs are: 0.849 J kinetic after 60 steps at 1e5 Pa, 1.264 J elastic after 40 steps at 1e9 Pa. When
our runs, of 46 080 particles and the printed tolerance, have these energies tells roughly how long
those steps were.
"""

from typing import NamedTuple

import numpy as np

from mpm_ref.energy import energy
from mpm_ref.scene import Solver, build
from mpm_ref.simulate import simulate

from ..common.registry import experiment
from ..common.scenes import particle_count, with_
from .stiffness import bar

MODULI = (1e5, 1e7, 1e9)                    # of the middle [Pa]
RATES = (96, 192, 240, 384)                 # steps in a second
STEPS = 60
SOFT = (1e5, "kinetic", 0.849, 60)          # modulus [Pa], energy [J] after so many steps of theirs
STIFF = (1e9, "elastic", 1.264, 40)
THEIRS = {1e5: 2.5, 1e7: 3.1, 1e9: 3.0}     # iterations a step of the authors' code
FREE = 10.0         # cfl that leaves the length of a step to `longest`


class BarRun(NamedTuple):
    """A run of the bar by steps of one length."""

    E: float                # of the middle [Pa]
    rate: int               # steps in a second
    iterations: np.ndarray  # (STEPS,) outer
    t: np.ndarray           # (STEPS,) [s]
    kinetic: np.ndarray     # (STEPS,) [J]
    elastic: np.ndarray     # (STEPS,) [J]
    converged: bool         # every step

    @property
    def mean(self):
        """Return the mean number of iterations of a step."""
        return float(self.iterations.mean())


def bar_run(E, rate, dx, steps):
    """Return the `BarRun` by the method as released, and the number of its particles."""
    scene = with_(bar(dx, E, "hot", steps), solver=Solver(as_released=True), longest=1.0 / rate,
                  cfl=FREE)
    problem, rows = build(scene), []

    def note(state, dt):
        q = energy(state.bodies, problem.gravity, problem.inertia)
        rows.append((state.solve.iterations, state.t, q.kinetic, q.elastic, state.solve.converged))

    for _ in simulate(problem, on_step=note):
        pass
    iterations, t, kinetic, elastic, converged = map(np.array, zip(*rows, strict=True))
    return BarRun(E, rate, iterations, t, kinetic, elastic,
                  bool(converged.all())), particle_count(problem.bodies)


def time_of(run, name, value):
    """Return the time [s] at which an energy of a `BarRun` first passes a value; NaN if never."""
    q = getattr(run, name)
    k = int(np.argmax(q >= value))
    if q[k] < value:
        return np.nan
    before = (0.0, 0.0) if k == 0 else (run.t[k - 1], q[k - 1])
    return float(np.interp(value, (before[1], q[k]), (before[0], run.t[k])))


@experiment("hot.step-length", title="The bar of Figure 20: iterations by the length of a step",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 400})
def step_length(run):
    """Record mean iterations at three moduli and some lengths of steps."""
    dx, rates, steps = run.choose(quick=(0.04, (96, 240), 8), standard=(0.015, RATES, STEPS))
    runs = {}
    for E, rate in run.progress([(E, rate) for E in MODULI for rate in rates], "runs"):
        runs[E, rate], particles = bar_run(E, rate, dx, steps)
    scale = f"{particles} particles, dx = {dx} m, {steps} steps, as released"
    for one in runs.values():
        run.record(f"hot.step-length.E{one.E:.0e}.rate{one.rate}".replace("+0", ""), one.mean,
                   unit="1", comparator="info", scale=scale,
                   note=f"outer iterations of a step of 1/{one.rate} s; the authors' code "
                   f"{THEIRS[one.E]:g}" + ("" if one.converged else "; not all steps converged"))
    stiff = [runs[MODULI[-1], rate].mean for rate in rates]
    run.record("hot.step-length.growth", stiff[0] / stiff[-1], unit="1", comparator=">=", bound=1.5,
               scale=scale, note=f"iterations at {MODULI[-1]:.0e} Pa of steps of 1/{rates[0]} s "
               f"over those of 1/{rates[-1]} s; the bound was set after a first result")
    record_implied_step(run, runs, rates, scale)
    run.table("steps", ("E", "rate", "t", "iterations", "kinetic", "elastic"),
              [(one.E, one.rate, *row) for one in runs.values()
               for row in zip(one.t, one.iterations, one.kinetic, one.elastic, strict=True)])


def record_implied_step(run, runs, rates, scale):
    """Record how long the authors' steps were by their energies, where our runs have them."""
    if run.profile == "quick":
        return
    for E, name, value, count in (SOFT, STIFF):
        times = [time_of(runs[E, rate], name, value) for rate in rates]
        implied = [t / count for t in times if np.isfinite(t)]
        if not implied:
            continue
        run.record(f"hot.step-length.implied.E{E:.0e}".replace("+0", ""),
                   float(np.median(implied)), unit="s", comparator="info", scale=scale,
                   note=f"length of the authors' steps, whose {name} energy is {value} J after "
                   f"{count} of them, by when ours is: "
                   + ", ".join(f"{one:.2g}" for one in implied))
