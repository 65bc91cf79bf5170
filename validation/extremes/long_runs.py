"""Round-off in long runs: energy of oscillators with states in double and in single precision, free
flight over many cells, and runs far from the origin.
"""

import numpy as np

from mpm_ref.energy import energy, momentum
from mpm_ref.explicit import Scheme

from ..common.registry import experiment
from ..verification.convergence import rms
from .blocks import DX, NO_GRAVITY, fixed_clock, one_particle, problem, shake, square, step_limits
from .outcome import FINISHED, OUT_OF_RANGE, STOPS, outcome

STRAIN = 0.01
POINTS = 400            # of the curve
SWING = 25              # steps over which the energy, conserved to first order, is averaged
CARRIED = ("x", "v", "C", "L", "F", "tau")


def round_state(bodies):
    """Round the state that particles carry between steps to single precision, in place. The kernels
    themselves compute in double precision.
    """
    for body in bodies:
        for name in CARRIED:
            a = getattr(body.particles, name)
            a[...] = a.astype(np.float32)


def conserved_energy(bodies, dt, inertia):
    """Return H - (dt/2) dU/dt [J], which symplectic Euler conserves while H itself swings."""
    power = sum(np.einsum("p,pab,pab->", b.particles.V0, b.particles.tau, b.particles.L)
                for b in bodies)
    return energy(bodies, NO_GRAVITY, inertia).sum - 0.5 * dt * power


class Oscillator:
    """A body stretched by 1 %, its scheme, and its time step."""

    def __init__(self, what, transfer):
        self.scheme = Scheme(2, transfer)
        make = {"one": lambda: one_particle([0.55, 0.55], DX, transfer=transfer),
                "block": lambda: square(4, DX, transfer=transfer)}[what]
        self.body = make()
        self.body.particles.F[:] *= 1.0 + STRAIN
        self.dt = 0.5 * step_limits(self.body, DX, self.scheme).dt

    def curve(self, count, single=False):
        """Return the `ExplicitOutcome`, and rows (step, mean conserved energy over SWING steps)."""
        sums, rows, every = [], [], max(count // POINTS, SWING)
        oscillation = problem(self.body, DX, fixed_clock(count, self.dt), self.scheme)

        def watch(state, dt):
            if single:
                round_state(state.bodies)
            if state.step % every < SWING:
                sums.append(conserved_energy(state.bodies, dt, oscillation.inertia))
            if state.step % every == SWING - 1:
                rows.append((state.step, float(np.mean(sums))))
                sums.clear()

        return outcome(oscillation, watch), rows


@experiment("extremes.explicit.long_run", title="Energy drift of oscillators over a long run",
            profiles=("quick", "standard"), budget={"quick": 4, "standard": 900})
def long_run(run):
    """Run one particle, which nothing damps, and a block, in both precisions of the state."""
    counts = {"one": run.choose(quick=10000, standard=1000000), "block": 100000}
    cases = [("one", "mls", False), ("one", "mls", True)]
    cases += run.choose(quick=[], standard=[("block", t, single) for t in ("mls", "flip")
                                            for single in (False, True)])
    table = []
    for what, transfer, single in run.progress(cases, "runs"):
        count = counts[what]
        end, rows = Oscillator(what, transfer).curve(count, single)
        name = f"{what}.{transfer}.{'f32' if single else 'f64'}"
        table += [(name, step, E / rows[0][1]) for step, E in rows]
        record_drift(run, name, end, rows, f"{what}, {transfer}, {count} steps at half the bound")
    run.table("energy", ("run", "step", "kept"), table)


def record_drift(run, name, end, rows, scale):
    """Record the change of the mean energy from the first to the last tenth of a run."""
    E = np.array([e for _, e in rows])
    tenth = max(len(E) // 10, 1)
    drift = E[-tenth:].mean() / E[:tenth].mean() - 1.0
    value = abs(drift) if end.kind == FINISHED else np.inf
    if name == "one.mls.f64":
        run.record(f"extremes.explicit.long_run.{name}", value, comparator="<=", bound=1e-4,
                   scale=scale, note="a single particle is one spring, integrated by "
                   "symplectic Euler: no drift. Calibrated: 3e-6 in 1e4 steps")
    else:
        run.record(f"extremes.explicit.long_run.{name}", drift, comparator="info", scale=scale,
                   note=f"relative change of the mean energy; ended: {end.kind}")


DISTANCE = 100                           # cells
VELOCITY = np.array([1.0, 0.37])    # [m/s]


@experiment("extremes.explicit.free_flight", title="Free flight over 100 cells",
            profiles=("quick", "standard"), budget={"quick": 5, "standard": 60})
def free_flight(run):
    """Measure momentum and position after 1e4 steps without force."""
    count = 10000
    cases = run.choose(quick=[("mls", "block"), ("apic", "one")],
                       standard=[(t, w) for t in ("mls", "apic", "flip", "pic")
                                 for w in ("one", "block")])
    for transfer, what in run.progress(cases, "flights"):
        drift, away, end = fly(transfer, what, count)
        name = f"extremes.explicit.free_flight.{transfer}.{what}"
        scale = f"{count} steps, {DISTANCE} cells"
        run.record(f"{name}.momentum", drift if end.kind == FINISHED else np.inf, comparator="<=",
                   bound=1e-13, scale=scale, note="largest change of momentum over the momentum. "
                   "Calibrated: 1e-15 to 2e-14; 1e4 roundings that add up would be 1e-12")
        run.record(f"{name}.position", away, comparator="<=", bound=1e-12, scale=scale,
                   note="RMS distance from the exact positions, over the distance flown. "
                        "Calibrated: 1.6e-13")


def fly(transfer, what, count):
    """Return the change of momentum, the error of position over the distance flown, and the
    `ExplicitOutcome` of a flight.
    """
    body = one_particle([0.3, 0.7], DX, transfer=transfer) if what == "one" else square(
        4, DX, transfer=transfer)
    q = body.particles
    q.v[:] = VELOCITY
    start, p0 = q.x.copy(), momentum((body,))
    dt = DISTANCE * DX / VELOCITY[0] / count
    end = outcome(problem(body, DX, fixed_clock(count, dt), Scheme(2, transfer),
                          allow_unstable=True))
    order = np.argsort(body.id)
    error = rms(q.x[order] - start - count * dt * VELOCITY)
    drift = np.max(np.abs(momentum((body,)) - p0)) / np.linalg.norm(p0)
    return float(drift), error / (DISTANCE * DX), end


FAR = (0, 1, 4, 8, 12)              # powers of ten, in cells from the origin
COMPANY = 6             # power of ten, in cells from a block to another one
TOO_FAR = 17            # power of ten at which a cell is smaller than the gap between two doubles


@experiment("extremes.explicit.far_from_origin", title="The same run far from the origin",
            profiles=("quick", "standard"), budget={"quick": 4, "standard": 20})
def far_from_origin(run):
    """Compare a shaken block shifted by 10^k cells with the one at the origin, and this one with
    itself where another block is far away.
    """
    count = run.choose(quick=200, standard=2000)
    near, rows = final_velocities(0.0, count), []
    for k in FAR[1:]:
        far = final_velocities(10.0**k, count)
        error = rms(far - near) / rms(near)
        rows.append((10.0**k, error, float(np.finfo(float).eps * 10.0**k)))
        run.record(f"extremes.explicit.far_from_origin.1e{k}", error, comparator="<=",
                   bound=rounding_bound(k), scale=f"4 x 4 cells, {count} steps",
                   note="RMS change of the velocities over their RMS. A position is rounded to "
                        "eps 10^k cells; calibrated: 2.5 to 200 times that")
    run.table("error", ("cells", "error", "rounding"), rows)
    both = final_velocities(0.0, count, shifted_block(10.0**COMPANY)._replace(name="company"))
    run.record("extremes.explicit.far_from_origin.company", rms(both - near) / rms(near),
               comparator="<=", bound=0.0, scale=f"4 x 4 cells, {count} steps",
               note="RMS change of the velocities of the block at the origin over their RMS, where "
                    f"another one is 10^{COMPANY} cells away along both axes: none, as the grid of "
                    "each has its own nodes and sums")
    body = shifted_block(10.0**TOO_FAR)
    end = outcome(problem(body, DX, fixed_clock(10, 1e-3)))
    run.record("extremes.explicit.far_from_origin.beyond", int(end.kind in (*STOPS, OUT_OF_RANGE)),
               paper=1, comparator="=", scale=f"10^{TOO_FAR} cells from the origin",
               note=f"1 if it is refused; message: {end.message}")


def rounding_bound(k):
    """Return a hundred times the rounding of a position at 10^k cells, in cells."""
    return 100.0 * np.finfo(float).eps * 10.0**k


def shifted_block(cells):
    """Return a shaken block at a distance from the origin along both axes."""
    body = shake(square(4, DX))
    body.particles.x[:] += cells * DX
    return body


def final_velocities(cells, count, *others):
    """Return the velocities (N, d) of the block after some steps, in the order of sampling; other
    bodies are stepped with it.
    """
    body = shifted_block(cells)
    dt = 0.5 * step_limits(shifted_block(0.0), DX).dt
    end = outcome(problem((body, *others), DX, fixed_clock(count, dt)))
    if end.kind != FINISHED:
        return np.full_like(body.particles.v, np.nan)
    return body.particles.v[np.argsort(body.id)]
