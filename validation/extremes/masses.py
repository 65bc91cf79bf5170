"""Nodes with hardly any mass, and bodies of very different mass and stiffness in contact."""

import numpy as np

from mpm_ref.energy import energy
from mpm_ref.explicit import Scheme
from mpm_ref.materials import make_law

from ..common.registry import experiment
from ..verification.lattice import lattice
from .blocks import NU, RHO, STILL, E, alone, block, bounds, problem, steps
from .long_run import kept
from .outcome import FINISHED, REFUSED, outcome

DX = 0.125
SLIVER = 1e-12          # of a cell: how far the particle reaches into the support of its last nodes
GRAVITY = np.array([0.0, -9.8])


@experiment("extremes.explicit.tiny_node", title="A particle 1e-12 of a cell inside a cell",
            profiles=("quick", "standard"), budget={"quick": 2, "standard": 20})
def tiny_node(run):
    """No particle becomes faster than it was thrown and gravity makes it."""
    count, rows = 100, []
    cases = run.choose(quick=[("mls", 2), ("apic", 2), ("flip", 2), ("pic", 2)],
                       standard=[(t, d) for t in ("mls", "apic", "flip", "pic") for d in (2, 3)])
    for transfer, degree in cases:
        fastest, end = throw(transfer, degree, count)
        rows.append((transfer, degree, least_mass(degree), fastest, end.kind, end.said))
        run.record(f"extremes.explicit.tiny_node.{transfer}.{degree}",
                   fastest if end.kind == FINISHED else np.inf, comparator="<=", bound=1.0 + 1e-9,
                   scale=f"one particle at rest at 1e-12 of a cell, prestretched, {count} steps",
                   note="largest speed over (speed at first + t g); the lightest node has "
                        f"{least_mass(degree):.1e} of the particle's mass")
    for transfer in run.choose(quick=(), standard=("flip", "pic")):
        _, end = throw(transfer, 1, count, allowed=False)
        run.record(f"extremes.explicit.tiny_node.{transfer}.1",
                   int(end.kind == REFUSED and end.step == 0), paper=1, comparator="=",
                   scale="one particle at 1e-12 of a cell, prestretched, linear splines",
                   note="negative control: |dw|/w of a linear spline is without bound, so that the "
                        f"same run must be refused; it said: {end.said or end.kind}")
    run.table("runs", ("transfer", "degree", "least_mass", "speed", "end", "said"), rows)


def least_mass(degree):
    """Weight of the lightest node: (s^degree/degree!) per axis."""
    return (SLIVER**degree / np.prod(np.arange(1, degree + 1))) ** 2


def throw(transfer, degree, count, allowed=True):
    """(largest speed over what gravity allows, `Outcome`) of a stretched particle that falls."""
    scheme, v0 = Scheme(degree, transfer), 1e-3
    edge = 3.5 if degree == 2 else 3.0          # where the supports of quadratic splines end
    made = alone([(edge + SLIVER) * DX] * 2, DX, transfer=transfer)
    made.particles.v[:] = (v0, 0.0)
    made.particles.F[:] *= 1.001
    worst = [0.0]

    def watch(state, dt):
        speed = float(np.linalg.norm(state.bodies[0].particles.v[0]))
        worst[0] = max(worst[0], speed / (v0 + 9.8 * state.t))

    dt = 1e-3 * bounds(made, DX, scheme).elastic
    end = outcome(problem(made, DX, steps(count, dt), scheme, gravity=GRAVITY,
                          allow_unstable=allowed), watch)
    return worst[0], end


# Two blocks that run into each other, as (E, density) of either [Pa, kg/m^2].
PAIRS = {"mass": ((E, RHO), (E, 1e6 * RHO)), "stiffness": ((1e3, RHO), (1e9, RHO))}
SPEED, GAP = 0.5, 0.02              # [m/s], [m]; matter meets on the grid at a gap of a cell


@experiment("extremes.explicit.contact", title="Contact at mass and stiffness ratios of 1e6",
            profiles=("quick", "standard"), budget={"quick": 5, "standard": 60})
def contact(run):
    """Energy must not grow by more than 1 % in the contact."""
    cells = run.choose(quick=4, standard=16)
    table = []
    for name in PAIRS:
        for transfer in run.choose(quick=("mls",), standard=("mls", "apic", "flip", "pic")):
            end, rows = meet(*PAIRS[name], cells, transfer)
            table += [(name, transfer, *row) for row in rows]
            _, H, kept_ = np.array([(0.0, 1.0, 1.0), *rows]).T
            run.record(f"extremes.explicit.contact.{name}.{transfer}",
                       rise(kept_) if end.kind == FINISHED else np.inf, comparator="<=",
                       bound=0.01, scale=f"2D, two blocks of {cells} x {cells} cells, {end.step} "
                       "steps at half the bound",
                       note="largest rise above an earlier value, over the first one (facts: 1 %), "
                            "of the energy without symplectic Euler's swing. Energy itself "
                            f"rises by {rise(H):.2g}; a quarter of the bound makes that a third "
                            "(0.027, 0.008 for the mass ratio on 16 x 16 cells). MPM's "
                            f"contact is inelastic. The run ended: {end.said or end.kind}")
    run.table("energy", ("pair", "transfer", "t", "energy", "kept"), table[::20])


def rise(E):
    """Largest rise above an earlier value."""
    return float(np.max(E - np.minimum.accumulate(E)))


def meet(left, right, cells, transfer):
    """`Outcome` of a block that runs into one at rest, and rows (t, energy, what symplectic Euler
    keeps of it), both over the first energy.
    """
    scheme, dx = Scheme(2, transfer), DX * 4.0 / cells
    X = lattice([0.0, 0.0], [0.5, 0.5], 0.5 * dx)
    laws = [make_law("fixed_corotated", E=E_, nu=NU) for E_, _ in (left, right)]
    bodies = tuple(block(X + shift, 0.5 * dx, law, rho, transfer) for law, (_, rho), shift in
                   zip(laws, (left, right), ([0.0, 0.0], [0.5 + GAP, 0.0]), strict=True))
    bodies = tuple(b._replace(name=n) for b, n in zip(bodies, ("left", "right"), strict=True))
    bodies[0].particles.v[:, 0] = SPEED
    dt = 0.5 * bounds(bodies, dx, scheme).dt
    run_, rows = problem(bodies, dx, steps(int(0.3 / dt), dt), scheme), []
    first = energy(bodies, STILL, run_.inertia).sum

    def watch(state, dt):
        if state.step % 10 == 0:
            H = energy(state.bodies, STILL, run_.inertia).sum
            rows.append((state.t, H / first, kept(state.bodies, dt, run_.inertia) / first))

    return outcome(run_, watch), rows
