"""Energy over a long run of oscillators, with states kept in double and in single precision."""

import numpy as np

from mpm_ref.energy import energy
from mpm_ref.explicit import Scheme

from ..common.registry import experiment
from .blocks import STILL, alone, bounds, problem, square, steps
from .outcome import FINISHED, outcome

DX = 0.125
STRAIN = 0.01
POINTS = 400            # of the curve
SWING = 25              # steps over which each is averaged: what is kept only to first order swings
CARRIED = ("x", "v", "C", "L", "F", "tau")


def round_state(bodies):
    """Round what particles carry from step to step to single precision, in place: a state stored in
    32 bits. The kernels themselves compute in 64.
    """
    for body in bodies:
        for name in CARRIED:
            a = getattr(body.particles, name)
            a[...] = a.astype(np.float32)


def kept(bodies, dt, inertia):
    """H - (dt/2) dU/dt [J]: what symplectic Euler keeps of a vibration, while H itself swings."""
    power = sum(np.einsum("p,pab,pab->", b.particles.V0, b.particles.tau, b.particles.L)
                for b in bodies)
    return energy(bodies, STILL, inertia).sum - 0.5 * dt * power


class Oscillator:
    """A body stretched by 1 %, its scheme, and the step with which it runs."""

    def __init__(self, what, transfer):
        self.scheme = Scheme(2, transfer)
        make = {"one": lambda: alone([0.55, 0.55], DX, transfer=transfer),
                "block": lambda: square(4, DX, transfer=transfer)}[what]
        self.body = make()
        self.body.particles.F[:] *= 1.0 + STRAIN
        self.dt = 0.5 * bounds(self.body, DX, self.scheme).dt

    def curve(self, count, single=False):
        """`Outcome`, and rows (step, mean of `kept` over the first steps after the last row)."""
        sums, rows, every = [], [], max(count // POINTS, SWING)
        problem_ = problem(self.body, DX, steps(count, self.dt), self.scheme)

        def watch(state, dt):
            if single:
                round_state(state.bodies)
            if state.step % every < SWING:
                sums.append(kept(state.bodies, dt, problem_.inertia))
            if state.step % every == SWING - 1:
                rows.append((state.step, float(np.mean(sums))))
                sums.clear()

        return outcome(problem_, watch), rows




@experiment("extremes.explicit.long_run", title="Energy drift of oscillators over a long run",
            profiles=("quick", "standard"), budget={"quick": 4, "standard": 900})
def long_run(run):
    """One particle, which nothing damps, and a block; both precisions of the state."""
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
    """Change of the mean energy from the first to the last tenth of a run."""
    E = np.array([e for _, e in rows])
    tenth = max(len(E) // 10, 1)
    drift = E[-tenth:].mean() / E[:tenth].mean() - 1.0
    value = abs(drift) if end.kind == FINISHED else np.inf
    if name == "one.mls.f64":
        run.record(f"extremes.explicit.long_run.{name}", value, comparator="<=", bound=1e-4,
                   scale=scale, note="a particle by itself is one spring, integrated by "
                   "symplectic Euler: no drift. Calibrated: 3e-6 in 1e4 steps")
    else:
        run.record(f"extremes.explicit.long_run.{name}", drift, comparator="info", scale=scale,
                   note=f"relative change of the mean energy; ended: {end.kind}")
