"""Implicit steps of pieces that rest, tear, collide, fall or have nothing to do, and of particles
too sparse for the grid.
"""

import numpy as np

from mpm_ref.core.boundary import Collider, Conditions
from mpm_ref.core.levelset import half_space

from ..common.registry import experiment
from .blocks import DX, FRAME, brick, elastic, gravity, one_particle, shake
from .hot_solve import (
    METHODS,
    StepSequence,
    StepSetup,
    record_solves,
    run_by_methods,
    run_steps,
    solve,
    solve_table,
)

CELLS = {2: (6, 6), 3: (4, 4, 4)}
KINDS = ("sticky", "slip", "separate")
GAP, SPEED = 1.5 * DX, 5.0          # between the pieces [m]; of each towards or from the other
MODULI = (1e2, 1e4, 1e6, 1e8, 1e10, 1e12)
START_OPTIONS = {"zero": {}, "gravity": {"start": "gravity"},
                 "held": {"displacement_tolerance": 1e-3}}


def floor(d, kind):
    """Return the conditions of a floor under the bodies."""
    return Conditions([Collider(half_space((0.0,) * d, (0.0, 1.0, 0.0)[:d]), kind=kind)])


def resting(d, E, kind):
    """Return the `StepSetup` of a block that stands on a floor, unloaded at first."""
    return StepSetup((brick(CELLS[d], elastic(E)),), DX, FRAME, gravity(d), floor(d, kind))


def pair(d, E, gap, speed):
    """Return the `StepSetup` of two blocks without gravity: their moduli, the gap between them, and
    the speed of each along the first axis, positive towards the other.
    """
    left, right = (brick(CELLS[d], elastic(modulus)) for modulus in E)
    right.particles.x[:, 0] += CELLS[d][0] * DX + gap
    left.particles.v[:, 0], right.particles.v[:, 0] = speed, -speed
    bodies = left._replace(name="left"), right._replace(name="right")
    return StepSetup(bodies, DX, FRAME / 2, (0.0,) * d)


def scenes_of(d, E, steps):
    """Return all scenes of pieces in a dimension at a modulus."""
    name = f"{d}d, E = {E:.0e}, "
    return [
        *(StepSequence(name + f"resting, {kind}", resting(d, E, kind), steps) for kind in KINDS),
        StepSequence(name + "torn", pair(d, (E, E), 0.0, -SPEED), steps),
        StepSequence(name + "collision", pair(d, (E, E), GAP, SPEED), steps),
        StepSequence(name + "collision of 1 : 1e4", pair(d, (E, 1e4 * E), GAP, SPEED), steps),
    ]


@experiment("extremes.hot.pieces", title="Resting, torn and colliding pieces",
            profiles=("quick", "standard"), budget={"quick": 3, "standard": 80})
def pieces(run):
    """Run steps in which contact comes and goes."""
    scenes, steps = [], run.choose(quick=8, standard=24)
    for d in run.choose(quick=(2,), standard=(2, 3)):
        for E in run.choose(quick=(1e5,), standard=(1e4, 1e6, 1e8)):
            scenes += scenes_of(d, E, steps)
    rows = run_by_methods(run.progress(scenes, "scenes"))
    record_solves(run, "pieces", [end for _, end in rows],
                f"blocks of 6 x 6 cells in 2D (3D: 4 x 4 x 4), {steps} steps")
    solve_table(run, ("run",), rows)


@experiment("extremes.hot.nothing", title="No gravity, no velocity, no strain",
            profiles=("quick", "standard"), budget={"quick": 1, "standard": 1})
def nothing(run):
    """Check that a block at rest takes no iteration and does not move."""
    for d in (2, 3):
        body = brick(CELLS[d], elastic(1e6))
        setup = StepSetup((body,), DX, FRAME, (0.0,) * d, floor(d, "separate"))
        ends = [run_steps(setup, method, 3) for method in METHODS]
        scale = f"{d}D block on a floor, 3 steps, all methods"
        run.record(f"extremes.hot.nothing.{d}d.iterations", max(e.iterations for e, _ in ends),
                   paper=0, comparator="=", scale=scale, note="outer, at most")
        distance = max(float(np.abs(bodies[0].particles.x - body.particles.x).max() / DX)
                       for _, bodies in ends)
        run.record(f"extremes.hot.nothing.{d}d.moved", distance, comparator="<=", bound=1e-15,
                   scale=scale, note="largest displacement of a particle, in cells: round-off of "
                                     "positions only")


@experiment("extremes.hot.fall", title="A free block of any stiffness must fall",
            profiles=("quick", "standard"), budget={"quick": 1, "standard": 1})
def fall(run):
    """Measure the share of dt g that a block at rest takes up in its first step, for both starts,
    and from zero with a tolerance of displacement.
    """
    rows = []
    for name, options in START_OPTIONS.items():
        shares = []
        for E in MODULI:
            setup = StepSetup((brick(CELLS[2], elastic(E)),), DX, FRAME, gravity(2))
            end, bodies = run_steps(setup, "hot", 1, **options)
            v = float(bodies[0].particles.v[:, 1].mean())
            shares.append(v / (FRAME * setup.gravity[1]))
            rows.append((name, E, shares[-1], end))
        still = [f"{E:.0e} Pa: {share:.3g}" for E, share in zip(MODULI, shares, strict=True)
                 if abs(share - 1.0) > 0.01]
        run.record(f"extremes.hot.fall.{name}", min(shares), paper=1.0, comparator="=",
                   tolerance=0.01, scale="2D block of 6 x 6 cells, E = 1e2 to 1e12 Pa, one step of "
                   "1/24 s", note="least share; HOT-eq9 measures impulses by the stiffness, so the "
                   "weight of a stiff block is below the tolerance: started from zero, as "
                   "printed, it hovers in every step, unless the solve has a tolerance of "
                   "displacement"
                   + (f"; {', '.join(still)}" if still else ""))
    run.table("shares", ("start", "E", "share", *rows[0][-1]._fields),
              [(*case, *end) for *case, end in rows])


SLIVER = 1e-12          # of a cell: how far a particle reaches into the support of its last nodes
DECADES = 8.0           # of the masses of dust


def sparse_bodies(d, E, rng):
    """Return {name: bodies} with few particles for the grid."""
    cells, law = {2: (12, 12), 3: (6, 6, 6)}[d], elastic(E)
    share = 10.0 ** -rng.uniform(0.0, DECADES, len(brick(cells, law).id))
    return {
        "one per cell": strained_body(brick(cells, law, per=1)),
        "one in two cells": strained_body(expanded(brick(cells, law, per=1), 2.0)),
        "isolated": strained_body(expanded(brick(cells, law, per=1), 5.0)),
        "dust": strained_body(rescaled(brick(cells, law), share, 1.0)),
        "grains": strained_body(rescaled(brick(cells, law), share, share)),
        "flakes": strained_body(rescaled(brick(cells, law), 1.0, share)),
        "scattered dust": strained_body(rescaled(expanded(brick(cells, law), 2.5), share, 1.0)),
        "sliver": (stretched(at_edge(d, law)),),
        "sliver on a block": (shake(brick(cells, law)), at_edge(d, law, cells[0])),
    }


def strained_body(body):
    """Return a single body, strained and in motion, as a tuple."""
    return (shake(body),)


def expanded(body, factor):
    """Scale the positions of a body, in place. Returns the body."""
    body.particles.x[:] *= factor
    return body


def rescaled(body, mass, volume):
    """Multiply masses and volumes of a body by factors (N,), in place. Returns the body."""
    body.particles.m[:] *= mass
    body.particles.V0[:] *= volume
    return body


def at_edge(d, law, cells=3):
    """Return a particle, past `cells` cells, whose last nodes have (SLIVER^2/2)^d of its mass."""
    x = [(cells + 0.5 + SLIVER) * DX] + [(1.5 + SLIVER) * DX] * (d - 1)
    return one_particle(x, DX, law, "apic")._replace(name="sliver")


def stretched(body):
    """Stretch a body by a tenth, in place. Returns the body."""
    body.particles.F[:] *= 1.1
    return body


@experiment("extremes.hot.sparse", title="One particle per cell, isolated ones, dust, tiny nodes",
            profiles=("quick", "standard"), budget={"quick": 2, "standard": 25})
def sparse(run):
    """Solve one step of 1/24 s of bodies with hardly any particles in a cell."""
    rows = []
    for d in run.choose(quick=(2,), standard=(2, 3)):
        for E in run.choose(quick=(1e4, 1e9), standard=(1e2, 1e4, 1e6, 1e9, 1e12)):
            for name, bodies in run.progress(sparse_bodies(d, E, run.rng).items(), "bodies"):
                setup = StepSetup(bodies, DX, FRAME, gravity(d))
                rows += [(d, E, name, solve(setup, method)) for method in METHODS]
    record_solves(run, "sparse", [row[-1] for row in rows], "12 x 12 cells in 2D (3D: 6 x 6 x 6), "
                f"1 to 576 particles; masses over {DECADES:g} decades, nodal ones over 48")
    solve_table(run, ("d", "E", "body"), rows)
