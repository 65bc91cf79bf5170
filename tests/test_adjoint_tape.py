"""Gradients through many steps in 2D: Taylor tests of rollouts, checkpoints, threads, refusals."""

import json
from types import SimpleNamespace

import numba
import numpy as np
import pytest
from adjoint_runs import dive, impact, line_of, moved, order, seeds_of, taped
from adjoints import H
from problems import DT, DX, FREE, digest, elsewhere

from mpm_ref.core.jit import set_threads
from mpm_ref.explicit import Scheme, Stepper
from mpm_ref.hot.step import ImplicitStepper
from mpm_ref.tape import Seed, Tape

MOST = numba.config.NUMBA_NUM_THREADS
STEPS = 100
FINE = 4e-3 * H     # small enough that no particle passes a kink of its law or its contact

SHORT = """
import json
import numpy as np
from adjoint_runs import dive, order
KINDS = [("pic", 1), ("pic", 2), ("flip", 2), ("flip", 3), ("apic", 2), ("apic", 3), ("mls", 3)]
print(json.dumps({f"{t}{k}": order(dive(t, k), (1, 3), 1e-3 * 0.5**np.arange(4))
                  for t, k in KINDS}))
"""


def test_rollout():
    """Elastic and hardening bodies on one grid, in the whole state and all parameters."""
    assert order(impact(), (37, STEPS), FINE) == pytest.approx(2.0, abs=0.1)


def test_rollout_reaches_what_it_tests():
    """The gradient of every input is there: yielding, contact and impact have happened."""
    run = impact()
    seeds = seeds_of(run, (STEPS,), np.random.default_rng(0))
    y = run.bodies[1].particles.y.copy()
    g = taped(run, seeds)
    assert (run.bodies[1].particles.y > y).sum() > 5
    assert abs(g.gravity).min() > 0.0
    jelly, metal = g.bodies
    for bars in (*jelly[:4], *metal[:7], np.array(jelly.law), np.array(metal.law)):
        assert np.isfinite(bars).all()
        assert abs(bars).max() > 0.0
    assert metal.flow.xi != 0.0


def test_every_transfer():
    """Three steps as plain Python, with a body force and a wall that holds. A wrong one has 1."""
    found = elsewhere(SHORT, NUMBA_DISABLE_JIT="1")
    assert min(found.values()) > 1.8, json.dumps(found)


def test_a_taped_run_is_the_run():
    run, other = moved(*line(impact()), 0.0), moved(*line(impact()), 0.0)
    stepper = run.stepper()
    stepper.start(run.bodies)
    taped(other, {STEPS: [None, None]})
    for n in range(STEPS):
        stepper.step(run.bodies, n * DT, DT)
    assert digest(run.bodies) == digest(other.bodies)


def line(run):
    return run, line_of(run, np.random.default_rng(0))


def flat(gradient):
    """All numbers of a gradient."""
    return np.concatenate([np.ravel(a) for bars in gradient.bodies for a in bars]
                          + [gradient.gravity])


@pytest.mark.parametrize("every", [4, 7, 50])
def test_checkpoints_change_no_bit(every):
    """Whether they divide the number of steps or not."""
    steps, rng = (0, 5, 20), np.random.default_rng(0)
    seeds = seeds_of(impact(), steps, rng)
    assert np.array_equal(flat(taped(impact(), seeds)), flat(taped(impact(), seeds, every)))


def test_a_tape_can_be_asked_twice():
    run = impact()
    stepper = run.stepper()
    stepper.start(run.bodies)
    tape = Tape(stepper, run.bodies, every=2)
    seeds = seeds_of(run, (3,), np.random.default_rng(0))
    for n in range(3):
        tape.step(n * DT, DT)
    state = digest(run.bodies)
    assert np.array_equal(flat(tape.gradient(seeds)), flat(tape.gradient(seeds)))
    assert digest(run.bodies) == state


@pytest.mark.skipif(MOST < 2, reason="one core")
def test_two_threads_give_the_same_bits():
    found = []
    for threads in (1, 2):
        set_threads(threads)
        seeds = seeds_of(impact(), (10,), np.random.default_rng(0))
        found.append(flat(taped(impact(), seeds)))
    assert np.array_equal(*found)


def test_momentum_is_the_gradient_of_momentum():
    """Free bodies: d(sum m v)/dv_p = m_p, d/dg = m t, and nothing else counts."""
    run = impact()._replace(conditions=FREE, scheme=Scheme())
    steps, a = 20, np.array([0.6, -0.8])
    masses = [b.particles.m for b in run.bodies]
    g = taped(run, {steps: [Seed(v=np.outer(m, a)) for m in masses]})
    for bars, m in zip(g.bodies, masses):
        assert abs(bars.v - np.outer(m, a)).max() <= 1e-12 * m.max()
        assert abs(bars.x).max() <= 1e-10 * m.sum()
        assert abs(bars.F).max() <= 1e-10 * m.sum()
    assert g.gravity == pytest.approx(steps * DT * sum(m.sum() for m in masses) * a, rel=1e-12)


def test_a_seed_of_the_start_passes_unchanged(rng):
    run = impact()
    x = rng.normal(size=run.bodies[0].particles.x.shape)
    tau = rng.normal(size=run.bodies[0].particles.tau.shape)
    g = taped(run, {0: [Seed(x=x, tau=tau), None], 2: [None, None]})
    assert np.array_equal(g.bodies[0].x, x)
    assert abs(g.bodies[0].F).max() > 0.0       # tau belongs to F
    assert not g.bodies[1].x.any()


# refusals

def empty_tape(conditions=FREE, every=1):
    run = dive()
    return Tape(Stepper(run.scheme, DX, 2, run.gravity, conditions), run.bodies, every)


@pytest.mark.parametrize(("options", "said"), [
    ({"every": 0}, "every = 0: expected a number of steps >= 1"),
    ({"conditions": SimpleNamespace(apply=None)}, "SimpleNamespace have no adjoint"),
])
def test_what_has_no_adjoint_is_refused(options, said):
    with pytest.raises(ValueError, match=said):
        empty_tape(**options)


def test_an_implicit_stepper_is_refused():
    with pytest.raises(ValueError, match="ImplicitStepper is implicit: expected an explicit"):
        Tape(object.__new__(ImplicitStepper), dive().bodies)


def test_sorted_bodies_are_refused():
    run = impact()
    stepper = run.stepper()
    stepper.start(run.bodies)
    tape = Tape(stepper, run.bodies)
    tape.step(0.0, DT)
    stepper.sort(run.bodies)
    with pytest.raises(ValueError, match="body 'jelly' was sorted after its tape began"):
        tape.step(DT, DT)


@pytest.mark.parametrize(("seeds", "said"), [
    ({3: [None, None]}, r"seeds of step 3: expected 0 \.\. 1"),
    ({1: [None]}, "1 seeds of step 1: expected one for each of 2 bodies"),
    ({1: [Seed(x=np.zeros((3, 2))), None]}, r"body 'jelly': x has shape \(3, 2\), expected"),
])
def test_wrong_seeds_are_refused(seeds, said):
    run = impact()
    stepper = run.stepper()
    stepper.start(run.bodies)
    tape = Tape(stepper, run.bodies)
    with pytest.raises(ValueError, match="the tape is empty"):
        tape.gradient({})
    tape.step(0.0, DT)
    with pytest.raises(ValueError, match=said):
        tape.gradient(seeds)
