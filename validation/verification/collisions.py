"""Collisions of two elastic bodies in free flight: momentum, and energy kept by each transfer.

*Disks* [Sulsky1994]: momentum, energy, and the time at which they begin to touch.

*Rings*: the setting is that of a public code (Tesserae.jl, tutorial on transfer schemes), whose
tests hold energies for the end, from randomly placed particles: rings of radii 3 and 4 m fly at
each other with 30 m/s, E 100 MPa, nu 0.2, 1000 kg/m^3, log neo-Hookean, dx 0.1 m, 0.6 s. Ours are
on a lattice.
"""

from itertools import pairwise
from math import hypot, sqrt
from typing import NamedTuple

import numpy as np

from mpm_ref.energy import energy, momentum
from mpm_ref.scene import Body, Material, Regular, Scene, Scheme, Torus, Velocity, build
from mpm_ref.simulate import simulate

from ..common.registry import experiment
from ..common.scenes import catalogue_scene, evenly, mean, particle_count, threads_for, with_
from .convergence import order
from .symplectic import allowed_gain

TRANSFERS = ("pic", "mls", "apic", "flip")
SHOWN = 100                 # rows of a table per transfer
ROUND_OFF = 1e-12           # of one disk's momentum: rounding of some 1e3 steps
SLOWED = 1e-6               # of a disk's speed: a change that round-off cannot make
OVERLAP = 3.0 * sqrt(2.0)   # [cells] quadratic splines of two particles overlap within 3 per axis
PUBLISHED = {"pic": 8.004e6, "apic": 1.347e7, "flip": 1.365e7}      # [J/m] at 0.6 s; no MLS there


class CollisionHistory(NamedTuple):
    """History of a collision at S times."""

    t: np.ndarray           # (S,)    [s]
    speed: np.ndarray       # (S,)    of the first body's centre, relative to its first [1]
    kinetic: np.ndarray     # (S,)    [J], affine motion included
    elastic: np.ndarray     # (S,)    [J]
    momentum: np.ndarray    # (S, d)  of all bodies [kg m/s]
    particles: int

    @property
    def steps(self):
        """Return the number of steps."""
        return len(self.t) - 1

    @property
    def total(self):
        """Return the kinetic and elastic energy (S,) [J]."""
        return self.kinetic + self.elastic


def collision_history(scene):
    """Run a scene of bodies in free flight and measure after each step."""
    problem, rows = build(with_(scene, every=1, interval=None)), []
    with threads_for(problem.bodies):
        for frame in simulate(problem):
            bodies = frame.state.bodies
            E = energy(bodies, problem.gravity, problem.inertia)
            v = np.linalg.norm(mean(bodies[0], "v"))
            rows.append((frame.t, v, E.kinetic, E.elastic, momentum(bodies)))
    t, v, kinetic, elastic, p = map(np.array, zip(*rows, strict=True))
    return CollisionHistory(t, v / v[0], kinetic, elastic, p, particle_count(problem.bodies))


def energy_rows(transfer, c):
    """Return at most SHOWN rows (transfer, t, kinetic, elastic), energies relative."""
    return [(transfer, c.t[k], c.kinetic[k] / c.total[0], c.elastic[k] / c.total[0])
            for k in evenly(len(c.t), SHOWN)]


def touching_time():
    """Return when the two circles of the scene touch [s]: their gap over the closing speed."""
    (ax, ay), (bx, by) = (body.shape.center for body in catalogue_scene("colliding_disks").body)
    radius = catalogue_scene("colliding_disks").body[0].shape.radius
    return (hypot(bx - ax, by - ay) - 2.0 * radius) / closing_speed()


def closing_speed():
    """Return the relative speed of the two disks before they touch [m/s]."""
    (ux, uy), (vx, vy) = (body.velocity.linear for body in catalogue_scene("colliding_disks").body)
    return hypot(vx - ux, vy - uy)


def contact_time(c):
    """Return when the first disk first loses speed [s]."""
    return float(c.t[np.argmax(c.speed < 1.0 - SLOWED)])


@experiment("verification.disks", title="Colliding disks: momentum, energy, first contact",
            profiles=("quick", "standard"), budget={"quick": 6, "standard": 40})
def disks(run):
    """Run all transfers at dx = 0.05 to the end, MLS up to first contact on finer grids."""
    rows = []
    for transfer in run.progress(TRANSFERS, "transfers"):
        c = collision_history(catalogue_scene("colliding_disks", scheme=Scheme(transfer=transfer)))
        record_balances(run, transfer, c)
        rows += energy_rows(transfer, c)
        if run.choose(quick=False, standard=True):
            record_shorter_steps(run, transfer)
    run.table("energy", ("transfer", "t", "kinetic", "elastic"), rows)
    record_contact(run, run.choose(quick=(0.1, 0.05, 0.025), standard=(0.1, 0.05, 0.025, 0.0125)))


def record_balances(run, transfer, c):
    """Record momentum and energy of one transfer."""
    name = f"verification.disks.{transfer}"
    scale = f"{c.particles} particles, {c.steps} steps, dx = radius/4"
    one = c.total[0] / closing_speed()      # m v of one disk: m v^2 in all, closing speed is 2 v
    drift = np.abs(c.momentum).max() / (2.0 * one)
    run.record(f"{name}.momentum", drift, paper=0.0, comparator="<=", bound=ROUND_OFF, scale=scale,
               note="of one disk's; the sum of all forces on the grid is zero")
    run.record(f"{name}.energy_gain", float(c.total.max() / c.total[0] - 1.0), comparator="<=",
               bound=allowed_gain(c.elastic) / c.total[0] + ROUND_OFF, scale=scale,
               note="bound: half the largest change of elastic energy in a step, by which "
               "symplectic Euler's energy swings")
    run.record(f"{name}.energy_kept", float(c.total[-1] / c.total[0]), comparator="info",
               scale=scale, note=f"at t = {c.t[-1]:.3g} s, after the collision")


def record_shorter_steps(run, transfer, dt=0.0005):
    """Record the energy left with a quarter of the time step.

    The loss depends on the number of steps, but for FLIP.
    """
    c = collision_history(
        catalogue_scene("colliding_disks", dt=dt, scheme=Scheme(transfer=transfer)))
    run.record(f"verification.disks.{transfer}.energy_kept_short_dt",
               float(c.total[-1] / c.total[0]), comparator="info",
               scale=f"{c.particles} particles, {c.steps} steps, dx = radius/4",
               note="the same with a quarter of the time step: each transfer from particles to "
               "grid and back filters the velocity")


def record_contact(run, sizes):
    """Record the first contact against dx: early by a distance of the order of dx."""
    rows, exact = [], touching_time()
    for dx in run.progress(sizes, "first contact"):
        c = collision_history(catalogue_scene("colliding_disks", dx=dx, dt=0.04 * dx, end=exact))
        t = contact_time(c)
        rows.append((dx, t, (exact - t) * closing_speed(), c.particles))
    run.table("contact", ("dx", "t", "gap", "particles"), rows)
    dx, t, _, particles = rows[-1]
    scale = f"dx = {dx} m, {particles} particles; radius 0.2 m"
    early = OVERLAP * dx / closing_speed()
    run.record("verification.disks.contact_time", t, unit="s", paper=exact, comparator="band",
               bound=(exact - early, exact), scale=scale,
               note="grid contact begins where the splines of two particles overlap: at most "
               "3 sqrt(2) dx too early, never late")
    run.record("verification.disks.contact_order", order(sizes, [row[2] for row in rows]),
               paper=1.0, comparator="band", bound=(0.8, 1.3), scale=f"dx = {sizes}",
               note="gap at first contact against dx; the lattice leaves the edge of a disk "
               "uneven by up to dx/4, 1/10 of the gap, hence the band")


def ring_scene(dx, transfer):
    """Return the scene of the two rings, with 2 x 2 particles per cell."""
    bodies = tuple(ring(name, x, v) for name, x, v in (("left", -5.0, 30.0), ("right", 5.0, -30.0)))
    return Scene(dim=2, dx=dx, cfl=0.5, end=0.6, body=bodies, scheme=Scheme(transfer=transfer))


def ring(name, x, v):
    """Return one ring about (x, 0) that moves along x."""
    return Body(name=name, density=1000.0, sampling=Regular(per_cell=2),
                shape=Torus(center=(x, 0.0), major=3.5, minor=0.5),
                velocity=Velocity(linear=(v, 0.0)),
                material=Material(law="log_neo_hookean", E=1e8, nu=0.2))


@experiment("verification.rings", title="Colliding rings: energy kept by each transfer",
            profiles=("quick", "standard"), budget={"quick": 6, "standard": 200})
def rings(run):
    """Record the energy at 0.6 s for each transfer, and the order of the transfers."""
    dx = run.choose(quick=0.4, standard=0.1)
    rows, ratios = [], {}
    for transfer in run.progress(TRANSFERS, "transfers"):
        c = collision_history(ring_scene(dx, transfer))
        ratios[transfer] = float(c.total[-1] / c.total[0])
        run.record(f"verification.rings.{transfer}.energy", float(c.total[-1]), unit="J/m",
                   paper=PUBLISHED.get(transfer), comparator="info",
                   scale=f"dx = {dx} m, theirs 0.1 m, {c.particles} particles, {c.steps} steps",
                   note=f"of {c.total[0]:.4g} J/m at the start; the other number is what the "
                   "tests of Tesserae.jl hold for randomly placed particles")
        rows += energy_rows(transfer, c)
    run.table("energy", ("transfer", "t", "kinetic", "elastic"), rows)
    record_ranking(run, ratios, dx)


def record_ranking(run, ratios, dx):
    """Record the number of neighbours in the public code's order PIC < APIC < FLIP that hold here.

    ratios: final energy over initial energy, by transfer.
    """
    ours = sorted(ratios, key=ratios.get)
    published = sorted(PUBLISHED, key=PUBLISHED.get)
    pairs = list(pairwise(published))
    agree = sum(ratios[a] < ratios[b] for a, b in pairs)
    run.record("verification.rings.ranking", agree, paper=len(pairs), comparator="info",
               scale=f"dx = {dx} m, theirs 0.1 m",
               note=f"pairs of neighbours in the order {' < '.join(published)} of that code that "
               f"hold here; ours: {' < '.join(ours)}")
