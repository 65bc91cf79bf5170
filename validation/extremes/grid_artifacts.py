"""Artifacts of the grid: nodes with hardly any mass, contact of bodies of very different mass and
stiffness, and particle velocities that map to no grid velocity.
"""

import numpy as np

from mpm_ref.energy import energy
from mpm_ref.explicit import Scheme
from mpm_ref.materials import make_law

from ..common.registry import experiment
from ..verification.lattice import Periodic, lattice
from .blocks import (
    DX,
    NO_GRAVITY,
    NU,
    RHO,
    E,
    block,
    fixed_clock,
    one_particle,
    problem,
    square,
    step_limits,
)
from .long_runs import conserved_energy
from .outcome import FINISHED, REFUSED, outcome

SLIVER = 1e-12          # of a cell: how far the particle reaches into the support of its last nodes
GRAVITY = np.array([0.0, -9.8])


@experiment("extremes.explicit.tiny_node", title="A particle 1e-12 of a cell inside a cell",
            profiles=("quick", "standard"), budget={"quick": 2, "standard": 20})
def tiny_node(run):
    """Check that no particle becomes faster than its initial velocity and gravity make it."""
    count, rows = 100, []
    cases = run.choose(quick=[("mls", 2), ("apic", 2), ("flip", 2), ("pic", 2)],
                       standard=[(t, d) for t in ("mls", "apic", "flip", "pic") for d in (2, 3)])
    for transfer, degree in cases:
        fastest, end = fall_of_particle(transfer, degree, count)
        rows.append((transfer, degree, least_mass(degree), fastest, end.kind, end.message))
        run.record(f"extremes.explicit.tiny_node.{transfer}.{degree}",
                   fastest if end.kind == FINISHED else np.inf, comparator="<=", bound=1.0 + 1e-9,
                   scale=f"one particle at rest at 1e-12 of a cell, prestretched, {count} steps",
                   note="largest speed over (initial speed + t g); the lightest node has "
                        f"{least_mass(degree):.1e} of the particle's mass")
    for transfer in run.choose(quick=(), standard=("flip", "pic")):
        _, end = fall_of_particle(transfer, 1, count, allowed=False)
        run.record(f"extremes.explicit.tiny_node.{transfer}.1",
                   int(end.kind == REFUSED and end.step == 0), paper=1, comparator="=",
                   scale="one particle at 1e-12 of a cell, prestretched, linear splines",
                   note="negative control: |dw|/w of a linear spline is without bound, so that the "
                        f"same run must be refused; message: {end.message or end.kind}")
    run.table("runs", ("transfer", "degree", "least_mass", "speed", "end", "message"), rows)


def least_mass(degree):
    """Return the weight of the lightest node: (s^degree/degree!) per axis."""
    return (SLIVER**degree / np.prod(np.arange(1, degree + 1))) ** 2


def fall_of_particle(transfer, degree, count, allowed=True):
    """Return the largest speed of a stretched falling particle over that of free fall, and the
    `ExplicitOutcome`.
    """
    scheme, v0 = Scheme(degree, transfer), 1e-3
    edge = 3.5 if degree == 2 else 3.0          # where the supports of quadratic splines end
    body = one_particle([(edge + SLIVER) * DX] * 2, DX, transfer=transfer)
    body.particles.v[:] = (v0, 0.0)
    body.particles.F[:] *= 1.001
    worst = [0.0]

    def watch(state, dt):
        speed = float(np.linalg.norm(state.bodies[0].particles.v[0]))
        worst[0] = max(worst[0], speed / (v0 + 9.8 * state.t))

    dt = 1e-3 * step_limits(body, DX, scheme).elastic
    end = outcome(problem(body, DX, fixed_clock(count, dt), scheme, gravity=GRAVITY,
                          allow_unstable=allowed), watch)
    return worst[0], end


# Two blocks that run into each other, as (E, density) of either [Pa, kg/m^3].
PAIRS = {"mass": ((E, RHO), (E, 1e6 * RHO)), "stiffness": ((1e3, RHO), (1e9, RHO))}
SPEED, GAP = 0.5, 0.02              # [m/s], [m]; matter meets on the grid at a gap of a cell


@experiment("extremes.explicit.contact", title="Contact at mass and stiffness ratios of 1e6",
            profiles=("quick", "standard"), budget={"quick": 5, "standard": 60})
def contact(run):
    """Check that energy grows by no more than 1 % in the contact."""
    cells = run.choose(quick=4, standard=16)
    table = []
    for name in PAIRS:
        for transfer in run.choose(quick=("mls",), standard=("mls", "apic", "flip", "pic")):
            end, rows = collide(*PAIRS[name], cells, transfer)
            table += [(name, transfer, *row) for row in rows]
            _, H, conserved = np.array([(0.0, 1.0, 1.0), *rows]).T
            run.record(f"extremes.explicit.contact.{name}.{transfer}",
                       rise(conserved) if end.kind == FINISHED else np.inf, comparator="<=",
                       bound=0.01, scale=f"2D, two blocks of {cells} x {cells} cells, {end.step} "
                       "steps at half the bound",
                       note="largest rise above an earlier value, over the initial one (facts: "
                            "1 %), of the energy without symplectic Euler's swing. Energy itself "
                            f"rises by {rise(H):.2g}; a quarter of the bound makes that a third "
                            "(0.027, 0.008 for the mass ratio on 16 x 16 cells). MPM's "
                            f"contact is inelastic. The run ended: {end.message or end.kind}")
    run.table("energy", ("pair", "transfer", "t", "energy", "kept"), table[::20])


def rise(E):
    """Return the largest rise above an earlier value."""
    return float(np.max(E - np.minimum.accumulate(E)))


def collide(left, right, cells, transfer):
    """Return the `ExplicitOutcome` of a block that runs into one at rest, and rows (t, energy,
    conserved energy), both over the initial energy.
    """
    scheme, dx = Scheme(2, transfer), DX * 4.0 / cells
    X = lattice([0.0, 0.0], [0.5, 0.5], 0.5 * dx)
    laws = [make_law("fixed_corotated", E=E_, nu=NU) for E_, _ in (left, right)]
    bodies = tuple(block(X + shift, 0.5 * dx, law, rho, transfer) for law, (_, rho), shift in
                   zip(laws, (left, right), ([0.0, 0.0], [0.5 + GAP, 0.0]), strict=True))
    bodies = tuple(b._replace(name=n) for b, n in zip(bodies, ("left", "right"), strict=True))
    bodies[0].particles.v[:, 0] = SPEED
    dt = 0.5 * step_limits(bodies, dx, scheme).dt
    contact_problem, rows = problem(bodies, dx, fixed_clock(int(0.3 / dt), dt), scheme), []
    first = energy(bodies, NO_GRAVITY, contact_problem.inertia).sum

    def watch(state, dt):
        if state.step % 10 == 0:
            H = energy(state.bodies, NO_GRAVITY, contact_problem.inertia).sum
            conserved = conserved_energy(state.bodies, dt, contact_problem.inertia)
            rows.append((state.t, H / first, conserved / first))

    return outcome(contact_problem, watch), rows


CELLS = 4


@experiment("extremes.explicit.null_mode", title="The checkerboard that maps to no grid velocity",
            profiles=("quick", "standard"), budget={"quick": 2, "standard": 5})
def null_mode(run):
    """Check that PIC, APIC and MLS damp it in one step, and that FLIP keeps it."""
    count = run.choose(quick=200, standard=5000)
    scale = f"2D, periodic, {CELLS} x {CELLS} cells, 4 particles each, quadratic"
    for transfer in ("pic", "apic", "mls"):
        run.record(f"extremes.explicit.null_mode.{transfer}", remaining_speed(transfer, 1),
                   comparator="<=", bound=1e-14, scale=f"{scale}, 1 step",
                   note="remaining over initial largest speed; calibrated: 0 to 1e-16")
    run.record("extremes.explicit.null_mode.flip", remaining_speed("flip", count),
               comparator="band", bound=(1.0 - 1e-12, 1.0 + 1e-12), scale=f"{scale}, {count} steps",
               note="negative control: FLIP keeps velocities that no node sees")
    run.record("extremes.explicit.null_mode.flip95", remaining_speed("flip", 200, 0.95),
               comparator="<=", bound=2.0 * 0.95**200, scale=f"{scale}, 200 steps, flip = 0.95",
               note="a share of 5 % PIC damps it by 0.95 in every step")


def remaining_speed(transfer, count, flip=1.0):
    """Return the largest speed after `count` steps, over the initial one."""
    body = square(CELLS, DX, transfer=transfer)
    k = np.rint(body.particles.x / (0.5 * DX) - 0.5).sum(axis=1)
    body.particles.v[:, 0] = 0.1 * (-1.0) ** k
    scheme = Scheme(2, transfer, flip=flip)
    dt = 0.5 * step_limits(body, DX, scheme).dt
    end = outcome(problem(body, DX, fixed_clock(count, dt), scheme,
                          conditions=Periodic([CELLS] * 2)))
    speed = float(np.max(np.abs(body.particles.v))) / 0.1
    return speed if end.step == count else np.nan
