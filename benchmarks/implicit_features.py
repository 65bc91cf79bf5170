"""Measure what features of an implicit step cost: a block that hits a floor.

Every variant steps its own block from the same start. Times are CPU seconds of whole steps, with
all solves that updates of separate planes and of friction's loads take, and with what enters and
leaves. The variants of von Mises flow are to be compared with Hencky's law alone.
"""

from dataclasses import replace
from time import process_time
from typing import NamedTuple

import numpy as np

from mpm_ref.body import Body, particles_at
from mpm_ref.core.boundary import Collider, Conditions
from mpm_ref.core.levelset import half_space, sphere
from mpm_ref.explicit import Scheme
from mpm_ref.hot.methods import options_of, printed, released
from mpm_ref.materials import Material, make_flow, make_law
from mpm_ref.problem import Clock, Problem
from mpm_ref.simulate import advance, simulate
from mpm_ref.streams import ParticleSink, ParticleSource, first_bodies
from validation.verification.lattice import lattice

SIDE, DX = 0.6, 0.05                # of the block and the grid [m]
VELOCITY = (2.0, 0.0, -2.0)         # [m/s]
E, NU, RHO = 1e6, 0.3, 1000.0
DT = 0.005                          # [s]
METHOD = "hot-plus"
ELASTIC = {"law": "fixed_corotated"}
METAL = {"law": "hencky", "flow": "von_mises", "tau_y": 1e4}
SMOOTH, ROUGH = 0.0, 0.3            # friction of the floor
JET = (0.8, 0.25, 0.5), (0.1, 0.1, DX)      # corner and sides of the block that a source repeats
SPEED = 2.0                         # of the jet, downwards [m/s]
DRAIN = (0.85, 0.3, 0.4), 0.08      # centre and radius of the sink below it [m]


class ImplicitVariant(NamedTuple):
    """A variant of the steps of the block."""

    name: str
    material: dict = ELASTIC
    friction: float = SMOOTH
    transfer: str = "apic"
    options: dict = {}              # noqa: RUF012  never changed
    preset: callable = options_of   # of the method
    pours: bool = False             # a jet beside the block, from a source to a sink


VARIANTS = (
    ImplicitVariant("fixed corotated, APIC, smooth floor"),
    ImplicitVariant("HOT as printed", options={"method": "hot"}, preset=printed),
    ImplicitVariant("HOT, options of the release", options={"method": "hot"}, preset=released),
    ImplicitVariant("a jet from a source to a sink", pours=True),
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
    return variant.preset(**{"method": METHOD, **variant.options})


def block_problem(variant):
    """Return the `Problem` of the block just above its floor."""
    body = lattice_body("block", (0.0, 0.0, 0.0), (SIDE, SIDE, SIDE), VELOCITY, variant)
    floor = Collider(half_space((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), "separate",
                     friction=variant.friction)
    problem = Problem(bodies=(body,), scheme=Scheme(transfer=variant.transfer), dx=DX,
                      gravity=np.array([0, 0, -9.81]), conditions=Conditions((floor,)),
                      clock=Clock(dt=DT, end=1.0, interval=DT), integrator="implicit",
                      solver=solver_of(variant))
    return poured(problem, variant) if variant.pours else problem


def lattice_body(name, corner, sides, v, variant):
    """Return a box of a variant's material [m], filled by a lattice of velocity v [m/s]."""
    X = lattice(corner, np.add(corner, sides), DX / 2)
    parameters = dict(variant.material)
    law_name, flow_name = parameters.pop("law"), parameters.pop("flow", "none")
    law = make_law(law_name, E=E, nu=NU)
    material = Material(law, make_flow(flow_name, law, 3, **parameters))
    V0 = np.full(len(X), (DX / 2) ** 3)
    particles = particles_at(X, np.tile(v, (len(X), 1)), RHO * V0, V0, variant.transfer)
    if material.has_history:
        particles = particles._replace(y=np.full(len(X), material.initial_y))
    return Body(name, particles, law, material.flow, np.arange(len(X)))


def poured(problem, variant):
    """Return a problem with a jet beside its bodies, which falls from a source to a sink."""
    v = np.array([0.0, 0.0, -SPEED])
    block = lattice_body("jet", *JET, v, variant)
    length = JET[1][2]
    blocks = int(problem.clock.end * SPEED / length)
    source = ParticleSource(len(problem.bodies), block, v, length, 0.0, blocks)
    bodies = first_bodies((*problem.bodies, block), (source,))
    return replace(problem, bodies=bodies, sources=(source,),
                   sinks=(ParticleSink(sphere(*DRAIN)),))


def step_costs(variant, count):
    """Return CPU seconds and reports of `count` steps of a variant after a first that compiles."""
    problem = block_problem(variant)
    stepper, state = problem.stepper(), next(simulate(problem)).state
    return [timed_step(problem, stepper, state) for _ in range(count + 1)][1:]


def timed_step(problem, stepper, state):
    """Advance a state by a step and return CPU seconds and the report of its solve."""
    start = process_time()
    advance(problem, stepper, state)
    return process_time() - start, stepper.report


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
