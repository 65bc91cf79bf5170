"""Steps of bodies that never meet: they are those of `explicit`, and so are their adjoints."""

from dataclasses import replace

import numba
import numpy as np
import pytest
from adjoints import pairing, rate
from nclaw_toys import CARRIED, DT, FIELDS, LOWER, UPPER, problem_of, random_like, states, world_of
from problems import run_python

from mpm_ref.adjoint import StepAdjoint, zero_bars, zero_sums
from mpm_ref.body import keep_inside
from mpm_ref.core.boundary import Collider, Conditions, nclaw_walls
from mpm_ref.core.jit import set_threads
from mpm_ref.core.solids import half_space
from mpm_ref.explicit import Scheme
from mpm_ref.nclaw.batched_step import States, advance, make_nodes, make_world, pull_back
from mpm_ref.problem import Clock

MOST = numba.config.NUMBA_NUM_THREADS
WALLS = nclaw_walls(20, 3)
PLACES = ("low", "middle", "high")
N = 8
WIDE = (0.025, 0.975)       # the clip of NCLAW-sim [m]
SIZE = {"x": 0.1, "v": 1.0, "C": 10.0, "F": 1.0, "tau": 1e3}     # of directions
WEIGHT = {"x": 20.0, "v": 1.0, "C": 0.1, "F": 1.0}               # of losses
H = 1e-3 * 0.5 ** np.arange(5)      # a displacement is at most H/10 m, less than to any kink

ADJOINT = """
import json
from tests.nclaw.test_batched_step import off_the_steppers_adjoint
print(json.dumps(list(off_the_steppers_adjoint())))
"""


@pytest.fixture
def before():
    return states(PLACES, N)


@pytest.fixture
def of(before):
    return world_of(before)


def stepped(of, before):
    return advance(of, before, make_nodes(of, len(before.x)))


def seeds(before, rng):
    """A loss's gradients of what is carried."""
    return random_like(before[:4], rng, WEIGHT)


def gradient(of, before, seeds):
    on = make_nodes(of, len(before.x))
    return pull_back(of, before, advance(of, before, on), seeds, on)


def close(a, b, tol=1e-12):
    assert abs(a - b).max() <= tol * abs(b).max()


# The step.

def test_walls_and_clip_are_reached_and_nothing_is_near_a_kink(of, before):
    """What the tests below rest on."""
    free = stepped(world_of(before, WIDE), before)
    for b, beyond in ((0, free.x[0] < LOWER), (2, free.x[2] > UPPER)):
        assert 0.1 < beyond.mean() < 0.9
        assert abs(free.v[b]).max() > 5.0
    clipped = np.clip(free.x, LOWER, UPPER)
    assert np.array_equal(stepped(of, before).x, clipped)
    assert min(abs(free.x - LOWER).min(), abs(free.x - UPPER).min()) > 2e-4
    high = of._replace(low=of.low - 9, high=of.high + 9)
    change = abs(stepped(high, before).v - free.v).max(axis=(1, 2))
    assert (change > 0.5).tolist() == [True, False, True]


@pytest.mark.parametrize("clip", [(LOWER, UPPER), WIDE], ids=["clipped", "free"])
def test_a_step_is_that_of_the_stepper(before, clip):
    """NCLAW-sim, NCLAW-mls: each body as if it were alone."""
    after = stepped(world_of(before, clip), before)
    for b in range(len(PLACES)):
        problem = problem_of(before, b, clip)
        problem.stepper().step(problem.bodies, 0.0, DT)
        keep_inside(problem.bodies, *problem.clip)
        for name in CARRIED:
            close(getattr(after, name)[b], getattr(problem.bodies[0].particles, name), 1e-13)


def test_nothing_that_a_step_reads_is_changed(of, before, rng):
    copies = [a.copy() for a in before]
    bars = seeds(before, rng)
    of_bars = [a.copy() for a in bars[:4]]
    gradient(of, before, bars)
    assert all(map(np.array_equal, before, copies))
    assert all(map(np.array_equal, bars[:4], of_bars))


def everything(of, before, bars):
    """Arrays of a step and of its adjoint."""
    return *stepped(of, before)[:4], *gradient(of, before, bars)


def test_company_changes_no_bit(of, before, rng):
    bars = seeds(before, rng)
    together = everything(of, before, bars)
    for order in ([1], [2, 0], [1, 1, 0, 2, 1]):
        some = everything(of, States(*(a[order] for a in before)),
                          States(*(a[order] for a in bars[:4])))
        for a, whole in zip(some, together, strict=True):
            assert np.array_equal(a, whole[order])


def test_what_the_grids_held_before_is_forgotten(of, before, rng):
    bars, on = seeds(before, rng), make_nodes(of, 3)
    for a in on:
        a[:] = np.nan
    after = advance(of, before, on)
    for a in on:
        a[:] = np.nan
    found = (*after[:4], *pull_back(of, before, after, bars, on))
    assert all(map(np.array_equal, found, everything(of, before, bars)))


@pytest.mark.skipif(MOST < 2, reason="one core")
def test_two_threads_give_the_same_bits(of, rng):
    before, found = states(PLACES * 3, N), []
    bars = seeds(before, rng)
    for threads in (1, 2):
        set_threads(threads)
        found.append(everything(of, before, bars))
    assert all(map(np.array_equal, *found))


# Its adjoint.

def loss_along(of, before, bars, direction):
    """h -> <bars, step(before + h direction)>."""
    def loss(h):
        return pairing(bars[:4], stepped(of, States(*(a + h * da for a, da in zip(
            before, direction))))[:4])
    return loss


def only(direction, name):
    """The direction in one field."""
    return States(*(a * (field == name) for field, a in zip(FIELDS, direction)))


@pytest.mark.parametrize("names", [("x",), FIELDS], ids=["x", "all"])
def test_remainder_is_of_second_order(of, before, rng, names):
    """With walls and clip at work."""
    bars, direction = seeds(before, rng), random_like(before, rng, SIZE)
    direction = States(*(a * (name in names) for name, a in zip(FIELDS, direction)))
    slope = pairing(gradient(of, before, bars), direction)
    assert rate(loss_along(of, before, bars, direction), slope, H) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("name", ["v", "C", "F", "tau"])
def test_linear_inputs_are_met_to_round_off(of, before, rng, name):
    """As long as no node and no particle passes a kink, a step is linear in each of them."""
    bars, direction = seeds(before, rng), only(random_like(before, rng, SIZE), name)
    loss, h = loss_along(of, before, bars, direction), 1e-2
    slope = pairing(gradient(of, before, bars), direction)
    assert (loss(h) - loss(-h)) / (2.0 * h) == pytest.approx(slope, rel=1e-9)


def off_the_steppers_adjoint():
    """Largest relative differences of the gradients from those of `adjoint`, body by body: without
    a clip, which that does not know. The bar of the stress after the step is zero.
    """
    before = states(PLACES, N)
    bars = seeds(before, np.random.default_rng(0))
    found = gradient(world_of(before, WIDE), before, bars)
    for b in range(len(PLACES)):
        problem = problem_of(before, b, WIDE)
        body = problem.bodies[0]
        bar, sums = zero_bars(body), zero_sums(body)
        for name in CARRIED:
            getattr(bar, name)[:] = getattr(bars, name)[b]
        StepAdjoint(problem.stepper()).pull_back([body], [bar], [sums], 0.0, DT)
        for name in FIELDS:
            theirs = getattr(bar, name)
            yield float(abs(getattr(found, name)[b] - theirs).max() / abs(theirs).max())


def test_each_body_has_the_gradient_of_the_steppers_adjoint():
    """As plain Python: compiling that adjoint takes seconds."""
    found = run_python(ADJOINT, NUMBA_DISABLE_JIT="1")
    assert len(found) == len(PLACES) * len(FIELDS)
    assert max(found) < 1e-12


def test_of_what_is_clipped_nothing_comes_back(of, before, rng):
    after = stepped(of, before)
    clipped = (after.x == LOWER) | (after.x == UPPER)
    none = States(*(np.zeros_like(a) for a in before[:4]))
    held = none._replace(x=np.where(clipped, rng.normal(size=clipped.shape), 0.0))
    assert held.x.any()
    assert not any(a.any() for a in gradient(of, before, held))
    free = none._replace(x=np.where(clipped, 0.0, 1.0))
    assert gradient(of, before, free).x.any()


# What is refused.

@pytest.mark.parametrize("x", [LOWER - 1e-9, UPPER + 1e-9, np.nan, np.inf])
def test_positions_that_are_not_inside_are_told(of, before, x):
    before.x[2, 5, 1] = x
    with pytest.raises(ValueError, match=r"^particle 5 of body 2 is at \[.*\], expected it between "
                                         r".* m; has the law made the run unstable\?$"):
        stepped(of, before)


@pytest.mark.parametrize("name", FIELDS[1:])
def test_what_is_not_finite_does_not_become_a_position(of, before, name):
    getattr(before, name)[1, 3, 0] = np.nan
    after = stepped(of, before)
    assert np.isnan(after.F[1]).any()
    if name != "F":
        assert np.isnan(after.x[1]).any()
        with pytest.raises(ValueError, match=r"of body 1 is at .*nan"):
            stepped(of, States(*after[:4], before.tau))
    assert np.isfinite(after.x[[0, 2]]).all()


def short(states, name):
    """`States` with one particle less in an array."""
    return states._replace(**{name: getattr(states, name)[:, 1:].copy()})


@pytest.mark.parametrize("name", FIELDS)
def test_arrays_of_another_body_are_told(of, before, rng, name):
    said = rf"^{name if name != 'tau' else 'tau'} has shape \(3, 7, 3.*\), expected \(3, 8, 3"
    given = [before, stepped(of, before), seeds(before, rng)]
    with pytest.raises(ValueError, match=said):
        stepped(of, short(before, name))
    for k in range(1 if name == "tau" else 3):
        wrong = [short(states, name) if i == k else states for i, states in enumerate(given)]
        with pytest.raises(ValueError, match=said):
            pull_back(of, *wrong, make_nodes(of, 3))


def test_gradients_of_fewer_bodies_are_told(of, before, rng):
    bars = States(*(a[:2] for a in seeds(before, rng)[:4]))
    with pytest.raises(ValueError, match=r"^x has shape \(2, 8, 3\), expected \(3, 8, 3\): "):
        gradient(of, before, bars)


def test_a_stress_that_is_left_out_is_told(of, before):
    with pytest.raises(ValueError, match=r"^tau has shape \(0, 0, 0, 0\), .* or left out\?$"):
        stepped(of, stepped(of, before))


@pytest.mark.parametrize(("coarser", "count"), [(1.0, 2), (2.0, 3)])
def test_storage_that_is_too_small_is_told(of, before, rng, coarser, count):
    on = make_nodes(of._replace(dx=coarser * of.dx), count)
    said = rf"^storage for {count} bodies of \d+ nodes, expected at least 3 of \d+; make it with "
    with pytest.raises(ValueError, match=said):
        advance(of, before, on)
    with pytest.raises(ValueError, match=said):
        pull_back(of, before, stepped(of, before), seeds(before, rng), on)


def test_a_body_force_of_its_own_is_refused(before):
    body = problem_of(before, 0).bodies[0]
    pushed = body._replace(particles=body.particles._replace(b=np.ones((N, 3))))
    with pytest.raises(ValueError, match=r": expected no body force but gravity; "):
        make_world(replace(problem_of(before, 0), bodies=(pushed,)))


def test_a_world_is_that_of_the_problem(before):
    of = world_of(before)
    assert (of.dx, of.dt, of.eps) == (0.05, 5e-4, 1e-7)
    assert (of.low.tolist(), of.high.tolist()) == ([3, 3, 3], [17, 17, 17])
    assert of.gravity.tolist() == [0.0, -9.8, 0.0]
    assert (of.m == 0.125).all()


@pytest.mark.parametrize("change", [
    {"scheme": Scheme(transfer="apic")}, {"scheme": Scheme(degree=3)}, {"scheme": Scheme(rpic=0.1)},
    {"scheme": Scheme(relaxation=1e-3)}, {"scheme": Scheme(f_bar=True)},
    {"scheme": Scheme(precision="single")},
    {"bodies": 2}, {"clock": Clock(steps=1)}, {"clip": None}, {"conditions": None},
    {"conditions": Conditions()}, {"conditions": Conditions(walls=replace(WALLS, kind="noslip"))},
    {"conditions": Conditions(walls=replace(WALLS, friction=0.3))},
    {"conditions": Conditions(walls=replace(WALLS, high=(17, None, 17)))},
    {"conditions": Conditions((Collider(half_space((0.0, 0.1, 0.0), (0.0, 1.0, 0.0))),),
                              walls=WALLS)},
])
def test_other_problems_are_refused(before, change):
    problem = problem_of(before, 0)
    if "bodies" in change:
        change = {"bodies": 2 * problem.bodies}
    with pytest.raises(ValueError, match=r"^'a toy': expected "):
        make_world(replace(problem, title="a toy", **change))
