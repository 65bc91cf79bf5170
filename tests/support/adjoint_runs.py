"""Short runs with everything in them, losses of their states, and how both change along a line."""

from typing import NamedTuple

import numpy as np
from adjoints import pairing, rate
from clouds import AFFINE
from constitutive import rotations
from problems import DT, DX, JELLY, METAL, ball, moving

from mpm_ref.body import keep_inside, with_separate_gradient
from mpm_ref.core.boundary import BoxWalls, Collider, Conditions
from mpm_ref.core.motion import Motion, Oscillation, Steady
from mpm_ref.core.solids import half_space
from mpm_ref.explicit import Scheme, Stepper
from mpm_ref.materials import Fluid, NoFlow, make_flow, make_law
from mpm_ref.tape import STATE, Seed, Tape

CONSTANTS = ("m", "V0", "b")
SIZE = {"x": 0.05 * DX, "v": 0.3, "C": 1.0, "F": 0.01, "tau": 0.0, "y": 5.0, "b": 1.0}
NCLAW = {       # law, flow and their constants in scenes/nclaw_*.toml; DT needs sand that is softer
    "jelly": (("fixed_corotated", {"E": 1e5, "nu": 0.2}), None),
    "sand": (("hencky", {"E": 1e5, "nu": 0.2}),
             ("drucker_prager", {"friction_angle": 25.0, "s_min": 0.05})),
    "plasticine": (("hencky", {"E": 3e5, "nu": 0.25}),
                   ("von_mises", {"tau_y": 5e3, "s_min": 0.05})),
    "water": (("fluid", {"E": 1e5, "nu": 0.3}), ("fluid_projection", {})),
}
WEIGHT = {"x": 1 / DX, "v": 1.0, "C": 0.01, "F": 1.0, "tau": 1e-4, "y": 0.01}    # of losses


class Run(NamedTuple):
    """Bodies at the start, what steps them, and the box that positions are clipped to."""

    bodies: tuple
    scheme: Scheme
    gravity: np.ndarray
    conditions: Conditions
    clip: tuple | None = None

    def stepper(self):
        """A new stepper."""
        d = len(self.gravity)
        return Stepper(self.scheme, DX, d, self.gravity, self.conditions)


def with_history(body, y):
    return body._replace(particles=body.particles._replace(y=np.full(len(body.id), y)))


def impact():
    """2D, MLS with damping: a hardening disk hits a spinning elastic one, on a floor that rubs and
    at a wall that shakes.
    """
    flow = make_flow("von_mises_hardening", METAL, 2, tau_y=50.0, xi=0.2)
    jelly = moving(ball("jelly", (0.31, 0.12), JELLY, NoFlow(), radius=1.7), (0.3, -1.0), 3.0)
    metal = moving(ball("metal", (0.33, 0.27), METAL, flow, radius=1.7), (0.2, -2.0))
    floor = Collider(half_space((0.0, 0.07), (0.1, 1.0)), "separate", 0.3)
    shaking = Motion(translation=Oscillation((0.004, 0.0), 15.0))
    wall = Collider(half_space((0.24, 0.0), (1.0, 0.2)), "slip", motion=shaking)
    return Run((jelly, with_history(metal, 50.0)), Scheme(rpic=0.1, mass_eps=1e-3),
               np.array((0.0, -9.8)), Conditions((floor, wall)))


def splash():
    """3D, MLS: a fluid, of which J is carried, and a plastic ball in the walls of NCLAW-sim."""
    flow = make_flow("von_mises", METAL, 3, sigma_y=100.0)
    metal = moving(ball("metal", (0.31, 0.13, 0.32), METAL, flow, radius=1.2),
                   (0.2, -2.0, 0.1), 5.0)
    fluid = moving(ball("fluid", (0.33, 0.26, 0.31), Fluid(5e4), NoFlow(), radius=1.2),
                   (0.1, -3.0, -0.4), 2.0)
    q, n = fluid.particles, len(fluid.id)
    fluid = fluid._replace(particles=q._replace(F=np.ones(n), tau=np.zeros(n)))
    walls = BoxWalls((3, 2, None), (9, None, 8), "separate")
    return Run((metal, fluid), Scheme(gravity_on_empty=True), np.array((0.0, -9.8, 0.0)),
               Conditions(walls=walls))


def dive(transfer="flip", degree=3, relaxation=0.0, gimp=0.0):
    """2D: an elastic disk with a body force of its own meets a wall that rises and holds it."""
    body = moving(ball("jelly", (0.31, 0.14), JELLY, NoFlow(), transfer=transfer, radius=1.7),
                  (0.5, -2.0), 4.0)
    q = body.particles
    body = body._replace(particles=q._replace(b=np.sin(30.0 * q.x)))
    if relaxation:
        body = body._replace(particles=with_separate_gradient(body.particles))
    rising = Motion(translation=Steady((0.0, 0.5)))
    floor = Collider(half_space((0.0, 0.07), (0.3, 1.0)), "noslip", motion=rising)
    rpic = 0.2 * (transfer in AFFINE and not relaxation)
    scheme = Scheme(degree, transfer, flip=0.95, rpic=rpic, relaxation=relaxation, gimp=gimp)
    return Run((body,), scheme, np.array((0.0, -9.8)), Conditions((floor,)))


def thrown(name, d, deformed):
    """MLS in walls of NCLAW-sim: a spinning ball of a material of NCLaw, at rest with F = I or
    `deformed`, hits the lower wall within 100 steps.
    """
    (law, moduli), flow = NCLAW[name]
    law = make_law(law, **moduli)
    flow = NoFlow() if flow is None else make_flow(flow[0], law, d, **flow[1])
    center, v = np.array((0.31, 0.17, 0.32)[:d]), (0.3, -2.0, 0.1)[:d]
    body = moving(ball(name, center, law, flow, radius=1.6 if d == 2 else 1.1), v, 4.0)
    if deformed:
        body = body._replace(particles=body.particles._replace(F=strains(len(body.id), d)))
    walls = BoxWalls((3, 2, None)[:d], (9, None, 8)[:d], "separate")
    return Run((body,), Scheme(2, mass_eps=1e-7, gravity_on_empty=True),
               np.array((0.0, -9.8, 0.0)[:d]), Conditions(walls=walls))


def strains(n, d):
    """Random F (n, d, d), of which every second has two singular values that are equal."""
    rng = np.random.default_rng(0)
    s = np.exp(0.06 * rng.normal(size=(n, d)) - 0.03)
    s[::2, 1] = s[::2, 0]
    return rotations(rng, n, d) * s[:, None, :] @ rotations(rng, n, d)


class Line(NamedTuple):
    """A direction in all that a gradient is taken of: a record of fields for each body."""

    bodies: list            # of dicts: fields of particles, law, flow
    gravity: np.ndarray


def line_of(run, rng):
    """Random."""
    bodies = []
    for body in run.bodies:
        q = body.particles
        by = {n: SIZE[n] * rng.normal(size=getattr(q, n).shape) for n in (*STATE[:4], "y", "b")}
        by |= {n: 0.1 * getattr(q, n) * rng.normal(size=len(q.m)) for n in ("m", "V0")}
        by |= {n: 0.1 * np.array(getattr(body, n)) * rng.normal(size=len(getattr(body, n)))
               for n in ("law", "flow")}
        bodies.append(by)
    return Line(bodies, rng.normal(size=len(run.gravity)))


def moved(run, line, h):
    """The run h along a line; with arrays of its own."""
    bodies = []
    for body, by in zip(run.bodies, line.bodies):
        q = body.particles
        new = {name: getattr(q, name) + h * by[name] for name in by if name not in ("law", "flow")}
        new["L"] = new["C"] if q.L is q.C else q.L.copy()
        new["tau"] = q.tau.copy()
        records = {n: type(getattr(body, n))(*(np.array(getattr(body, n)) + h * by[n]).tolist())
                   for n in ("law", "flow")}
        bodies.append(body._replace(particles=q._replace(**new), **records))
    return run._replace(bodies=tuple(bodies), gravity=run.gravity + h * line.gravity)


def seeds_of(run, steps, rng):
    """Random weights of the state after some numbers of steps."""
    return {n: [Seed(**{name: WEIGHT[name] * rng.normal(size=getattr(b.particles, name).shape)
                        for name in STATE}) for b in run.bodies] for n in steps}


def loss(run, seeds):
    """<seeds, states> of the run; it changes its bodies."""
    stepper, value = run.stepper(), 0.0
    stepper.start(run.bodies)
    for n in range(max(seeds) + 1):
        for body, seed in zip(run.bodies, seeds.get(n, ())):
            value += pairing(seed, (getattr(body.particles, name) for name in STATE))
        if n < max(seeds):
            stepper.step(run.bodies, n * DT, DT)
            if run.clip is not None:
                keep_inside(run.bodies, *run.clip)
    return value


def taped(run, seeds, every=1):
    """The gradient of that loss; it changes the bodies too."""
    stepper = run.stepper()
    stepper.start(run.bodies)
    tape = Tape(stepper, run.bodies, every, run.clip)
    for n in range(max(seeds)):
        tape.step(n * DT, DT)
    return tape.gradient(seeds)


def along(gradient, line):
    """Slope of a loss along a line."""
    slope = gradient.gravity @ line.gravity
    for bars, by in zip(gradient.bodies, line.bodies):
        slope += pairing((np.array(getattr(bars, name)) for name in by), by.values())
    return slope


def order(run, steps, h, seed=0):
    """Observed order of the Taylor remainder of a run."""
    rng = np.random.default_rng(seed)
    line, seeds = line_of(run, rng), seeds_of(run, steps, rng)
    slope = along(taped(moved(run, line, 0.0), seeds), line)
    return rate(lambda k: loss(moved(run, line, k), seeds), slope, h)
