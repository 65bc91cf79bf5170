"""Bars and beams: numerical fracture, where neighbours share no node any more, and locking of a
clamped beam at Poisson's ratios up to 0.4999.
"""

from math import pi, sqrt

import numpy as np

from mpm_ref.core.boundary import Conditions, Prescribed
from mpm_ref.core.levelset import box
from mpm_ref.core.motion import Motion, Steady
from mpm_ref.explicit import Scheme
from mpm_ref.materials import make_law

from ..common.registry import experiment
from ..verification.lattice import lattice
from .blocks import DX, RHO, block, fixed_clock, message_of, problem, step_limits
from .outcome import FINISHED, outcome

LENGTH = 1.0                # of the bar and of the beam
GRIP = 2.0 * DX             # length of the clamped ends
RATE = 1.0                  # speed of the moving grip [m/s]; waves run 37 m/s


class BarBroken(Exception):
    """Raised when neighbours of the bar share no node any more."""


@experiment("extremes.explicit.fracture", title="A bar stretched until its particles lose contact",
            profiles=("quick", "standard"), budget={"quick": 6, "standard": 60})
def fracture(run):
    """Measure the stretch at which the first particles lose contact."""
    cases = run.choose(quick=[("mls", 2, 2)], standard=[("mls", d, n) for d in (2, 3)
                                                        for n in (1, 2, 3)])
    table = []
    for transfer, degree, per in run.progress(cases, "bars"):
        rows, note = pull(transfer, degree, per)
        table += [(transfer, degree, per, *row) for row in rows]
        mean, local, gap, _ = rows[-1]
        name = f"extremes.explicit.fracture.{transfer}.{degree}.{per}"
        scale = f"2D bar of 8 x 2 cells, degree {degree}, {per} particles per cell and direction"
        run.record(f"{name}.local", local if gap > degree else np.nan, comparator="band",
                   bound=(degree * per, (degree + 1) * per), scale=scale,
                   note="distance over that at rest of the first two neighbours along the bar that "
                        "share no node: they are degree to degree + 1 cells apart, 1/per of a cell "
                        f"at first. {note}")
        run.record(f"{name}.mean", mean, comparator="info", scale=scale,
                   note="length of the free part of the bar over that at rest, at that moment: the "
                        "law itself has no limit of stretch")
    run.table("pull", ("transfer", "degree", "per", "mean", "local", "gap", "tau_xx"), table)


def pull(transfer, degree, per):
    """Return rows (mean stretch, stretch between the neighbours with the widest gap, cells between
    their base nodes, mean tau_xx) until the bar breaks, and a sentence on the end of the run.
    """
    spacing, scheme = DX / per, Scheme(degree, transfer)
    body = block(lattice([-GRIP, 0.0], [LENGTH + GRIP, 2 * DX], spacing), spacing,
                 transfer=transfer)
    fixed = Prescribed(box([-1e3, -1e3], [0.0, 1e3]))
    moving = Prescribed(box([LENGTH, -1e3], [1e3, 1e3]), Motion(Steady((RATE, 0.0))))
    dt = 0.25 * step_limits(body, DX, scheme).dt
    count, rows = int((degree + 1) * per * LENGTH / RATE / dt), []
    bar = problem(body, DX, fixed_clock(count, dt), scheme,
                  conditions=Conditions(prescribed=(fixed, moving)))

    def watch(state, dt):
        local, gap = widest_gap(state.bodies[0], spacing, degree)
        if state.step % 20 == 0 or gap > degree:
            tau = float(state.bodies[0].particles.tau[:, 0, 0].mean())
            rows.append((1.0 + RATE * state.t / LENGTH, local, gap, tau))
        if gap > degree:
            raise BarBroken

    try:
        end = outcome(bar, watch)
    except BarBroken:
        return rows, "The monitor broke no limit before."
    return rows, f"The run ended: {end.message or end.kind}"


def widest_gap(bar, spacing, degree):
    """Find the neighbours in the lowest row of particles with the most cells between their base
    nodes. Returns their distance over that at rest, and these cells.
    """
    order = np.argsort(bar.id)
    x = bar.particles.x[order].reshape(-1, round(2 * DX / spacing), 2)[:, 0, 0]
    gaps = np.diff(np.floor(x / DX - 0.5 * (degree - 1)))
    k = int(np.argmax(gaps))
    return float(x[k + 1] - x[k]) / spacing, int(gaps[k])


E, HEIGHT = 1e6, 0.25
GRAVITY = np.array([0.0, -0.5])         # a tip deflection of a per cent or two of the length
RATIOS = (0.3, 0.4, 0.45, 0.49, 0.499, 0.4999)
SHEAR = 5.0 / 6.0                       # of a rectangle, in Timoshenko's beam
LOCKED = 0.5                            # of the deflection at nu = 0.3: marked as locked


@experiment("extremes.explicit.locking", title="A clamped beam as it becomes incompressible",
            profiles=("quick", "standard"), budget={"quick": 5, "standard": 900})
def locking(run):
    """Compare the first swing of the tip with Timoshenko's beam in plane strain, over nu."""
    ratios = run.choose(quick=(0.3, 0.45, 0.49, 0.499, 0.4999), standard=RATIOS)
    meshes = run.choose(quick=((2, 2),), standard=((2, 2), (4, 2), (4, 3), (8, 2)))
    rows = []
    for layers, per in meshes:
        for nu in run.progress(ratios, f"{layers} cells, {per} per direction"):
            swing, end = deflect(nu, layers, per)
            rows.append((layers, per, nu, swing / (2.0 * timoshenko(nu)), end.kind, end.step,
                         end.message))
    run.table("curve", ("layers", "per_direction", "nu", "swing", "end", "steps", "message"), rows)
    record_curve(run, rows)
    refusal = message_of(lambda: make_law("fixed_corotated", E=E, nu=0.5))
    run.record("extremes.explicit.locking.refused", int(refusal != ""), paper=1, comparator="=",
               note=f"nu = 0.5 must be refused; message: {refusal}")


def record_curve(run, rows):
    """Record that all runs finish, and mark where the beam locks."""
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
    """Return the static tip deflection of the beam under its weight, in plane strain [m]."""
    stiff, mu = E / (1.0 - nu**2), E / (2.0 * (1.0 + nu))
    load = RHO * -GRAVITY[1] * HEIGHT
    bending = load * LENGTH**4 / (8.0 * stiff * HEIGHT**3 / 12.0)
    return bending + load * LENGTH**2 / (2.0 * SHEAR * mu * HEIGHT)


def deflect(nu, layers, per):
    """Return the largest sinking of the tip within 0.7 periods of the beam [m], and the
    `ExplicitOutcome`.
    """
    dx = HEIGHT / layers
    spacing = dx / per
    X = lattice([-2.0 * dx, 0.0], [LENGTH, HEIGHT], spacing)
    beam = block(X, spacing, make_law("fixed_corotated", E=E, nu=nu))
    clamp = Conditions(prescribed=(Prescribed(box([-1e3, -1e3], [0.0, 1e3])),))
    dt = 0.8 * step_limits(beam, dx).dt
    speed = sqrt(E / (1.0 - nu**2) / RHO)
    period = 2.0 * pi / (3.516 * speed * HEIGHT / sqrt(12.0) / LENGTH**2)
    tip, lowest = X[:, 0] > LENGTH - spacing, [0.0]

    def watch(state, dt):
        q = state.bodies[0]
        sunk = (X[q.id, 1] - q.particles.x[:, 1])[tip[q.id]]
        lowest[0] = max(lowest[0], float(sunk.mean()))

    clock = fixed_clock(int(0.7 * period / dt), dt)
    end = outcome(problem(beam, dx, clock, Scheme(), gravity=GRAVITY, conditions=clamp), watch)
    return lowest[0], end
