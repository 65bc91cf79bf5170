"""Measure the cost of each feature of a scene: one block, with one feature changed at a time."""

import time
from typing import NamedTuple

import numpy as np

from mpm_ref.body import Body, in_precision, particles_at, with_separate_gradient
from mpm_ref.core.boundary import Collider, Conditions, nclaw_walls
from mpm_ref.core.jit import set_threads
from mpm_ref.core.levelset import half_space
from mpm_ref.core.surface import SurfaceConditions
from mpm_ref.energy import energy
from mpm_ref.energy_budget import BudgetStepper, EnergyBudget
from mpm_ref.explicit import Scheme, Stepper
from mpm_ref.materials import Material, make_flow, make_law

from .problem import GRAVITY, NU, RHO, WALL, E

ELASTIC = {"law": "fixed_corotated"}
SAND = {"law": "hencky", "flow": "drucker_prager", "friction_angle": 30.0}
FLOORS = {"floor": Conditions, "surface": SurfaceConditions}
METAL = {"law": "hencky", "flow": "von_mises_hardening", "tau_y": 1e9, "xi": 0.1}


class Variant(NamedTuple):
    """A variant of the steps of the block: scheme, material, boundary conditions, energies."""

    name: str
    scheme: Scheme = Scheme()
    material: dict = ELASTIC
    conditions: str = "none"
    monitor: bool = False
    budget: bool = False


VARIANTS = (
    Variant("MLS, quadratic, fixed corotated"),
    Variant("PIC", Scheme(transfer="pic")),
    Variant("FLIP", Scheme(transfer="flip")),
    Variant("APIC", Scheme(transfer="apic")),
    Variant("MLS with RPIC damping", Scheme(rpic=0.1)),
    Variant("PIC, linear splines", Scheme(transfer="pic", degree=1)),
    Variant("MLS, cubic splines", Scheme(degree=3)),
    Variant("fluid, J only", material={"law": "fluid"}),
    Variant("Hencky", material={"law": "hencky"}),
    Variant("Hencky with Drucker-Prager", material=SAND),
    Variant("Hencky with hardening von Mises", material=METAL),
    Variant("MLS that relaxes", Scheme(relaxation=1e-3)),
    Variant("APIC that relaxes", Scheme(transfer="apic", relaxation=1e-3)),
    Variant("averaged volumes (F-bar)", Scheme(f_bar=True)),
    Variant("MLS in single precision", Scheme(precision="single")),
    Variant("APIC in single precision", Scheme(transfer="apic", precision="single")),
    Variant("Hencky with Drucker-Prager in single precision", Scheme(precision="single"), SAND),
    Variant("walls of a box", conditions="walls"),
    Variant("floor with friction", conditions="floor"),
    Variant("floor with friction, at its surface", conditions="surface"),
    Variant("energies every step", monitor=True),
    Variant("energy budget", budget=True),
)


class Run:
    """A block that is advanced by one variant."""

    def __init__(self, variant, block):
        self.variant, self.dt = variant, block.dt
        self.bodies = (make_body(variant, block),)
        self.gravity = (0.0, 0.0, GRAVITY)
        conditions = make_conditions(variant.conditions, block)
        setup = variant.scheme, block.dx, 3, self.gravity, conditions
        self.stepper = BudgetStepper(EnergyBudget(), *setup) if variant.budget else Stepper(*setup)
        self.stepper.start(self.bodies)
        self.stepper.sort(self.bodies)

    def step(self):
        """Advance the block by one step."""
        self.stepper.step(self.bodies, 0.0, self.dt)
        if self.variant.monitor:
            energy(self.bodies, self.gravity)

    @property
    def bytes_per_particle(self):
        """Return the bytes of the state per particle; shared arrays count once."""
        arrays = {id(a): a.nbytes for a in self.bodies[0].particles}
        return sum(arrays.values()) / len(self.bodies[0].id)


def make_body(variant, block):
    """Return the block's particles with the material of a variant."""
    parameters = dict(variant.material)
    law_name, flow_name = parameters.pop("law"), parameters.pop("flow", "none")
    law = make_law(law_name, E=E, nu=NU)
    material = Material(law, make_flow(flow_name, law, 3, **parameters))
    count = len(block.x)
    particles = particles_at(
        block.x.copy(), block.v.copy(), np.full(count, RHO * block.V0), np.full(count, block.V0),
        variant.scheme.transfer, fluid=not material.needs_F,
    )
    if variant.scheme.relaxation:
        particles = with_separate_gradient(particles)
    if material.has_history:
        particles = particles._replace(y=np.full(count, material.initial_y))
    particles = in_precision(particles, variant.scheme.real)
    return Body("block", particles, law, material.flow, np.arange(count))


def make_conditions(name, block):
    """Return walls, a floor just below the block, or None."""
    if name == "walls":
        return Conditions(walls=nclaw_walls(block.n, WALL))
    if name in FLOORS:
        floor = half_space((0.0, 0.0, 0.25), (0.0, 0.0, 1.0))
        return FLOORS[name](colliders=(Collider(floor, "separate", friction=0.3),))
    return None


def costs(block, threads, repeats):
    """Return a row per variant: median wall and CPU ns per particle-step, their ratio, bytes."""
    set_threads(threads)
    runs = [Run(variant, block) for variant in VARIANTS]
    rounds = {run.variant.name: [] for run in runs}
    for _ in range(repeats + 1):                 # the first round compiles
        for run in runs:
            rounds[run.variant.name].append(timed(run))
    scale = 1e9 / len(block.x)
    times = {name: np.median(r[1:], axis=0) * scale for name, r in rounds.items()}
    first = times[VARIANTS[0].name][1]
    return [
        {"feature": run.variant.name, "wall_ns": times[run.variant.name][0],
         "cpu_ns": times[run.variant.name][1],
         "cpu_ratio": times[run.variant.name][1] / first,
         "state_bytes_per_particle": run.bytes_per_particle}
        for run in runs
    ]


def timed(run, steps=3):
    """Return wall and CPU seconds per step."""
    wall, cpu = time.perf_counter(), time.process_time()
    for _ in range(steps):
        run.step()
    return (time.perf_counter() - wall) / steps, (time.process_time() - cpu) / steps
