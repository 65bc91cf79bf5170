"""The clip of positions to a box, which a run has after its steps, on a tape of gradients."""

import numpy as np
import pytest
from adjoint_runs import along, line_of, loss, moved, seeds_of, taped, thrown
from adjoints import rate
from nclaw_toys import DT, problem_of, random_like, states, world_of
from problems import digest

from mpm_ref.nclaw import batched_step
from mpm_ref.tape import Seed, Tape

STEPS = 60
BOX = np.array((0.0, 0.12)), np.array((0.36, 1.0))      # [m] below and at the side it is reached
FINE = 6e-5 * 0.5 ** np.arange(4)


def clipped():
    """A jelly that falls through the box."""
    return thrown("jelly", 2, False)._replace(clip=BOX)


def seeds(seed=0):
    return seeds_of(clipped(), (20, STEPS), np.random.default_rng(seed))


def test_the_clip_is_reached_on_two_sides():
    run = clipped()
    loss(run, seeds())
    x = run.bodies[0].particles.x
    assert (x[:, 1] == BOX[0][1]).sum() > 3
    assert (x[:, 0] == BOX[1][0]).sum() > 3
    assert (BOX[0] <= x).all()
    assert (x <= BOX[1]).all()


def test_remainder_is_of_second_order():
    run = clipped()
    line, weights = line_of(run, np.random.default_rng(1)), seeds()
    slope = along(taped(moved(run, line, 0.0), weights), line)
    order = rate(lambda h: loss(moved(run, line, h), weights), slope, FINE)
    assert order == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("every", [1, 7])
def test_a_taped_run_is_the_run(every):
    """Steps that are made anew are clipped too."""
    run, other = clipped(), clipped()
    loss(run, seeds())
    found = taped(other, seeds(), every)
    assert digest(run.bodies) == digest(other.bodies)
    assert np.array_equal(found.bodies[0].x, taped(clipped(), seeds()).bodies[0].x)


@pytest.mark.parametrize("place", ["low", "high"])
def test_gradients_are_those_of_bodies_apart(place, rng):
    """`nclaw.batched_step` has an adjoint of its own of a step with its clip, in 3D."""
    before, problem = states((place,), 12), problem_of(states((place,), 12), 0)
    of, stepper, q = world_of(before), problem.stepper(), problem.bodies[0].particles
    stepper.start(problem.bodies)
    before = before._replace(tau=q.tau[None].copy())
    tape = Tape(stepper, problem.bodies, clip=problem.clip)
    tape.step(0.0, DT)
    after = batched_step.advance(of, before, batched_step.make_nodes(of, 1))
    assert ((q.x == problem.clip[0]) | (q.x == problem.clip[1])).any()
    assert q.x == pytest.approx(after.x[0], abs=1e-14)
    bars = random_like(after, rng)
    expected = batched_step.pull_back(of, before, after, bars, batched_step.make_nodes(of, 1))
    found, = tape.gradient({1: [Seed(*(a[0] for a in bars[:4]))]}).bodies
    for name in "xvC":
        a, b = getattr(found, name), getattr(expected, name)[0]
        assert abs(a - b).max() <= 1e-11 * abs(b).max()


@pytest.mark.parametrize("box", [
    ((0.0, 0.1),), ((0.0, 0.1, 0.0), (1.0, 1.0, 1.0)), ((0.0, 0.1), (1.0, 0.1)), (0.0, 1.0),
    ((0.0, np.nan), (1.0, 1.0)),
])
def test_what_is_no_box_is_refused(box):
    run = clipped()._replace(clip=box)
    with pytest.raises(ValueError, match=r"clip = .*: expected \(low, high\), two positions with 2 "
                                         "coordinates each, low < high"):
        taped(run, {1: [None]})
