"""Figure 15 over entire runs: steps lie over the run, all methods solve each, sizes are theirs."""

import numpy as np
import pytest

from mpm_ref.scene import build
from mpm_ref.simulate import simulate
from validation.common.scenes import catalogue_scene, with_
from validation.hot import overview, overview_runs, table3_runs
from validation.hot import warm_states as states


def poured(steps):
    """The first steps of a pour of few particles."""
    scene = catalogue_scene("hot_sauce", unstable="allow", dx=0.09, integrator="hot")
    body = scene.body[0]
    return with_(scene, end=steps * scene.longest,
                 body=(with_(body, sampling=with_(body.sampling, count=60)),))


def test_measured_steps_end_where_a_block_enters():
    problem = build(poured(12))
    state, stepper = next(simulate(problem)).state, problem.stepper()
    ends = []
    while state.t < 0.3:
        dt, before = states.next_step_length(problem, stepper, state), state.t
        states.take_step(problem, stepper, state)
        assert state.t - before == pytest.approx(dt, rel=1e-12)
        ends.append(state.t)
    assert min(abs(t - 0.24) for t in ends) < 1e-12


def test_every_method_solves_steps_over_the_run(monkeypatch, tmp_path):
    monkeypatch.setattr(overview, "METHODS", ("hot", "pn-pcg"))
    monkeypatch.setattr(table3_runs, "scene", lambda name, size: poured(12))
    rows, (hot, pcg) = overview_runs.run_costs("sauce", "quick", tmp_path, 3)
    assert [(row.method, row.step) for row in rows] == [
        (method, k) for k in range(3) for method in ("hot", "pn-pcg")]
    assert np.all(np.diff([row.t for row in rows[::2]]) > 0.1)
    assert (hot.total, hot.steps, hot.particles) == (1.0, 3, 240)       # of the last of them
    assert pcg.total > 0.0


def test_methods_are_warmed_up_before_the_first_step_is_measured(monkeypatch, tmp_path):
    calls = []
    monkeypatch.setattr(overview, "METHODS", ("hot", "pn-pcg"))
    monkeypatch.setattr(table3_runs, "scene", lambda name, size: poured(12))
    solve = overview.solve_step
    monkeypatch.setattr(overview, "solve_step", lambda step, method, **options: (
        calls.append((method, "max_cg_iterations" in options)), solve(step, method, **options))[1])
    overview_runs.run_costs("sauce", "quick", tmp_path, 2)
    assert calls == [("hot", True), ("pn-pcg", True), *2 * [("hot", False), ("pn-pcg", False)]]
