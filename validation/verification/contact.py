"""Contact of bodies with each other: impact, sliding, rolling, a stack, and a pressed disk.

*impact*: two equal disks meet head-on. By symmetry each moves as one that meets a frictionless wall
in the middle: runs with that wall, whose condition holds at its surface, extrapolated from two
grids, are the estimate of speed and duration. Two unequal disks that meet off their axis, and rub,
keep momentum and its moment.
*slide*: a block that slides on a block is slowed by mu g. *hold*: on a slope of less than the angle
of friction it rests.
*roll*: a solid disk that rolls on a plane of slope theta has the acceleration (2/3) g sin(theta).
*stack*: two blocks at rest between slip walls are a column; at the height y it sinks by
rho g (H y - y^2/2)/(lam + 2 mu).
*press*: a disk under its weight P on a block of the same material touches it over the half width b,
b^2 = 8 P R (1 - nu^2)/(pi E), with the pressure 2 P/(pi b) sqrt(1 - x^2/b^2), whose second moment
is b^2/4 [Johnson1985].

Bodies come to rest by damping before they are measured.
"""

from math import ceil, cos, degrees, pi, radians, sin, sqrt
from typing import NamedTuple

import numpy as np

from mpm_ref.body_contact import BodyContact, ContactStepper
from mpm_ref.core.boundary import BoxWalls, Collider, Conditions
from mpm_ref.core.levelset import half_space
from mpm_ref.core.surface import SurfaceConditions
from mpm_ref.energy import angular_momentum, momentum
from mpm_ref.explicit import Scheme, Stepper
from mpm_ref.materials import FixedCorotated, lame, stiffness

from ..common.registry import experiment
from ..common.scenes import mean, threads_for
from .lattice import body, lattice

E, NU, RHO, G = 1e6, 0.3, 1000.0, 10.0
LAW = FixedCorotated(*lame(E, NU))
SOUND = sqrt(stiffness(LAW) / RHO)
CFL = 0.4               # of the time in which sound crosses a cell
PER = 2                 # particles per cell and direction
RUBBING = 0.3           # coefficient of friction of the block that slides
HELD, SLOPE = 12.0, 20.0        # slopes on which a block rests and a disk rolls [degrees]
STIFFER = 4.0                   # times E: of the disk that rolls, compared with a rigid one


# bodies and steps

def block(name, lower, upper, spacing, law=LAW):
    """Return a block between two corners [m] of particles with a spacing [m]."""
    return named(name, lattice(lower, upper, spacing), spacing, law)


def disk(name, center, radius, spacing, law=LAW):
    """Return a disk whose lattice is centred, with the mass of the circle."""
    X = lattice([-radius, -radius], [radius, radius], spacing)
    one = named(name, np.asarray(center) + X[np.hypot(*X.T) <= radius], spacing, law)
    share = pi * radius**2 / one.particles.V0.sum()
    one.particles.V0[:] *= share
    one.particles.m[:] *= share
    return one


def named(name, X, spacing, law):
    """Return a body at rest of particles at X (N, 2)."""
    return body(X, spacing, RHO, law, "mls")._replace(name=name)


def touching(dx, gravity, mu=0.0, conditions=None):
    """Return the stepper of the bodies "lower" and "upper" in contact under gravity (2,)
    [m/s^2].
    """
    contact = BodyContact(("lower", "upper"), mu)
    return ContactStepper((contact,), Scheme(), dx, np.asarray(gravity), conditions)


def fixed_base(dx):
    """Return the condition that holds the lowest nodes, those at y <= 0."""
    return Conditions(walls=BoxWalls((None, 1), (None, None), "sticky"))


def sound(one):
    """Return the speed of compression waves in a body [m/s]."""
    return sqrt(stiffness(one.law) / RHO)


def move(bodies, stepper, duration):
    """Yield the time [s] after each step of a run."""
    steps = ceil(duration * sound(bodies[0]) / (CFL * stepper.dx))
    dt = duration / max(steps, 1)
    with threads_for(bodies):
        for k in range(steps):
            stepper.step(bodies, k * dt, dt)
            yield (k + 1) * dt


def settle(bodies, stepper, length, waits=8.0):
    """Bring bodies of a size [m] to rest, by damping of their lowest mode."""
    omega, before = 0.5 * pi * sound(bodies[0]) / length, 0.0
    stepper.start(bodies)
    for t in move(bodies, stepper, waits / omega):
        keep, before = 1.0 - 2.0 * omega * (t - before), t
        for one in bodies:
            one.particles.v[:] *= keep
            one.particles.C[:] *= keep


# the cases

class Impact(NamedTuple):
    """The measures of a head-on impact of two disks."""

    restitution: float  # speed afterwards over speed before
    duration: float     # [s] in which the middle 0.96 of the change of speed comes about
    gap: float          # between the circles at the first change [cells]


SPEED = 0.04 * SOUND
FAR = 1.6               # cells between the circles at the start
CHANGED = 1e-3          # of the speed: what is seen of a contact


def impact(cells, kind="separate"):
    """Return the `Impact` of two disks of 1 m, so many cells, in a contact of a kind; or of one
    with a "wall".
    """
    dx = 1.0 / cells
    right = disk("right", (1.0 + 0.5 * FAR * dx, 0.0), 1.0, dx / PER)
    bodies, stepper = [right], Stepper(Scheme(), dx, 2, np.zeros(2), SurfaceConditions(
        (Collider(half_space((0.0, 0.0), (1.0, 0.0)), "separate"),)))
    if kind != "wall":
        bodies = [disk("left", (-1.0 - 0.5 * FAR * dx, 0.0), 1.0, dx / PER), right]
        contact = BodyContact(("left", "right"), kind=kind)
        stepper = ContactStepper((contact,), Scheme(), dx, np.zeros(2))
        bodies[0].particles.v[:, 0] = SPEED
    right.particles.v[:, 0] = -SPEED
    stepper.start(bodies)
    times = np.array([(t, mean(right, "x")[0], mean(right, "v")[0])
                      for t in move(bodies, stepper, FAR * dx / SPEED + 12.0 / SOUND)])
    t, x, v = times.T
    first = np.argmax(v > -SPEED * (1.0 - CHANGED))
    share = (v - v[0]) / (v[-1] - v[0])
    duration = t[np.argmax(share > 0.98)] - t[np.argmax(share > 0.02)]
    return Impact(v[-1] / SPEED, duration, 2.0 * (x[first] - 1.0) / dx)


class Drift(NamedTuple):
    """Changes of sums over two disks, over those of one of them."""

    momentum: float
    moment: float       # of momentum, with the spin of the particles


def graze(cells):
    """Return the `Drift` of a disk of 1 m, so many cells, and a small one of three times its
    density that meet off their axis, and rub.
    """
    dx = 1.0 / cells
    large = disk("large", (0.0, 0.0), 1.0, dx / PER)
    small = disk("small", (1.3, 0.9), 0.6, dx / PER)
    small.particles.m[:] *= 3.0
    large.particles.v[:], small.particles.v[:] = (SPEED, 0.3 * SPEED), (-SPEED, 0.1 * SPEED)
    bodies, contact, rows = [large, small], BodyContact(("large", "small"), RUBBING), []
    stepper = ContactStepper((contact,), Scheme(), dx, np.zeros(2))
    stepper.start(bodies)
    for duration in (0.0, 4.0 / SOUND):
        list(move(bodies, stepper, duration))
        rows.append([[*momentum(chosen), *angular_momentum(chosen, 0.25 * dx**2)]
                     for chosen in (bodies, bodies[:1])])
    both, one = np.abs(np.subtract(*rows))
    return Drift(both[:2].max() / one[:2].max(), both[2] / one[2])


def before_wall(cells):
    """Return restitution and duration of the impact of a disk on a wall, extrapolated to dx = 0
    from the grids of cells/2 and cells, with errors in dx.
    """
    coarse, fine = (impact(n, "wall") for n in (cells // 2, cells))
    return 2.0 * fine.restitution - coarse.restitution, 2.0 * fine.duration - coarse.duration


def upon_block(cells, theta=0.0):
    """Return a block of 0.8 m on a longer block, at rest on a slope of angle theta, and their
    stepper; cells to the length of the upper one.
    """
    dx = 0.8 / cells
    lower = block("lower", (0.0, 0.0), (2.4, 0.4), dx / PER)
    upper = block("upper", (0.4, 0.4), (1.2, 0.8), dx / PER)
    stepper = touching(dx, (G * sin(theta), -G * cos(theta)), RUBBING, fixed_base(dx))
    settle([lower, upper], stepper, 0.8)
    return [lower, upper], stepper


def slide(cells):
    """Return the deceleration of a sliding block over mu g, less 1."""
    bodies, stepper = upon_block(cells)
    bodies[1].particles.v[:, 0] += 1.2
    rows = np.array([(t, mean(bodies[1], "v")[0]) for t in move(bodies, stepper, 0.3)])
    late = rows[:, 0] > 0.05
    return -np.polyfit(*rows[late].T, 1)[0] / (RUBBING * G) - 1.0


def hold(cells):
    """Return the way up or down of a block that friction holds, over that without friction."""
    theta, duration = radians(HELD), 0.5
    bodies, stepper = upon_block(cells, theta)
    start = mean(bodies[1], "x")[0] - mean(bodies[0], "x")[0]
    for _ in move(bodies, stepper, duration):
        pass
    end = mean(bodies[1], "x")[0] - mean(bodies[0], "x")[0]
    return abs(end - start) / (0.5 * G * sin(theta) * duration**2)


def roll(cells, per):
    """Return the way of a disk that rolls down a slope, over that of a rigid one, less 1; cells to
    its radius of 0.4 m, `per` particles in each and direction.
    """
    dx, theta, radius, duration = 0.4 / cells, radians(SLOPE), 0.4, 0.6
    law = FixedCorotated(*lame(STIFFER * E, NU))
    lower = block("lower", (0.0, 0.0), (1.6, 0.2), dx / per, law)
    upper = disk("upper", (0.5, 0.2 + radius), radius, dx / per, law)
    down = G * np.array([sin(theta), -cos(theta)])
    stepper = touching(dx, (0.0, down[1]), 0.5, fixed_base(dx))
    settle([lower, upper], stepper, 0.8)
    start, stepper.gravity = mean(upper, "x")[0], down
    list(move([lower, upper], stepper, duration))
    return (mean(upper, "x")[0] - start) / (down[0] / 3.0 * duration**2) - 1.0


class StackErrors(NamedTuple):
    """Errors of a stack of two blocks [cells]."""

    depth: float        # of the upper face of the lower block
    gap: float          # between both faces


def stack(cells, offset, fall=0.4):
    """Return the `StackErrors` of two blocks of 0.5 m, whose faces lie `offset` cells above nodes;
    the upper one has fallen by `fall` cells.
    """
    dx, height = 0.5 / cells, 1.0
    lower = block("lower", (0.0, offset * dx), (0.8, 0.5 + offset * dx), dx / PER)
    upper = block("upper", (0.0, (offset + cells + fall) * dx), (0.8, 1.0 + (offset + fall) * dx),
                  dx / PER)
    floor = Collider(half_space((0.0, offset * dx), (0.0, 1.0)), "slip")
    sides = (Collider(half_space((0.0, 0.0), (1.0, 0.0)), "slip"),
             Collider(half_space((0.8, 0.0), (-1.0, 0.0)), "slip"))
    stepper = touching(dx, (0.0, -G), conditions=SurfaceConditions((floor, *sides)))
    Y = [one.particles.x[:, 1].copy() for one in (lower, upper)]
    settle([lower, upper], stepper, height, 40.0)
    half, y0 = 0.5 * dx / PER, 0.5 - 0.5 * dx / PER
    top = np.isclose(Y[0], Y[0].max(), atol=0.1 * dx)
    bottom = np.isclose(Y[1], Y[1].min(), atol=0.1 * dx)
    sunk = [-RHO * G * (height * y - 0.5 * y**2) / stiffness(LAW) for y in (y0, y0 + 2.0 * half)]
    ends = (lower.particles.x[top, 1].mean(), upper.particles.x[bottom, 1].mean())
    depth = ends[0] - Y[0].max() - sunk[0]
    return StackErrors(depth / dx, (ends[1] - ends[0] - 2.0 * half - sunk[1] + sunk[0]) / dx)


class LoadedNodes(ContactStepper):
    """A `ContactStepper` that notes the loads of its nodes in the last step."""

    def touch(self, parts, dt):
        """Change the velocities by contact, and note the impulses on the last field."""
        grid = parts[-1][0]
        before = grid.v.copy()
        super().touch(parts, dt)
        self.load = grid.m * (grid.v - before)[..., 1]
        self.x = (grid.origin[0] + np.arange(grid.m.shape[0])) * self.dx


def press(cells, share):
    """Return the half width of contact over Hertz's, less 1, and the load over the weight, less 1;
    cells to a radius of 0.5 m; share: the half width over the radius.
    """
    R, dx = 0.5, 0.5 / cells
    lower = block("lower", (-0.8, 0.0), (0.8, 0.8), dx / PER)
    upper = disk("upper", (0.0, 0.8 + R), R, dx / PER)
    P = pi * E * (share * R)**2 / (8.0 * R * (1.0 - NU**2))
    weight = P / (RHO * pi * R**2)
    stepper = LoadedNodes((BodyContact(("lower", "upper")),), Scheme(), dx,
                          np.array([0.0, -weight]), fixed_base(dx))
    settle([lower, upper], stepper, 1.8)
    rows = [(t, stepper.load.sum(axis=1)) for t in move([lower, upper], stepper, 0.1)]
    load = np.sum([row for _, row in rows], axis=0)
    b = half_width(stepper.x, load, dx)
    return b / (share * R) - 1.0, load.sum() / rows[-1][0] / P - 1.0


def half_width(x, load, dx):
    """Return the half width [m] of a pressure like Hertz's from its loads (K,) at nodes x (K,) [m]
    of spacing dx, over which quadratic splines, of the second moment dx^2/4, have spread it.
    """
    r = x - load @ x / load.sum()
    return 2.0 * sqrt(max(load @ r**2 / load.sum() - 0.25 * dx**2, 0.0))


# the experiment

@experiment("verification.contact", title="Contact of bodies: impact, slide, roll, stack, press",
            profiles=("quick", "standard"), budget={"quick": 6, "standard": 120})
def contact(run):
    """Record each case on a coarse grid, or on finer ones too."""
    record_impact(run, run.choose(quick=(16,), standard=(8, 16, 32)))
    record_blocks(run, run.choose(quick=(8,), standard=(8, 16, 32)))
    record_rolling(run, run.choose(quick=(8,), standard=(8, 16, 32)))
    record_stack(run, run.choose(quick=(5,), standard=(5, 10)))
    record_pressed(run, run.choose(quick=(16,), standard=(16, 32)))


def record(run, name, value, **rule):
    """Record a number of the experiment."""
    run.record(f"verification.contact.{name}", float(value), **rule)


def band(error):
    """Return the rule that a relative error is within +- `error`."""
    return {"paper": 0.0, "comparator": "band", "bound": (-error, error)}


def at_most(bound):
    """Return the rule that a number is not above a bound."""
    return {"paper": 0.0, "comparator": "<=", "bound": bound}


def record_impact(run, sizes):
    """Record speed, duration and first distance of two disks; and of disks that stick."""
    found = [impact(n) for n in sizes]
    one, scale = found[-1], f"{sizes[-1]} cells to the radius, {SPEED / SOUND:g} of sound each"
    speed, duration = before_wall(sizes[-1])
    for name, value in graze(sizes[-1])._asdict().items():
        record(run, f"impact.{name}", value, **at_most(1e-12),
               scale=f"{sizes[-1]} cells to the radius of a disk that a small, heavy one grazes",
               note="drift over what the disks exchange; impulses are opposite, at one point")
    record(run, "impact.restitution", one.restitution / speed - 1.0, **band(0.02), scale=scale,
           note=f"of speed, against {speed:.4g} of a disk before a wall at its "
                "surface, extrapolated; bound: an aim")
    record(run, "impact.duration", one.duration / duration - 1.0, **band(0.05), scale=scale,
           note=f"against {duration:.4g} s before that wall; bound: an aim")
    record(run, "impact.gap", abs(one.gap), unit="dx", **at_most(0.1), scale=scale,
           note="between the circles when speeds first change by 0.1 %; bound: an aim, a fifth of "
                "the spacing of particles")
    glued = impact(sizes[-1], "stick")
    record(run, "impact.stick.gap", glued.gap, unit="dx", comparator="info", scale=scale,
           note='the same with kind = "stick", as in one field')
    run.table("impact", ("cells", "restitution", "duration", "gap"),
              [(n, *row) for n, row in zip(sizes, found, strict=True)])


def record_blocks(run, sizes):
    """Record a block that slides, and one that friction holds."""
    rows = [(n, slide(n), hold(n)) for n in run.progress(sizes, "blocks")]
    scale = f"{sizes[-1]} cells to the length of 0.8 m"
    record(run, "slide.deceleration", rows[-1][1], **band(0.01), scale=scale,
           note=f"against mu g, mu = {RUBBING}, fitted to speeds of 0.25 s; bound: an aim")
    record(run, "hold.way", rows[-1][2], **at_most(0.01), scale=scale,
           note=f"on a slope of {HELD:g} degrees, over the way without friction; the angle of "
                f"friction is {degrees(np.arctan(RUBBING)):.3g} degrees; bound: an aim")
    run.table("blocks", ("cells", "deceleration", "way"), rows)


def record_rolling(run, sizes):
    """Record the way of a disk that rolls down a slope, with two and three particles a cell."""
    rows = [(n, per, roll(n, per)) for per in (2, 3) for n in run.progress(sizes, "rolling")]
    for per in (2, 3):
        error = next(row[2] for row in rows if row[:2] == (sizes[-1], per))
        record(run, f"roll.way.{per}", error, **band(0.02),
               scale=f"{sizes[-1]} cells to the radius, {per} particles a cell and direction, "
                     f"E = {STIFFER * E:g} Pa",
               note=f"after 0.6 s on a slope of {SLOPE:g} degrees, against g sin(theta) t^2/3 of a "
                    "rigid disk; bound: an aim")
    run.table("roll", ("cells", "per direction", "way"), rows)


def record_stack(run, sizes):
    """Record the interface of two blocks at rest, the worst over where it lies in a cell."""
    offsets = run.choose(quick=(0.0, 0.5), standard=(0.0, 0.3, 0.5, 0.8))
    rows = [(n, offset, *stack(n, offset)) for n in sizes for offset in offsets]
    worst = np.abs([row[2:] for row in rows if row[0] == sizes[-1]]).max(axis=0)
    scale = f"{sizes[-1]} cells to each block, the upper one falls on the lower"
    record(run, "stack.depth", worst[0], unit="dx", **at_most(0.01), scale=scale,
           note="of the lower face against the exact compression, the largest over offsets; bound: "
                "an aim")
    record(run, "stack.gap", worst[1], unit="dx", **at_most(0.05), scale=scale,
           note="gap or overlap at rest; bound: an aim, a tenth of the spacing of particles")
    run.table("stack", ("cells", "offset", "depth", "gap"), rows)


def record_pressed(run, sizes):
    """Record the half width of a pressed disk."""
    shares = run.choose(quick=(0.3,), standard=(0.1, 0.2, 0.3))
    rows = [(n, share, share * n, *press(n, share)) for n in sizes for share in shares]
    n, _, cells, width, load = rows[-1]
    scale = f"{n} cells to the radius, half width {cells:.3g} cells"
    record(run, "press.half_width", width, **band(0.05), scale=scale,
           note="against Hertz, for small b/R; from the second moment of the loads of nodes, less "
                "that of the spline; a disk on a lattice of spacing h has a flat foot of the half "
                "width sqrt(R h), which rules a smaller b (table); bound: an aim")
    record(run, "press.load", load, **band(0.02), scale=scale,
           note="sum of the loads over the weight of the disk, less 1; bound: an aim")
    run.table("press", ("cells", "share", "half width", "error", "load"), rows)
