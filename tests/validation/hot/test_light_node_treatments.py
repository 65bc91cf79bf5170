"""Light nodes: which they are, and that a treatment does what it says to them alone."""

import numpy as np
import pytest

from mpm_ref.hot.methods import minimise, printed
from validation.common.scenes import with_
from validation.hot import light_node_treatments as module
from validation.hot.one_step import step_after
from validation.hot.stiffness import bar


@pytest.fixture(scope="module")
def step():
    return step_after(with_(bar(0.06, 1e7, "hot", 1), gravity=(0.0, 0.0, -9.81)), 1)


def solved(step, treatment):
    pose = module.treated(step, treatment)
    return minimise(step.stepper.system(pose), printed("hot")).dv, pose


def test_light_nodes_are_free_and_light(step):
    q = step.pose.unknowns
    light = module.light_nodes_of(q)
    held = (q.B != np.eye(3)).any(axis=(1, 2))
    assert 0 < light.sum() < len(light)
    assert held.any()
    assert not (light & held).any()
    assert q.m[light].max() < 0.1 * np.median(q.m) <= q.m[~light & ~held].min()


def test_light_nodes_fall(step):
    dv, pose = solved(step, "falls")
    light = module.light_nodes_of(step.pose.unknowns)
    np.testing.assert_allclose(dv[light], np.tile(pose.gravity_increment, (light.sum(), 1)))
    assert np.abs(dv[~light] - pose.gravity_increment).max() > 0.01


def test_heavier_nodes_have_the_mass_and_weight_of_the_threshold(step):
    _, pose = solved(step, "heavier")
    before, after = step.pose.unknowns.m, pose.unknowns.m
    light = module.light_nodes_of(step.pose.unknowns)
    np.testing.assert_array_equal(after[~light], before[~light])
    np.testing.assert_array_equal(after[light], 0.1 * np.median(before))
    _, g = pose.potential.evaluate(np.zeros_like(pose.unknowns.v))
    _, g0 = step.pose.potential.evaluate(np.zeros_like(pose.unknowns.v))
    weight = step.dt * (after - before)[:, None] * step.stepper.gravity
    np.testing.assert_allclose(g0 - g, weight, atol=1e-12 * np.abs(g0).max())


def test_no_treatment_is_the_step_itself(step):
    dv, pose = solved(step, "none")
    assert pose.unknowns is step.pose.unknowns
    same = minimise(step.stepper.system(step.pose), printed("hot")).dv
    np.testing.assert_array_equal(dv, same)


def test_a_treatment_is_adopted_for_fewer_iterations_at_no_error():
    class Run:
        def record(self, *args, **words):
            pass

    def solve(treatment, iterations, cells):
        return module.TreatedSolve("bar", "hot", treatment, 10, 0.1, iterations, True, 1.0, cells)
    solves = [solve("none", 10, 1e-4), solve("falls", 9, 1e-3), solve("heavier", 5, 2e-3)]
    assert module.record_treatment(Run(), "falls", "hot", solves)
    assert not module.record_treatment(Run(), "heavier", "hot", solves)
    solves[1] = solve("falls", 9, 1e-3)._replace(converged=False)
    assert not module.record_treatment(Run(), "falls", "hot", solves)
    solves[1] = solve("falls", 10, 1e-4)
    assert not module.record_treatment(Run(), "falls", "hot", solves)
