"""Implicit steps by every method, on a small twisted bar and on a small disk."""

from functools import partial

from .library import problem, simulated, solvers, with_solver
from .recording import RunCase

METHODS = ("hot", "hot-quadratic", "hot-plus", "lbfgs-h", "pn-pcg", "pn-pcg-mf", "pn-mgpcg",
           "sgs-pcg", "gast15", "lbfgs-gmg", "pn-gmg-pcg", "admm")
SETUPS = {
    "bar": ("hot_stiffness", {"dx": 0.06, "body[0].sampling.count": 240,
                              "body[1].sampling.count": 240, "body[2].sampling.count": 240,
                              "body[1].material.E": 1e7}),
    "disk": ("hello", {"scheme": {"transfer": "apic"}, "body[0].velocity": {"linear": [0.5, -2.0]},
                       "longest": 0.02, "cfl": 0.6}),
}
VARIANTS = {        # of HOT: changes of its options
    "displacement-stop": {"displacement_tolerance": 1e-3},
    "scipy": {"implementation": "scipy"},
    "rebuild": {"rebuild_every": 2, "start": "gravity"},
    "balance": {"start": "gravity", "balance": "rigid"},
    "shortened": {"rebuild_when": "shortened", "jacobi": "scalar"},
}
STEPS = 4


def cases():
    """Return a `RunCase` of each method on each setup, and of variants of HOT on the bar."""
    methods = dict(zip(METHODS, solvers(), strict=True))
    runs = [RunCase(f"implicit {setup} {name}", partial(run, setup, options, {}))
             for setup in SETUPS for name, options in methods.items()]
    runs += [RunCase(f"implicit bar hot {name}", partial(run, "bar", methods["hot"], changes))
              for name, changes in VARIANTS.items()]
    return runs


def run(setup, options, changes):
    """Return the state of a setup after some steps by a method."""
    name, values = SETUPS[setup]
    return simulated(with_solver(problem(name, values), options, **changes), STEPS)
