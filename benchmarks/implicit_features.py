"""Measure what features of an implicit step cost: a block that hits a floor.

Every variant steps its own block from the same start. Times are CPU seconds from the particles to
the accepted increment, with all solves that updates of separate planes and of friction's loads
take. The variants of von Mises flow are to be compared with Hencky's law alone.
"""

from time import process_time
from typing import NamedTuple

import numpy as np

from mpm_ref.body import Body, particles_at
from mpm_ref.core.boundary import Collider, Conditions
from mpm_ref.core.levelset import half_space
from mpm_ref.explicit import Scheme
from mpm_ref.hot.methods import options_of
from mpm_ref.materials import Material, make_flow, make_law
from mpm_ref.problem import Clock, Problem
from mpm_ref.simulate import simulate
from validation.hot.warm_states import following_steps
from validation.verification.lattice import lattice

SIDE, DX = 0.6, 0.05                # of the block and the grid [m]
VELOCITY = (2.0, 0.0, -2.0)         # [m/s]
E, NU, RHO = 1e6, 0.3, 1000.0
DT = 0.005                          # [s]
METHOD = "hot-plus"
ELASTIC = {"law": "fixed_corotated"}
METAL = {"law": "hencky", "flow": "von_mises", "tau_y": 1e4}
SMOOTH, ROUGH = 0.0, 0.3            # friction of the floor


class ImplicitVariant(NamedTuple):
    """A variant of the steps of the block."""

    name: str
    material: dict = ELASTIC
    friction: float = SMOOTH
    transfer: str = "apic"
    options: dict = {}              # noqa: RUF012  never changed


VARIANTS = (
    ImplicitVariant("fixed corotated, APIC, smooth floor"),
    ImplicitVariant("printed HOT", options={"method": "hot"}),
    ImplicitVariant("floor with friction", friction=ROUGH),
    ImplicitVariant("MLS", transfer="mls"),
    ImplicitVariant("error of displacement below 1e-3 dx",
                    options={"displacement_tolerance": 1e-3}),
    ImplicitVariant("Hencky", {"law": "hencky"}),
    ImplicitVariant("Hencky with von Mises, lagged return map", METAL),
    ImplicitVariant("Hencky with von Mises, return map in the potential", METAL,
                    options={"return_map": "implicit"}),
)


def solver_of(variant):
    """Return the `SolverOptions` of a variant."""
    return options_of(**{"method": METHOD, **variant.options})


def block_problem(variant):
    """Return the `Problem` of the block just above its floor."""
    X = lattice((0.0, 0.0, 0.0), (SIDE, SIDE, SIDE), DX / 2)
    parameters = dict(variant.material)
    law_name, flow_name = parameters.pop("law"), parameters.pop("flow", "none")
    law = make_law(law_name, E=E, nu=NU)
    material = Material(law, make_flow(flow_name, law, 3, **parameters))
    V0 = np.full(len(X), (DX / 2) ** 3)
    particles = particles_at(X, np.tile(VELOCITY, (len(X), 1)), RHO * V0, V0, variant.transfer)
    if material.has_history:
        particles = particles._replace(y=np.full(len(X), material.initial_y))
    floor = Collider(half_space((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), "separate",
                     friction=variant.friction)
    return Problem(bodies=(Body("block", particles, law, material.flow, np.arange(len(X))),),
                   scheme=Scheme(transfer=variant.transfer), dx=DX, gravity=np.array([0, 0, -9.81]),
                   conditions=Conditions((floor,)), clock=Clock(dt=DT, end=1.0, interval=DT),
                   integrator="implicit", solver=solver_of(variant))


def step_costs(variant, count):
    """Return CPU seconds and reports of `count` steps of a variant after a first that compiles."""
    problem = block_problem(variant)
    state = next(simulate(problem)).state
    return [*map(timed, following_steps(problem, state, count + 1))][1:]


def timed(step):
    """Solve a step from its particles on and return CPU seconds and report."""
    start = process_time()
    step.stepper.solve(step.stepper.problem(step.bodies, step.t, step.dt))
    return process_time() - start, step.stepper.report


def implicit_rows(steps, repeats):
    """Return a row for every variant: median over repeats of the CPU time of its steps, in turn."""
    rounds = [[step_costs(variant, steps) for variant in VARIANTS] for _ in range(repeats)]
    rows = [variant_row(variant, done) for variant, done in zip(VARIANTS, zip(*rounds))]
    return [row | {"cpu_ratio": row["cpu_s"] / rows[0]["cpu_s"]} for row in rows]


def variant_row(variant, rounds):
    """Return the row of a variant from [(CPU seconds, report)] of each repeat."""
    reports = [report for _, report in rounds[-1]]
    return {"variant": variant.name,
            "cpu_s": float(np.median([np.mean([t for t, _ in done]) for done in rounds])),
            "iterations": float(np.mean([report.iterations for report in reports])),
            "converged": all(report.converged for report in reports)}
