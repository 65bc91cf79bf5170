"""Sources and sinks: a jet in free fall, and a jet of water that hits a plate.

What enters less what left is in the run. A jet without strength leaves the source with v0 and falls
freely, v^2 = v0^2 + 2 g h, so that a sink at depth H below takes rho A v0 in the steady state, and
rho A v0 t_H are in flight, t_H = (sqrt(v0^2 + 2 g H) - v0)/g. A steady jet of water whose momentum
is all turned aside by a smooth plate pushes it with rho A v0^2.
"""

from dataclasses import replace
from math import sqrt
from typing import NamedTuple

import numpy as np

from mpm_ref.scene import build, loads
from mpm_ref.simulate import simulate
from mpm_ref.sweep.conditions import ImpulseRecorder

from ..common.registry import experiment
from ..common.scenes import evenly, threads_for

RHO, G, V0 = 1000.0, 9.8, 1.0       # [kg/m^3], [m/s^2], [m/s]
WIDTH, FALL = 0.2, 1.0              # of the jet, and from the source to the sink [m]
TOP = 2.0                           # of the source [m]
SOUND = 10.0                        # of the water over the jet's speed
ROWS = 500                          # of particles in the table, for each integrator
INTEGRATORS = {"explicit": "", "implicit": 'integrator = "hot"\nlongest = 0.01'}
ROUND_OFF = 1e-12

FALLING = """
dim = 2
dx = {dx}
end = {end}
interval = {interval}
gravity = [0.0, -{g}]
{keys}

[[body]]
name = "jet"
density = {rho}
shape = {{ type = "box", lower = [0.0, {low}], upper = [{width}, {top}] }}
velocity = {{ linear = [0.0, -{v}] }}
material = {{ law = "fixed_corotated", E = 1e-3, nu = 0.0 }}
source = {{ }}

[[sink]]
shape = {{ type = "half_space", point = [0.0, {bottom}], normal = [0.0, 1.0] }}

[limits]
J = [1e-3, 1e6]
"""

HITTING = """
dim = 2
dx = {dx}
end = {end}
interval = {interval}

[[body]]
name = "water"
density = {rho}
shape = {{ type = "box", lower = [-{half}, {low}], upper = [{half}, {top}] }}
velocity = {{ linear = [0.0, -{v}] }}
material = {{ law = "fluid", lam = {lam} }}
source = {{ }}

[[collider]]
shape = {{ type = "half_space", point = [0.0, 0.0], normal = [0.0, 1.0] }}
kind = "separate"

[[sink]]
shape = {{ type = "half_space", point = [-{side}, 0.0], normal = [1.0, 0.0] }}

[[sink]]
shape = {{ type = "half_space", point = [{side}, 0.0], normal = [-1.0, 0.0] }}
"""


class Jet(NamedTuple):
    """A jet in free fall at the times at which blocks enter, in its steady state."""

    h: np.ndarray           # (P,) depth of particles below the source [m]
    v: np.ndarray           # (P,) their speed [m/s]
    mass: np.ndarray        # (T,) in the run [kg]
    gone: np.ndarray        # (T,) taken by the sink so far [kg]
    t: np.ndarray           # (T,) [s]
    gap: float              # largest error of the balance of mass, relative
    particles: int          # at the end


class CountingSink:
    """A sink that counts the particles that it takes."""

    def __init__(self, sink):
        self.sink, self.taken = sink, 0

    def holds(self, x):
        """Return which of the points x (N, d) are in the sink, and count them."""
        inside = self.sink.holds(x)
        self.taken += int(inside.sum())
        return inside


def fall_time():
    """Return the time in which matter falls from the source to the sink [s]."""
    return (sqrt(V0**2 + 2.0 * G * FALL) - V0) / G


def falling(cells, keys):
    """Run a jet of so many cells across by the integrator of some keys; return its `Jet`."""
    dx = WIDTH / cells
    length = 2.0 * dx
    end = fall_time() + 0.3 + 10.0 * length / V0
    text = FALLING.format(dx=dx, end=end, interval=length / V0, g=G, keys=keys, rho=RHO, v=V0,
                          width=WIDTH, top=TOP, low=TOP - length, bottom=TOP - length - FALL)
    problem, rows, points = build(loads(text)), [], []
    (source,), (counter,) = problem.sources, map(CountingSink, problem.sinks)
    block = float(source.block.particles.m.sum())
    with threads_for(problem.bodies):
        for frame in simulate(replace(problem, sinks=(counter,))):
            (body,), entered = frame.state.bodies, source.due(frame.t)
            mass = float(body.particles.m.sum())
            gone = block * counter.taken / len(source.block.id)
            rows.append((frame.t, mass, gone, abs(entered * block - gone - mass) / mass))
            if frame.t > fall_time() + 0.2:
                points.append((TOP - length - body.particles.x[:, 1], -body.particles.v[:, 1]))
    t, mass, gone, gap = np.array(rows)[:-1].T
    steady = t > fall_time() + 0.2
    return Jet(*(np.concatenate(a) for a in zip(*points, strict=True)), mass[steady], gone[steady],
               t[steady], float(gap.max()), len(body.id))


class Hit(NamedTuple):
    """A jet of water on a plate, over the second half of a run."""

    t: np.ndarray           # (T,) [s]
    force: np.ndarray       # (T,) mean over a frame [N]
    rate: float             # mass that the sinks took [kg/s]
    particles: int          # at the end


def hitting(cells, end):
    """Run a jet of water of so many cells across that hits a plate; return its `Hit`."""
    dx = WIDTH / cells
    lam, low = RHO * (SOUND * V0) ** 2, 2.0 * WIDTH
    text = HITTING.format(dx=dx, end=end, interval=0.05, rho=RHO, v=V0, half=0.5 * WIDTH,
                          low=low, top=low + 2.0 * dx, lam=lam, side=4.0 * WIDTH)
    problem, rows = build(loads(text)), []
    recorder = ImpulseRecorder(problem.conditions, ("plate", "source"), 2)
    (source,) = problem.sources
    with threads_for(problem.bodies):
        for frame in simulate(replace(problem, conditions=recorder)):
            (body,) = frame.state.bodies
            gone = source.due(frame.t) * len(source.block.id) - len(body.id)
            rows.append((frame.t, recorder.impulses()["plate"][1],
                         gone * source.block.particles.m[0]))
    t, J, gone = np.array(rows).T
    late = t > 0.5 * end
    span = t[late][-1] - t[late][0]
    return Hit(t[1:], np.diff(J) / np.diff(t), float((gone[late][-1] - gone[late][0]) / span),
               len(body.id))


@experiment("verification.pour", title="Sources and sinks: a falling jet, and a jet on a plate",
            profiles=("quick", "standard"), budget={"quick": 3, "standard": 15})
def pour(run):
    """Record the balance of mass, the speed of a falling jet and the force of one on a plate."""
    rows = []
    for name in run.progress(INTEGRATORS, "integrators"):
        cells = run.choose(quick=4, standard=16)
        jet = falling(cells, INTEGRATORS[name])
        record_falling(run, name, cells, jet)
        shown = evenly(len(jet.h), ROWS)
        rows += [(name, *row) for row in zip(jet.h[shown], jet.v[shown], strict=True)]
    run.table("fall", ("integrator", "h", "v"), rows)
    cells, end = run.choose(quick=(4, 2.0), standard=(16, 4.0))
    record_hitting(run, cells, hitting(cells, end))


def record_falling(run, name, cells, jet):
    """Record balance, speed and mass of a jet in free fall by an integrator."""
    dx = WIDTH / cells
    scale = f"{jet.particles} particles, dx = {dx:g} m, {name}"
    run.record(f"verification.pour.{name}.balance", jet.gap, comparator="<=", bound=ROUND_OFF,
               scale=scale, note="what entered less what left less what is there, relative")
    gain, place = speed_gain(jet, dx)
    run.record(f"verification.pour.{name}.gain", abs(gain / (2.0 * G) - 1.0), comparator="<=",
               bound=dx / FALL, scale=scale,
               note="slope of v^2 over the depth against 2 g; a cell of the fall is allowed, since "
               "where the source lets go is known to a cell")
    run.record(f"verification.pour.{name}.place", abs(place) / dx, comparator="<=", bound=1.0,
               scale=scale, note="cells between the end of the source and where free fall begins")
    rate = (jet.gone[-1] - jet.gone[0]) / (jet.t[-1] - jet.t[0]) / (RHO * WIDTH * V0)
    run.record(f"verification.pour.{name}.rate", abs(rate - 1.0), comparator="<=",
               bound=0.25 / (len(jet.t) - 1), scale=scale,
               note="mass that the sink takes against rho A v0; a row of a block is allowed")
    still = 2.0 * dx + V0 * fall_time()
    run.record(f"verification.pour.{name}.mass", abs(jet.mass.mean() / (RHO * WIDTH * still) - 1.0),
               comparator="<=", bound=1.5 * dx / still, scale=scale,
               note="mass in flight as a block has entered, against rho A (L + v0 t_H); a cell and "
               "a row of the jet are allowed")


def speed_gain(jet, dx):
    """Return the slope of v^2 over the depth [m/s^2] between the third cell and the sink, and the
    depth [m] at which that line has v0.
    """
    below = (jet.h > 3.0 * dx) & (jet.h < FALL)
    gain, start = np.polyfit(jet.h[below], jet.v[below] ** 2, 1)
    return float(gain), float((V0**2 - start) / gain)


def record_hitting(run, cells, hit):
    """Record the force on the plate over the second half of the run."""
    late = hit.t > 0.5 * hit.t[-1]
    force = float(hit.force[late].mean()) / (RHO * WIDTH * V0**2)
    scale = f"{hit.particles} particles, dx = {WIDTH / cells:g} m, sound {SOUND:g} v0"
    run.record("verification.pour.plate.force", abs(force - 1.0), comparator="<=",
               bound=0.5 / cells, scale=scale,
               note="mean force against rho A v0^2; half a cell of the width of the jet is allowed")
    run.record("verification.pour.plate.rate", hit.rate / (RHO * WIDTH * V0), comparator="info",
               scale=scale, note="mass that the sinks take against rho A v0")
    run.table("force", ("t", "force"), np.column_stack([hit.t, hit.force]).tolist())
