"""Pieces that rest, tear, collide, fall; and nothing to do at all."""

import numpy as np

from mpm_ref.core.boundary import Collider, Conditions
from mpm_ref.core.levelset import half_space

from ..common.registry import experiment
from .hot_bodies import DX, FRAME, brick, elastic, gravity
from .hot_solve import METHODS, Setup, record_ends, table_of
from .hot_steps import Scene, all_of, march

CELLS = {2: (6, 6), 3: (4, 4, 4)}
KINDS = ("sticky", "slip", "separate")
GAP, SPEED = 1.5 * DX, 5.0          # between the pieces [m]; of each towards or from the other
MODULI = (1e2, 1e4, 1e6, 1e8, 1e10, 1e12)
WAYS = {"zero": {}, "gravity": {"start": "gravity"}, "held": {"displacement_tolerance": 1e-3}}


def floor(d, kind):
    """Conditions of a floor under the bodies."""
    return Conditions([Collider(half_space((0.0,) * d, (0.0, 1.0, 0.0)[:d]), kind=kind)])


def resting(d, E, kind):
    """`Setup` of a block that stands on a floor, unloaded at first."""
    return Setup((brick(CELLS[d], elastic(E)),), DX, FRAME, gravity(d), floor(d, kind))


def pair(d, E, gap, speed):
    """`Setup` of two blocks with these moduli, this gap between them, and this speed of each along
    the first axis, towards the other if positive; no gravity.
    """
    left, right = (brick(CELLS[d], elastic(modulus)) for modulus in E)
    right.particles.x[:, 0] += CELLS[d][0] * DX + gap
    left.particles.v[:, 0], right.particles.v[:, 0] = speed, -speed
    bodies = left._replace(name="left"), right._replace(name="right")
    return Setup(bodies, DX, FRAME / 2, (0.0,) * d)


def scenes_of(d, E, steps):
    """All scenes of pieces in a dimension at a modulus."""
    name = f"{d}d, E = {E:.0e}, "
    return [
        *(Scene(name + f"resting, {kind}", resting(d, E, kind), steps) for kind in KINDS),
        Scene(name + "torn", pair(d, (E, E), 0.0, -SPEED), steps),
        Scene(name + "collision", pair(d, (E, E), GAP, SPEED), steps),
        Scene(name + "collision of 1 : 1e4", pair(d, (E, 1e4 * E), GAP, SPEED), steps),
    ]


@experiment("extremes.hot.pieces", title="Resting, torn and colliding pieces",
            profiles=("quick", "standard"), budget={"quick": 3, "standard": 80})
def pieces(run):
    """Runs in which contact comes and goes."""
    scenes, steps = [], run.choose(quick=8, standard=24)
    for d in run.choose(quick=(2,), standard=(2, 3)):
        for E in run.choose(quick=(1e5,), standard=(1e4, 1e6, 1e8)):
            scenes += scenes_of(d, E, steps)
    rows = all_of(run.progress(scenes, "scenes"))
    record_ends(run, "pieces", [end for _, end in rows],
                f"blocks of 6 x 6 cells in 2D (3D: 4 x 4 x 4), {steps} steps")
    table_of(run, ("run",), rows)


@experiment("extremes.hot.nothing", title="No gravity, no velocity, no strain",
            profiles=("quick", "standard"), budget={"quick": 1, "standard": 1})
def nothing(run):
    """There is nothing to do: no iteration, and nothing moves."""
    for d in (2, 3):
        made = brick(CELLS[d], elastic(1e6))
        setup = Setup((made,), DX, FRAME, (0.0,) * d, floor(d, "separate"))
        ends = [march(setup, method, 3) for method in METHODS]
        scale = f"{d}D block on a floor, 3 steps, all methods"
        run.record(f"extremes.hot.nothing.{d}d.iterations", max(e.iterations for e, _ in ends),
                   paper=0, comparator="=", scale=scale, note="outer, at most")
        moved = max(float(np.abs(bodies[0].particles.x - made.particles.x).max() / DX)
                    for _, bodies in ends)
        run.record(f"extremes.hot.nothing.{d}d.moved", moved, comparator="<=", bound=1e-15,
                   scale=scale, note="way of any particle, in cells: none but for the round-off of "
                                     "positions")


@experiment("extremes.hot.fall", title="A free block of any stiffness must fall",
            profiles=("quick", "standard"), budget={"quick": 1, "standard": 1})
def fall(run):
    """Share of dt g that a block at rest takes up in its first step, for both starts, and from zero
    with an error of displacement to hold.
    """
    rows = []
    for name, options in WAYS.items():
        gained = []
        for E in MODULI:
            setup = Setup((brick(CELLS[2], elastic(E)),), DX, FRAME, gravity(2))
            end, bodies = march(setup, "hot", 1, **options)
            v = float(bodies[0].particles.v[:, 1].mean())
            gained.append(v / (FRAME * setup.gravity[1]))
            rows.append((name, E, gained[-1], end))
        still = [f"{E:.0e} Pa: {share:.3g}" for E, share in zip(MODULI, gained, strict=True)
                 if abs(share - 1.0) > 0.01]
        run.record(f"extremes.hot.fall.{name}", min(gained), paper=1.0, comparator="=",
                   tolerance=0.01, scale="2D block of 6 x 6 cells, E = 1e2 to 1e12 Pa, one step of "
                   "1/24 s", note="least share; HOT-eq9 measures impulses by the stiffness, so the "
                   "weight of a stiff block is below the tolerance: started from zero, as "
                   "printed, it hovers, in every step, unless the solve has to hold an error of "
                   "displacement"
                   + (f"; {', '.join(still)}" if still else ""))
    run.table("shares", ("way", "E", "share", *rows[0][-1]._fields),
              [(*case, *end) for *case, end in rows])
