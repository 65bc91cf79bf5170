"""Recover Young's modulus and Poisson's ratio of a block from its observed motion.

A block falls on a floor; the positions of its particles are observed at a few times. From wrong
moduli, SciPy's L-BFGS-B minimises the squared distance to the observations, with the exact gradient
of the whole run with respect to the logarithms of mu and lam (`mpm_ref.tape`).
"""

import numpy as np
from scipy.optimize import minimize

from mpm_ref.body import Body, particles_at
from mpm_ref.core.boundary import Collider, Conditions
from mpm_ref.core.levelset import half_space
from mpm_ref.explicit import Scheme, Stepper
from mpm_ref.materials import FixedCorotated, NoFlow, make_law
from mpm_ref.tape import Seed, Tape

DX, DT, STEPS, OBSERVED = 0.05, 4e-4, 150, (50, 100, 150)
RHO, GRAVITY = 1000.0, (0.0, -9.8)
TRUE, GUESS = (1.0e5, 0.30), (4.0e4, 0.10)      # E [Pa], nu
WIDE = 3.0      # bound of the search around the guess, in logarithms; stiffer is unstable


def block(law):
    """Return a block just above the floor, on its way down."""
    x = np.stack(np.meshgrid(np.arange(0.3, 0.7, DX / 2), np.arange(0.11, 0.4, DX / 2),
                             indexing="ij"), -1).reshape(-1, 2)
    v, V0 = np.tile((0.0, -2.0), (len(x), 1)), np.full(len(x), DX**2 / 4)
    return Body("block", particles_at(x, v, RHO * V0, V0), law, NoFlow(), np.arange(len(x)))


def run(law):
    """Return the tape of a run, and the positions at the steps OBSERVED."""
    floor = Collider(half_space((0.0, 0.1), (0.0, 1.0)), "slip")
    stepper, body = Stepper(Scheme(), DX, 2, GRAVITY, Conditions((floor,))), block(law)
    positions = {}
    stepper.start([body])
    tape = Tape(stepper, [body], every=25)
    for n in range(STEPS):
        tape.step(n * DT, DT)
        if n + 1 in OBSERVED:
            positions[n + 1] = body.particles.x.copy()
    return tape, positions


def loss(logs, truth):
    """Return the mean squared distance [cells^2] and its gradient by log mu and log lam."""
    law = FixedCorotated(*np.exp(logs))
    tape, positions = run(law)
    count = len(OBSERVED) * len(truth[OBSERVED[0]]) * DX**2
    value = sum(np.sum((positions[n] - truth[n]) ** 2) for n in OBSERVED) / count
    seeds = {n: [Seed(x=2.0 * (positions[n] - truth[n]) / count)] for n in OBSERVED}
    gradient, = tape.gradient(seeds).bodies
    return value, np.array(gradient.law) * np.array(law)


def moduli(law):
    """Return E [Pa] and nu of a law's mu and lam."""
    return law.mu * (3 * law.lam + 2 * law.mu) / (law.lam + law.mu), (
        law.lam / (2 * (law.lam + law.mu)))


def recover():
    """Return the `OptimizeResult` and the recovered moduli."""
    _, truth = run(make_law("fixed_corotated", E=TRUE[0], nu=TRUE[1]))
    start = np.log(make_law("fixed_corotated", E=GUESS[0], nu=GUESS[1]))
    done = minimize(loss, start, (truth,), method="L-BFGS-B", jac=True,
                    bounds=[(log - WIDE, log + WIDE) for log in start],
                    options={"ftol": 1e-15, "gtol": 1e-10})
    return done, moduli(FixedCorotated(*np.exp(done.x)))


if __name__ == "__main__":
    done, (E, nu) = recover()
    print(f"true E {TRUE[0]:.6g} Pa, nu {TRUE[1]:.6g}; start {GUESS[0]:.6g} Pa, {GUESS[1]:.6g}")
    print(f"found E {E:.6g} Pa, nu {nu:.6g}, after {done.nfev} runs with gradients, "
          f"loss {done.fun:.2g} cells^2")
    print(f"relative errors: E {abs(E / TRUE[0] - 1.0):.1e}, nu {abs(nu / TRUE[1] - 1.0):.1e}")
