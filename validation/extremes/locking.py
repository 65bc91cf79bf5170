"""Locking: a clamped beam under its weight at Poisson's ratios up to 0.4999."""

from math import pi, sqrt

import numpy as np

from mpm_ref.core.boundary import Conditions, Prescribed
from mpm_ref.core.levelset import box
from mpm_ref.explicit import Scheme
from mpm_ref.materials import make_law

from ..common.registry import experiment
from ..verification.lattice import lattice
from .blocks import RHO, block, bounds, problem, steps
from .outcome import FINISHED, outcome

E, LENGTH, HEIGHT = 1e6, 1.0, 0.25
GRAVITY = np.array([0.0, -0.5])         # a tip deflection of a per cent or two of the length
RATIOS = (0.3, 0.4, 0.45, 0.49, 0.499, 0.4999)
SHEAR = 5.0 / 6.0                       # of a rectangle, in Timoshenko's beam
LOCKED = 0.5                            # of the deflection at nu = 0.3: marked as locked


@experiment("extremes.explicit.locking", title="A clamped beam as it becomes incompressible",
            profiles=("quick", "standard"), budget={"quick": 5, "standard": 900})
def locking(run):
    """First swing of the tip against Timoshenko's beam in plane strain, over nu."""
    ratios = run.choose(quick=(0.3, 0.45, 0.49, 0.499, 0.4999), standard=RATIOS)
    meshes = run.choose(quick=((2, 2),), standard=((2, 2), (4, 2), (4, 3), (8, 2)))
    rows = []
    for layers, per in meshes:
        for nu in run.progress(ratios, f"{layers} cells, {per} per direction"):
            swing, end = deflect(nu, layers, per)
            rows.append((layers, per, nu, swing / (2.0 * timoshenko(nu)), end.kind, end.step,
                         end.said))
    run.table("curve", ("layers", "per_direction", "nu", "swing", "end", "steps", "said"), rows)
    record_curve(run, rows)
    refusal = refused()
    run.record("extremes.explicit.locking.refused", int(refusal != ""), paper=1, comparator="=",
               note=f"nu = 0.5 must be refused; it said: {refusal}")


def record_curve(run, rows):
    """All runs end; where the beam locks is marked, not judged."""
    run.record("extremes.explicit.locking.finished",
               sum(row[4] == FINISHED for row in rows) / len(rows), paper=1.0, comparator="=",
               scale=f"{len(rows)} runs to nu = {max(row[2] for row in rows)}",
               note="share of the runs that reached their end, with finite positions")
    layers, per = rows[0][:2]
    curve = {row[2]: row[3] for row in rows if row[:2] == (layers, per)}
    for nu, swing in curve.items():
        relative = swing / curve[0.3]
        mark = "LOCKED: " if relative < LOCKED else ""
        run.record(f"extremes.explicit.locking.{nu:g}", relative, comparator="info",
                   scale=f"{layers} quadratic cells over the height, {per} per direction, MLS",
                   note=f"{mark}first swing over twice Timoshenko's deflection, over that at 0.3")


def timoshenko(nu):
    """Static tip deflection of the clamped beam under its weight, in plane strain [m]."""
    stiff, mu = E / (1.0 - nu**2), E / (2.0 * (1.0 + nu))
    load = RHO * -GRAVITY[1] * HEIGHT
    bending = load * LENGTH**4 / (8.0 * stiff * HEIGHT**3 / 12.0)
    return bending + load * LENGTH**2 / (2.0 * SHEAR * mu * HEIGHT)


def deflect(nu, layers, per):
    """Largest sinking of the tip within 0.7 periods of the beam [m], and the `Outcome`."""
    dx = HEIGHT / layers
    spacing = dx / per
    X = lattice([-2.0 * dx, 0.0], [LENGTH, HEIGHT], spacing)
    beam = block(X, spacing, make_law("fixed_corotated", E=E, nu=nu))
    clamp = Conditions(prescribed=(Prescribed(box([-1e3, -1e3], [0.0, 1e3])),))
    dt = 0.8 * bounds(beam, dx).dt
    speed = sqrt(E / (1.0 - nu**2) / RHO)
    period = 2.0 * pi / (3.516 * speed * HEIGHT / sqrt(12.0) / LENGTH**2)
    tip, lowest = X[:, 0] > LENGTH - spacing, [0.0]

    def watch(state, dt):
        q = state.bodies[0]
        sunk = (X[q.id, 1] - q.particles.x[:, 1])[tip[q.id]]
        lowest[0] = max(lowest[0], float(sunk.mean()))

    end = outcome(problem(beam, dx, steps(int(0.7 * period / dt), dt), Scheme(), gravity=GRAVITY,
                          conditions=clamp), watch)
    return lowest[0], end


def refused():
    """What the law says to nu = 0.5."""
    try:
        make_law("fixed_corotated", E=E, nu=0.5)
    except ValueError as error:
        return str(error)
    return ""
