"""The implicit step over a run: first order in dt towards the explicit one, energy that only falls.

A free square of 0.8 m contracts along one axis and shears. Both integrators make the same number of
steps: every transfer smooths a little, so that runs of more steps do not converge to each other.
Then their difference is that of backward and symplectic Euler, of first order in dt.
"""

import numpy as np

from mpm_ref.core.state import NONE
from mpm_ref.energy import energy
from mpm_ref.explicit import Scheme, Stepper
from mpm_ref.hot.methods import options_of
from mpm_ref.hot.step import ImplicitStepper
from mpm_ref.materials import make_law

from ..registry import experiment
from .convergence import order, rms
from .lattice import body, lattice

E, NU, RHO0, DX, SIDE, END = 1e5, 0.3, 1000.0, 0.1, 0.8, 0.1
GRADIENT = np.array([[-2.0, 0.0], [1.5, 0.5]])      # of the initial velocity [1/s]
FREE = np.zeros(2)
D = DX**2 / 4.0                                     # of the affine motion
EPS = 1e-10                                         # tolerance of the implicit solves


def square():
    """The body at its start."""
    X = lattice([0.0, 0.0], [SIDE, SIDE], DX / 2)
    made = body(X, DX / 2, RHO0, make_law("fixed_corotated", E=E, nu=NU), "apic")
    made.particles.v[:] = (X - X.mean(axis=0)) @ GRADIENT.T
    return made._replace(particles=made.particles._replace(b=NONE))


def moved(stepper, steps):
    """Positions in the end, in the order of the start, and the energy after every step."""
    made = square()
    stepper.start([made])
    energies = [energy([made], FREE, D).sum]
    for k in range(steps):
        stepper.step([made], k * END / steps, END / steps)
        energies.append(energy([made], FREE, D).sum)
    return made.particles.x, np.array(energies)


def implicit(method="hot"):
    """A stepper that solves to EPS."""
    return ImplicitStepper(Scheme(transfer="apic"), DX, 2, FREE, None, options_of(method, eps=EPS))


@experiment("verification.implicit", title="Implicit steps: order in time, energy, one minimiser",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 60})
def verify(run):
    """Errors over time steps, energies, and the end states of all methods."""
    counts = run.choose(quick=(40, 80, 160), standard=(40, 80, 160, 320, 640))
    scale = f"2D, {len(square().id)} particles, {counts} steps"
    rows, errors = [], []
    for steps in run.progress(counts, "time steps"):
        x, energies = moved(implicit(), steps)
        errors.append(rms(x - moved(Stepper(Scheme(transfer="apic"), DX, 2, FREE), steps)[0]))
        rows.append((END / steps, errors[-1], energies[-1] / energies[0],
                     float(np.diff(energies).max() / energies[0])))
    run.record("verification.implicit.order", order([END / n for n in counts], errors), paper=1.0,
               comparator="band", bound=(0.8, 1.2), scale=scale,
               note="in dt, of the distance of the particles from those of the explicit run")
    run.record("verification.implicit.gained", max(r[3] for r in rows), comparator="<=",
               bound=1e-9, scale=scale, note="largest rise of the energy in a step, of the start's")
    run.table("errors", ("dt", "error", "energy_kept", "largest_rise"), rows)
    record_minimisers(run, counts[0])


def record_minimisers(run, steps):
    """How far apart the runs of different methods end."""
    x, _ = moved(implicit("pn-pcg"), steps)
    for method in ("hot", "hot-quadratic", "lbfgs-h", "pn-pcg-mf", "pn-mgpcg", "sgs-pcg"):
        other, _ = moved(implicit(method), steps)
        run.record(f"verification.implicit.{method}", float(np.abs(other - x).max() / DX),
                   unit="cells", comparator="<=", bound=1e-4, scale=f"{steps} steps, eps = {EPS:g}",
                   note="largest difference in position from the run with pn-pcg")
