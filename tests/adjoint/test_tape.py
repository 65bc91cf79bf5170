"""Gradients through many steps in 2D: Taylor tests of rollouts, checkpoints, threads, refusals."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from adjoint_runs import along, dive, impact, line_of, loss, moved, seeds_of, splash, taped
from adjoints import H, rate
from problems import DT, DX, FREE, digest, run_python
from threads import MOST, by_threads

from mpm_ref.core.boundary import Collider
from mpm_ref.core.levelset import half_space
from mpm_ref.core.surface import SurfaceConditions
from mpm_ref.explicit import Scheme, Stepper
from mpm_ref.hot.step import ImplicitStepper
from mpm_ref.tape import Seed, Tape

STEPS = 100
STATE_AT_START = ("x", "v", "C", "F", "y")
FINE = 4e-3 * H     # small enough that no particle passes a kink of its law or its contact

SHORT = """
import json
import numpy as np
from adjoint_runs import dive, order
KINDS = [("pic", 1), ("pic", 2), ("flip", 2), ("flip", 3), ("apic", 2), ("apic", 3), ("mls", 3),
         ("apic", 3, 2e-3), ("mls", 2, 2e-3), ("pic", 2, 0.0, 2.0), ("flip", 2, 0.0, 2.0)]
print(json.dumps({str(kind): order(dive(*kind), (1, 3), 1e-3 * 0.5**np.arange(4))
                  for kind in KINDS}))
"""


@pytest.mark.slow
def test_rollout():
    """Elastic and hardening bodies on one grid, in the whole state and all parameters; y goes along
    with tau_y, as in a body that is made with another one.
    """
    run, rng = impact(), np.random.default_rng(0)
    line, seeds = line_of(run, rng), seeds_of(run, (37, STEPS), rng)
    slope = along(taped(moved(run, line, 0.0), seeds), line)
    metal = line.bodies[1]
    metal["y"] += metal["flow"][0]
    order = rate(lambda h: loss(moved(run, line, h), seeds), slope, FINE)
    assert order == pytest.approx(2.0, abs=0.1)


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
    assert metal.flow.tau_y == pytest.approx(metal.y.sum())
    assert metal.flow.tau_y != 0.0


def test_particles_that_start_from_other_yield_stresses_leave_that_of_the_flow_open():
    run = impact()
    run.bodies[1].particles.y[3] = 49.0
    metal = taped(run, seeds_of(run, (1,), np.random.default_rng(0))).bodies[1]
    assert np.isnan(metal.flow.tau_y)
    assert np.isfinite(metal.y).all()
    assert np.isfinite(metal.flow.xi)


def test_every_transfer():
    """Three steps as plain Python, with a body force and a wall that holds. A wrong one has 1."""
    found = run_python(SHORT, NUMBA_DISABLE_JIT="1")
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


def tape_of(run, every=1):
    """Stepper of a run that was started, and its tape."""
    stepper = run.stepper()
    stepper.start(run.bodies)
    return stepper, Tape(stepper, run.bodies, every)


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
    _, tape = tape_of(run, every=2)
    seeds = seeds_of(run, (3,), np.random.default_rng(0))
    for n in range(3):
        tape.step(n * DT, DT)
    state = digest(run.bodies)
    assert np.array_equal(flat(tape.gradient(seeds)), flat(tape.gradient(seeds)))
    assert digest(run.bodies) == state


def test_the_gradient_of_a_later_tape_is_a_seed():
    """That it begins midway, with stresses that steps have left; but the flow's tau_y is past."""
    seeds = seeds_of(impact(), (30,), np.random.default_rng(0))
    whole, run = taped(impact(), seeds), impact()
    stepper, first = tape_of(run)
    for n in range(20):
        first.step(n * DT, DT)
    second = Tape(stepper, run.bodies)
    for n in range(20, 30):
        second.step(n * DT, DT)
    rest = second.gradient({10: seeds[30]})
    assert np.isnan(rest.bodies[1].flow.tau_y)
    of_start = first.gradient({20: [Seed(x=g.x, v=g.v, C=g.C, F=g.F, y=g.y) for g in rest.bodies]})
    for found, expected in zip(of_start.bodies, whole.bodies):
        for name in STATE_AT_START:
            a, b = getattr(found, name), getattr(expected, name)
            assert abs(a - b).max(initial=0.0) <= 1e-9 * abs(b).max(initial=0.0)


def test_gravity_that_changes_after_the_run_does_not_count():
    run = impact()
    stepper, tape = tape_of(run, every=2)
    for n in range(3):
        tape.step(n * DT, DT)
    seeds = seeds_of(run, (3,), np.random.default_rng(0))
    before = flat(tape.gradient(seeds))
    stepper.gravity[:] = 5.0
    assert np.array_equal(flat(tape.gradient(seeds)), before)


@pytest.mark.skipif(MOST < 2, reason="one core")
def test_two_threads_give_the_same_bits():
    seeds = seeds_of(impact(), (10,), np.random.default_rng(0))
    assert np.array_equal(*by_threads(lambda: flat(taped(impact(), seeds))))


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


def test_averaged_volumes_are_refused():
    run = dive()
    with pytest.raises(ValueError, match="f_bar = True: averaged volumes have no adjoint"):
        Tape(Stepper(replace(run.scheme, f_bar=True), DX, 2, run.gravity, FREE), run.bodies)


def test_conditions_at_surfaces_are_refused():
    run = dive()
    floor = SurfaceConditions((Collider(half_space((0.0, 0.0), (0.0, 1.0))),))
    with pytest.raises(ValueError, match=r'boundary = "surface": expected "nodes" for adjoints'):
        Tape(Stepper(run.scheme, DX, 2, run.gravity, floor), run.bodies)


def test_an_implicit_stepper_is_refused():
    with pytest.raises(ValueError, match="ImplicitStepper is implicit: expected an explicit"):
        Tape(object.__new__(ImplicitStepper), dive().bodies)


def test_sorted_bodies_are_refused():
    run = impact()
    stepper, tape = tape_of(run)
    tape.step(0.0, DT)
    stepper.sort(run.bodies)
    with pytest.raises(ValueError, match="body 'jelly' was sorted after its tape began"):
        tape.step(DT, DT)


def clip(a):
    np.minimum(a, np.median(a), out=a)


def swap(a):
    a[[0, 1]] = a[[1, 0]]


def grow(a):
    a *= 1.0 + 1e-15


@pytest.mark.parametrize("steps", [0, 1, 2])
@pytest.mark.parametrize(("name", "change"), [
    ("x", clip), ("x", swap), ("v", grow), ("F", grow), ("y", grow), ("m", grow),
])
def test_bodies_that_something_else_changes_are_refused(steps, name, change):
    """Before the first step too, and whether the state is kept or not."""
    run = impact()
    _, tape = tape_of(run, every=2)
    for n in range(steps):
        tape.step(n * DT, DT)
    change(getattr(run.bodies[1].particles, name))
    with pytest.raises(ValueError, match=f"body 'metal': its {name} was changed by something else"):
        tape.step(steps * DT, DT)


def lighten(stepper):
    stepper.gravity[1] = -1.6


def lift(stepper):
    stepper.conditions = None


@pytest.mark.parametrize("change", [lighten, lift])
def test_a_stepper_that_changes_is_refused(change):
    stepper, tape = tape_of(impact())
    tape.step(0.0, DT)
    change(stepper)
    with pytest.raises(ValueError, match="gravity, scheme or conditions of the stepper"):
        tape.step(DT, DT)


@pytest.mark.parametrize("make", [impact, splash])
def test_bodies_that_were_not_started_are_refused(make):
    run = make()
    stepper = run.stepper()
    stepper.start(run.bodies)
    run.bodies[1].particles.F[2] *= 1.0001
    said = f"body {run.bodies[1].name!r}: its stress tau is not that of its F: call Stepper.start"
    with pytest.raises(ValueError, match=said):
        Tape(stepper, run.bodies)
    stepper.start(run.bodies)
    Tape(stepper, run.bodies)


@pytest.mark.parametrize(("seeds", "said"), [
    ({3: [None, None]}, r"seeds of step 3: expected 0 \.\. 1"),
    ([Seed()], "given list, expected a dict"), ({}, "given none, expected the loss's gradient"),
    ({1: [None]}, r"seeds of step 1: given \[None\], expected a list with one Seed or None"),
    ({1: None}, "given None, expected a list with one Seed or None for each body, 2 in all"),
    ({1: Seed()}, "given Seed, expected a list"),
    ({1: {0: Seed(), 1: None}}, "given dict, expected a list"),
    ({1: [None, np.zeros((3, 2))]}, r"given \[None, ndarray\], expected a list"),
    ({1: [{"x": 1.0}, Seed()]}, r"given \[dict, Seed\], expected a list"),
    ({0: (1.0, None)}, r"seeds of step 0: given \[float, None\], expected a list"),
    ({1: [Seed(x=np.zeros((3, 2))), None]}, r"body 'jelly': x has shape \(3, 2\), expected"),
])
def test_wrong_seeds_are_refused(seeds, said):
    _, tape = tape_of(impact())
    with pytest.raises(ValueError, match="the tape is empty"):
        tape.gradient({})
    tape.step(0.0, DT)
    with pytest.raises(ValueError, match=said):
        tape.gradient(seeds)


@pytest.mark.parametrize("wrong", [np.nan, np.inf, 1.0j])
def test_seeds_that_are_no_finite_numbers_are_refused(wrong):
    _, tape = tape_of(impact())
    tape.step(0.0, DT)
    with pytest.raises(ValueError, match="body 'jelly': x has entries that are not finite numbers"):
        tape.gradient({1: [Seed(x=tape.bodies[0].particles.x + wrong), None]})
