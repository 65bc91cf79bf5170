"""Two elastic disks collide [Sulsky1994]: momentum, energy, and when they begin to touch."""

from math import hypot, sqrt

import numpy as np

from mpm_ref.scene import Scheme

from ..common.registry import experiment
from ..common.scenes import catalogue_scene
from .collision import TRANSFERS, collision_history, thinned
from .convergence import order
from .symplectic import allowed_gain

ROUND_OFF = 1e-12           # of one disk's momentum: rounding of some 1e3 steps
FELT = 1e-6                 # of a disk's speed: a change that round-off cannot make
REACH = 3.0 * sqrt(2.0)     # [cells] quadratic splines of two particles overlap within 3 per axis
SHOWN = 100


def touching_time():
    """When the two circles of the scene touch [s]: (distance - 2 radius)/(closing speed)."""
    (ax, ay), (bx, by) = (body.shape.center for body in catalogue_scene("colliding_disks").body)
    radius = catalogue_scene("colliding_disks").body[0].shape.radius
    return (hypot(bx - ax, by - ay) - 2.0 * radius) / closing_speed()


def closing_speed():
    """Relative speed of the two disks before they meet [m/s]."""
    (ux, uy), (vx, vy) = (body.velocity.linear for body in catalogue_scene("colliding_disks").body)
    return hypot(vx - ux, vy - uy)


def contact_time(c):
    """When the first disk first loses speed [s]."""
    return float(c.t[np.argmax(c.speed < 1.0 - FELT)])


@experiment("verification.disks", title="Colliding disks: momentum, energy, first contact",
            profiles=("quick", "standard"), budget={"quick": 6, "standard": 40})
def disks(run):
    """All transfers at dx = 0.05 to the end; MLS up to first contact on finer grids."""
    rows = []
    for transfer in run.progress(TRANSFERS, "transfers"):
        c = collision_history(catalogue_scene("colliding_disks", scheme=Scheme(transfer=transfer)))
        judge(run, transfer, c)
        rows += thinned(transfer, c, SHOWN)
        if run.choose(quick=False, standard=True):
            shorter_steps(run, transfer)
    run.table("energy", ("transfer", "t", "kinetic", "elastic"), rows)
    contact(run, run.choose(quick=(0.1, 0.05, 0.025), standard=(0.1, 0.05, 0.025, 0.0125)))


def judge(run, transfer, c):
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


def shorter_steps(run, transfer, dt=0.0005):
    """A quarter of the time step: what is lost depends on the number of steps, but for FLIP."""
    c = collision_history(
        catalogue_scene("colliding_disks", dt=dt, scheme=Scheme(transfer=transfer)))
    run.record(f"verification.disks.{transfer}.energy_kept_short_dt",
               float(c.total[-1] / c.total[0]), comparator="info",
               scale=f"{c.particles} particles, {c.steps} steps, dx = radius/4",
               note="the same with a quarter of the time step: each transfer from particles to "
               "grid and back filters the velocity")


def contact(run, sizes):
    """First contact against dx: early by a distance of the order of dx."""
    rows, exact = [], touching_time()
    for dx in run.progress(sizes, "first contact"):
        c = collision_history(catalogue_scene("colliding_disks", dx=dx, dt=0.04 * dx, end=exact))
        t = contact_time(c)
        rows.append((dx, t, (exact - t) * closing_speed(), c.particles))
    run.table("contact", ("dx", "t", "gap", "particles"), rows)
    dx, t, _, particles = rows[-1]
    scale = f"dx = {dx} m, {particles} particles; radius 0.2 m"
    early = REACH * dx / closing_speed()
    run.record("verification.disks.contact_time", t, unit="s", paper=exact, comparator="band",
               bound=(exact - early, exact), scale=scale,
               note="grid contact begins where the splines of two particles overlap: at most "
               "3 sqrt(2) dx too early, never late")
    run.record("verification.disks.contact_order", order(sizes, [row[2] for row in rows]),
               paper=1.0, comparator="band", bound=(0.8, 1.3), scale=f"dx = {sizes}",
               note="gap at first contact against dx; the lattice leaves the edge of a disk "
               "uneven by up to dx/4, 1/10 of the gap, hence the band")
