"""Exact properties of symplectic Euler: constant acceleration, and the swing of the energy.

*Free fall* of a block is the experiment here:

    v_n = v_0 + n dt g,     x_n = x_0 + n dt v_0 + dt^2 g n (n + 1)/2

Every particle of a body without stress must do this to round-off, wherever it is in its cell and
however many cells it crosses. Positions of the particles are random.
"""

import numpy as np

from mpm_ref.body import Body, particles_at
from mpm_ref.explicit import Scheme, Stepper
from mpm_ref.materials import LogNeoHookean, NoFlow, lame

from ..common.registry import experiment
from ..common.scenes import threads_for

G, V, DX = np.array([0.3, -9.8]), np.array([1.0, 2.0]), 0.1
LAW = LogNeoHookean(*lame(1e5, 0.3))
STEPS, DT, PARTICLES = 1000, 1e-3, 200
QUICK = (("mls", 2), ("mls", 3), ("flip", 1))
STANDARD = (("pic", 1), ("pic", 2), ("pic", 3), ("flip", 1), ("flip", 2), ("flip", 3),
            ("apic", 2), ("apic", 3), ("mls", 2), ("mls", 3))


def distance_travelled(v, a, t, dt):
    """Return the distance after time t of steps dt [m]: v t + a t (t + dt)/2.

    v is the initial speed and a the acceleration. Each step uses the new velocity, so that the sum
    of 1, .., n takes the place of n^2/2.
    """
    return v * t + 0.5 * a * t * (t + dt)


def allowed_gain(elastic):
    """Return half the largest change of elastic energy U in a step [J], from its values.

    Symplectic Euler keeps H - (dt/2) dU/dt but for terms in dt^2, of the energy H = kinetic + U;
    from a start without stress, where dU/dt = 0, H rises by at most (dt/2) max dU/dt. The share
    omega dt/2 of it is left out, for a vibration of frequency omega: where a transfer does not
    dissipate as much, it shows.
    """
    return 0.5 * float(np.max(np.abs(np.diff(elastic))))


def fall(transfer, degree, x):
    """Return the largest errors of position and velocity after `STEPS`, both relative."""
    q = particles_at(x.copy(), np.tile(V, (len(x), 1)), np.ones(len(x)), np.full(len(x), 1e-3),
                     transfer)
    block = Body("block", q, LAW, NoFlow(), np.arange(len(x)))
    stepper = Stepper(Scheme(degree, transfer), DX, 2, G)
    stepper.start([block])
    with threads_for([block]):
        for k in range(STEPS):
            stepper.step([block], k * DT, DT)
    t = STEPS * DT
    distance, v = distance_travelled(V, G, t, DT), V + t * G
    return (float(np.abs(q.x - x - distance).max() / np.linalg.norm(distance)),
            float(np.abs(q.v - v).max() / np.linalg.norm(v)))


@experiment("verification.free_fall", title="Free fall to round-off",
            profiles=("quick", "standard"), budget={"quick": 8, "standard": 30})
def free_fall(run):
    """Record the errors of all transfers."""
    x = run.rng.uniform(0.0, 0.5, (PARTICLES, 2))
    bound = STEPS * np.finfo(float).eps
    schemes = run.choose(quick=QUICK, standard=STANDARD)
    for transfer, degree in run.progress(schemes, "schemes"):
        for quantity, error in zip(("x", "v"), fall(transfer, degree, x), strict=True):
            run.record(f"verification.free_fall.{transfer}-{degree}.{quantity}", error, paper=0.0,
                       comparator="<=", bound=bound,
                       scale=f"{PARTICLES} particles, {STEPS} steps, 40 cells fallen",
                       note="bound: one rounding of relative size 2^-52 in each step")
