"""The implicit step over a run: first order in dt towards the explicit one, energy that only falls.

A free square of 0.8 m contracts along one axis and shears. Both integrators make the same number of
steps: every transfer smooths a little, so that runs of more steps do not converge to each other.
Then their difference is that of backward and symplectic Euler, of first order in dt.
"""

from typing import NamedTuple

import numpy as np

from mpm_ref.core.state import NONE
from mpm_ref.energy import energy
from mpm_ref.explicit import Scheme, Stepper
from mpm_ref.hot.methods import METHODS, options_of
from mpm_ref.hot.step import ImplicitStepper
from mpm_ref.materials import make_law

from ..common.registry import experiment
from ..common.scenes import threads_for
from .convergence import order, rms
from .lattice import body, lattice

E, NU, RHO0, DX, SIDE, END = 1e5, 0.3, 1000.0, 0.1, 0.8, 0.1
GRADIENT = np.array([[-2.0, 0.0], [1.5, 0.5]])      # of the initial velocity [1/s]
FREE = np.zeros(2)
D = DX**2 / 4.0                                     # of the affine motion
EPS = 1e-10                                         # tolerance of the implicit solves
METHODS_OF_ENERGY = ("hot", "hot-plus", "pn-pcg")   # whose energies must fall
REFERENCE = "pn-pcg"                                # whose end state the others must reach


class EnergyHistory(NamedTuple):
    """The end of a run, and its energy after every step."""

    x: np.ndarray           # (N, 2)        positions in the end, in the order of the start [m]
    energies: np.ndarray    # (steps + 1,)  before and after every step [J]
    missed: list            # reasons of solves that did not converge


def square():
    """Return the body at its start."""
    X = lattice([0.0, 0.0], [SIDE, SIDE], DX / 2)
    start = body(X, DX / 2, RHO0, make_law("fixed_corotated", E=E, nu=NU), "apic")
    start.particles.v[:] = (X - X.mean(axis=0)) @ GRADIENT.T
    return start._replace(particles=start.particles._replace(b=NONE))


def energy_history(stepper, steps):
    """Return the `EnergyHistory` of the square."""
    moving, missed = square(), []
    stepper.start([moving])
    energies = [energy([moving], FREE, D).sum]
    with threads_for([moving]):
        for k in range(steps):
            stepper.step([moving], k * END / steps, END / steps)
            energies.append(energy([moving], FREE, D).sum)
            if stepper.implicit and not stepper.report.converged:
                missed.append(stepper.report.message)
    return EnergyHistory(moving.particles.x, np.array(energies), missed)


def explicit():
    """Return the stepper to compare with."""
    return Stepper(Scheme(transfer="apic"), DX, 2, FREE)


def implicit(method="hot", **changes):
    """Return a stepper that solves to EPS in the characteristic norm."""
    options = options_of(method, **{"eps": EPS, "norm": "characteristic", **changes})
    return ImplicitStepper(Scheme(transfer="apic"), DX, 2, FREE, None, options)


@experiment("verification.implicit", title="Implicit steps: order in time, energy, one minimiser",
            profiles=("quick", "standard"), budget={"quick": 45, "standard": 90})
def implicit_steps(run):
    """Record errors over time steps, energies, and the end states of all methods."""
    counts = run.choose(quick=(40, 80, 160), standard=(40, 80, 160, 320, 640))
    scale = f"2D, {len(square().id)} particles, {counts} steps"
    histories = {method: [energy_history(implicit(method), n) for n in run.progress(counts, method)]
                 for method in METHODS_OF_ENERGY}
    record_order(run, counts, histories["hot"], scale)
    for method, runs in histories.items():
        record_energy(run, method, runs, scale)
    firsts = {method: runs[0] for method, runs in histories.items()}
    record_minimisers(run, counts[0], firsts)


def record_order(run, counts, histories, scale):
    """Record the order in dt of the distance of HOT's runs from explicit ones of as many steps."""
    steps = [END / n for n in counts]
    errors = [rms(history.x - energy_history(explicit(), n).x)
              for n, history in zip(counts, histories, strict=True)]
    run.record("verification.implicit.order", order(steps, errors), paper=1.0,
               comparator="band", bound=(0.8, 1.2), scale=scale,
               note="in dt, of the distance of the particles from those of the explicit run")
    rows = [(dt, error, history.energies[-1] / history.energies[0], rise(history))
            for dt, error, history in zip(steps, errors, histories, strict=True)]
    run.table("errors", ("dt", "error", "energy_kept", "largest_rise"), rows)


def rise(history):
    """Return the largest rise of the energy in a step over its start; below 0 if all fall."""
    return float(np.diff(history.energies).max() / history.energies[0])


def record_energy(run, method, histories, scale):
    """Record the largest rise of the energy in the steps of a method's runs."""
    target = "verification.implicit.gained" + ("" if method == "hot" else f".{method}")
    run.record(target, max(rise(history) for history in histories), comparator="<=", bound=1e-9,
               scale=scale, note="largest rise of the energy in a step, of the start's")


def record_minimisers(run, steps, first_runs):
    """Record how far the runs of other methods end from that of REFERENCE.

    Solves that did not converge are recorded as well. first_runs: {method: history} of runs of
    `steps` steps that were made before; REFERENCE must be one of them.
    """
    scale = f"{steps} steps, eps = {EPS:g}"
    one = first_runs[REFERENCE]
    others = {method: first_runs.get(method) or energy_history(implicit(method), steps)
              for method in METHODS if method != REFERENCE}
    missed = [f"{method}: {why}" for method, history in {REFERENCE: one, **others}.items()
              for why in history.missed]
    run.record("verification.implicit.missed", len(missed), paper=0, comparator="=", scale=scale,
               note="; ".join((f"solves that did not converge, of {len(METHODS)} methods",
                               *missed[:2])))
    for method, history in others.items():
        run.record(f"verification.implicit.{method}",
                   float(np.abs(history.x - one.x).max() / DX),
                   unit="cells", comparator="<=", bound=1e-4, scale=scale,
                   note=f"largest difference in position from the run with {REFERENCE}")
