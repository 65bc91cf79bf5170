"""Measure the cost of each feature of a scene: one block, with one feature changed at a time."""

import time
from typing import NamedTuple

import numpy as np

from mpm_ref.adjoint import StepAdjoint, zero_bars, zero_sums
from mpm_ref.body import Body, in_precision, particles_at, with_separate_gradient
from mpm_ref.body_contact import BodyContact, ContactStepper
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
    """A variant of the steps of the block: scheme, material, boundary conditions, and what a round
    does: "step", "energies" after each, "budget" of energies, "adjoint" of a step, or steps of two
    halves with "contact", or that are "glued" because they share one velocity field.
    """

    name: str
    scheme: Scheme = Scheme()
    material: dict = ELASTIC
    conditions: str = "none"
    work: str = "step"


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
    Variant("energies every step", work="energies"),
    Variant("energy budget", work="budget"),
    Variant("two bodies without contact", work="glued"),
    Variant("two bodies in contact with friction", work="contact"),
    Variant("adjoint of MLS", work="adjoint"),
    Variant("adjoint of APIC", Scheme(transfer="apic"), work="adjoint"),
    Variant("adjoint of Hencky", material={"law": "hencky"}, work="adjoint"),
    Variant("adjoint of Hencky with Drucker-Prager", material=SAND, work="adjoint"),
)


class Run:
    """A block that is advanced by one variant."""

    def __init__(self, variant, block):
        self.variant, self.dt = variant, block.dt
        self.bodies = make_bodies(variant, block)
        self.gravity = (0.0, 0.0, GRAVITY)
        self.stepper = make_stepper(variant, block.dx, self.gravity,
                                    make_conditions(variant.conditions, block))
        self.stepper.start(self.bodies)
        self.stepper.sort(self.bodies)
        if variant.work == "adjoint":
            self.adjoint = StepAdjoint(self.stepper)
            self.bars = [zero_bars(body) for body in self.bodies]
            for bar in self.bars:
                bar.x[:], bar.v[:] = 1.0, block.dt
            self.sums = [zero_sums(body) for body in self.bodies]

    def step(self):
        """Advance the block by one step, or carry the bars back through one from the same state."""
        if self.variant.work == "adjoint":
            self.adjoint.pull_back(self.bodies, self.bars, self.sums, 0.0, self.dt)
            return
        self.stepper.step(self.bodies, 0.0, self.dt)
        if self.variant.work == "energies":
            energy(self.bodies, self.gravity)

    @property
    def bytes_per_particle(self):
        """Return the bytes of the state per particle; shared arrays count once."""
        arrays = {id(a): a.nbytes for body in self.bodies for a in body.particles}
        return sum(arrays.values()) / sum(len(body.id) for body in self.bodies)


def make_stepper(variant, dx, gravity, conditions):
    """Return the stepper of a variant."""
    if variant.work == "contact":
        contact = BodyContact(("lower", "upper"), friction=0.3)
        return ContactStepper([contact], variant.scheme, dx, gravity, conditions)
    setup = variant.scheme, dx, len(gravity), gravity, conditions
    return BudgetStepper(EnergyBudget(), *setup) if variant.work == "budget" else Stepper(*setup)


def make_bodies(variant, block):
    """Return the block's particles as one body, or as its two halves."""
    if variant.work not in ("contact", "glued"):
        return (make_body(variant, block, "block", block.x[:, 2] < np.inf),)
    lower = block.x[:, 2] < 0.5
    return make_body(variant, block, "lower", lower), make_body(variant, block, "upper", ~lower)


def make_body(variant, block, name, part):
    """Return the particles of a part (N,) of the block with the material of a variant."""
    parameters = dict(variant.material)
    law_name, flow_name = parameters.pop("law"), parameters.pop("flow", "none")
    law = make_law(law_name, E=E, nu=NU)
    material = Material(law, make_flow(flow_name, law, 3, **parameters))
    count = int(part.sum())
    particles = particles_at(
        block.x[part], block.v[part], np.full(count, RHO * block.V0), np.full(count, block.V0),
        variant.scheme.transfer, fluid=not material.needs_F,
    )
    if variant.scheme.relaxation:
        particles = with_separate_gradient(particles)
    if material.has_history:
        particles = particles._replace(y=np.full(count, material.initial_y))
    particles = in_precision(particles, variant.scheme.real)
    return Body(name, particles, law, material.flow, np.arange(count))


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
