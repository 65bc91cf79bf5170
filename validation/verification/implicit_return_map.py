"""The return map in the potential of an implicit step, or lagged: a block of metal hits a floor.

A block of Hencky's law with perfect von Mises plasticity, whose yield stress is a hundredth of its
modulus, falls flat on a rigid smooth floor and is upset. Steps of explicit length give the
reference. Implicit steps of 4 to 16 times that length differ from it by their own damping and, with
a lagged return map, by stresses beyond the yield surface with which the nodes are in balance.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from mpm_ref.body import Body, particles_at
from mpm_ref.core.boundary import Collider, Conditions
from mpm_ref.core.levelset import half_space
from mpm_ref.explicit import Scheme
from mpm_ref.hot.methods import options_of
from mpm_ref.materials import Hencky, VonMises, lame
from mpm_ref.problem import Clock, Problem
from mpm_ref.simulate import simulate

from ..common.registry import experiment
from ..common.scenes import threads_for
from .convergence import rms
from .lattice import lattice

E, NU, RHO = 1e7, 0.3, 1000.0       # [Pa], [1], [kg/m^3]
TAU_Y = E / 100.0                   # radius of the yield surface [Pa]
SPEED, WIDTH, HEIGHT = 8.0, 0.4, 0.4            # [m/s], [m], [m]
END = 0.016                         # [s], when the block is at rest, nearly
SHORTEST = 1.25e-4                  # step of the reference [s], 0.58 of its CFL bound at dx = 0.025
FACTORS = (4, 8, 16)                # of the implicit steps
METHOD, EPS = "hot-plus", 1e-8
RETURN_MAPS = ("lagged", "implicit")
PAYS = 0.5                          # of the lagged error that the implicit one must stay below


class Upset(NamedTuple):
    """The block after its impact."""

    x: np.ndarray           # (N, 2) in the order of the start [m]
    X: np.ndarray           # (N, 2) at the start


def upset(dx, dt, solver=None):
    """Return the `Upset` of steps of dt [s], explicit ones without a solver."""
    X = lattice([0.0, 0.0], [WIDTH, HEIGHT], dx / 2)
    V0 = np.full(len(X), (dx / 2) ** 2)
    v = np.tile((0.0, -SPEED), (len(X), 1))
    body = Body("block", particles_at(X.copy(), v, RHO * V0, V0, "apic"), Hencky(*lame(E, NU)),
                VonMises(TAU_Y, 0.0), np.arange(len(X)))
    floor = Collider(half_space((0.0, 0.0), (0.0, 1.0)), "separate")
    problem = Problem(bodies=(body,), scheme=Scheme(transfer="apic"), dx=dx, gravity=np.zeros(2),
                      conditions=Conditions((floor,)), clock=Clock(dt=dt, end=END, interval=END))
    if solver is not None:
        problem = replace(problem, integrator="implicit", solver=solver)
    with threads_for(problem.bodies):
        for frame in simulate(problem):
            end = frame.state.bodies[0]
    return Upset(end.particles.x[np.argsort(end.id)], X)


def deformation(u):
    """Return the root mean square of displacements u (N, 2) [m] beside their mean."""
    return rms(u - u.mean(axis=0))


@experiment("verification.implicit_return_map",
            title="Return map in the potential of an implicit step",
            profiles=("quick", "standard"), budget={"quick": 20, "standard": 120})
def implicit_return_map(run):
    """Record the errors of implicit steps with both return maps against short explicit steps."""
    dx = run.choose(quick=0.05, standard=0.025)
    exact = upset(dx, SHORTEST)                 # a step that is not solved ends its run
    moved = deformation(exact.x - exact.X)
    rows = []
    for factor in run.progress(run.choose(quick=FACTORS[-1:], standard=FACTORS), "steps"):
        errors = {}
        for return_map in RETURN_MAPS:
            solver = options_of(METHOD, eps=EPS, return_map=return_map)
            found = upset(dx, factor * SHORTEST, solver)
            errors[return_map] = deformation(found.x - exact.x) / moved
            rows.append((factor, return_map, errors[return_map], found.x[:, 1].max(),
                         np.ptp(found.x[:, 0])))
        scale = (f"{len(exact.x)} particles, dx = {dx} m, steps of {factor * SHORTEST:.3g} s, "
                 f"{METHOD}")
        run.record(f"verification.implicit_return_map.steps{factor}",
                   errors["implicit"] / errors["lagged"], comparator="<=", bound=PAYS, scale=scale,
                   note=f"error of the return map in the potential over that of the lagged one, "
                   f"{errors['lagged']:.3g} of the deformation, against explicit steps of "
                   f"{SHORTEST:.3g} s")
    run.table("errors", ("factor", "return_map", "error", "height", "width"), rows)
