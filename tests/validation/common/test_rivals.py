"""Reduced runs beside their simplest rivals: the parts that all studies share."""

from math import inf

import numpy as np
import pytest
from small_toys import Records

from mpm_ref.monitor import Unstable
from mpm_ref.rom.study.errors import PositionErrors
from mpm_ref.rom.study.full_model import field_of
from mpm_ref.scene import build
from mpm_ref.simulate import simulate
from validation.common import rivals
from validation.common.rivals import (
    Comparison,
    PositionSource,
    Rival,
    TestRun,
    record_rivals,
    run_errors,
    state_errors,
)
from validation.common.scenes import catalogue_scene, with_
from validation.common.tracers import CoveringStorage, advected


def scene_of_a_few_steps():
    return with_(catalogue_scene("hello"), scheme=with_(catalogue_scene("hello").scheme,
                                                        transfer="apic"),
                 dt=2e-3, end=None, interval=None, steps=70, every=70)


def test_tracers_at_the_particles_go_with_them():
    """70 steps: the particles are sorted on the way, the tracers are not."""
    scene = scene_of_a_few_steps()
    problem = build(scene)
    X = field_of(problem.bodies, "x") + [0.0, 0.0]
    *_, (t, x) = advected(problem, X)
    *_, last = simulate(build(scene))
    assert t == pytest.approx(last.t)
    np.testing.assert_allclose(x, field_of(last.state.bodies, "x"), atol=1e-13)
    assert np.abs(x - X).max() > 0.01


def test_the_grid_covers_tracers_wherever_they_are():
    """Reading beyond the grid would go unnoticed."""
    problem = build(scene_of_a_few_steps())
    far = problem.bodies[0]._replace(particles=problem.bodies[0].particles._replace(
        x=np.array([[3.0, -2.0]])))
    grid = CoveringStorage(problem.stepper().storage, far).cover([problem.bodies[0].particles.x])
    nodes = np.round(far.particles.x[0] / problem.dx) - grid.origin
    assert (nodes >= 1).all()
    assert (nodes <= np.array(grid.m.shape) - 2).all()


def test_tracers_outside_of_matter_stand_still():
    problem = build(scene_of_a_few_steps())
    far = np.array([[3.0, 3.0]])
    *_, (_, x) = advected(problem, far)
    assert x.tolist() == far.tolist()


def test_grids_on_which_a_body_has_no_point_are_left_out():
    scene = scene_of_a_few_steps()
    body = with_(scene.body[0], sampling=with_(scene.body[0].sampling, per_cell=1))
    scenes = {k: with_(scene, dx=k * scene.dx, body=(body,)) for k in (2, 50)}
    X = np.array([[0.5, 0.7]])
    (coarse,) = rivals.coarse_sources(scenes, X)
    assert coarse.name == "coarse.2"
    *_, (_, x) = coarse.states()
    assert 0.55 < x[0, 1] < 0.65        # after a fall of 0.14 s, 0.096 m


def source(x, raises=None):
    def states():
        for level, state in enumerate(x):
            yield 0.1 * level, state
        if raises:
            raise raises
    return PositionSource("toy", states, lambda state: state, 8)


@pytest.fixture
def test_run(rng):
    return TestRun(rng.uniform(size=(4, 2)), rng.uniform(size=(3, 4, 2)), 0.1, 1)


def test_errors_leave_out_levels_before_the_first(test_run):
    off = test_run.x * [[[7.0]], [[1.01]], [[1.01]]]
    assert run_errors(source(off), test_run).origin == pytest.approx(0.01)
    assert state_errors(off, test_run).origin == pytest.approx(0.01)
    assert state_errors(off, test_run._replace(first=0)).origin > 1.0
    assert run_errors(source(off), test_run._replace(first=0)).origin > 1.0


def test_errors_of_runs_that_end_early_or_are_not_finite_are_infinite(test_run):
    fault = Unstable("toy", step=1, t=0.1, body="a", particle=0, cfl=1.0, J=1.0, energy=1.0,
                     advice="")
    assert run_errors(source(test_run.x, fault), test_run) == PositionErrors(inf, inf, inf)
    off = test_run.x.copy()
    off[2, 0, 0] = np.nan
    assert run_errors(source(off), test_run) == PositionErrors(inf, inf, inf)


def test_the_longest_step_is_the_last_with_which_a_run_ends_well(monkeypatch):
    monkeypatch.setattr(rivals, "ends", lambda scene: scene.dt < 2.0e-3)
    scene = with_(scene_of_a_few_steps(), dt=1e-3)
    assert rivals.longest_step(scene) == 1.5
    assert rivals.longest_step(with_(scene, dt=1.0)) == 1.0


def comparison(rivals, errors=None):
    """A `Comparison` of {name: (error, CPU seconds)}, of one test unless {test: {name: error}} is
    given.
    """
    errors = errors or {"a": {name: error for name, (error, _) in rivals.items()}}
    return Comparison(
        [Rival(name, PositionErrors(*3 * (error,)), cpu, 0)
         for name, (error, cpu) in rivals.items()],
        {test: {name: PositionErrors(*3 * (error,)) for name, error in own.items()}
         for test, own in errors.items()})


def recorded(found, names):
    run = Records()
    record_rivals(run, "r", found, names, "", "")
    return {name.removeprefix("r."): value for name, (value, _) in run.items() if "beats" in name}


def test_reduced_runs_are_compared_with_the_cheapest_run_of_no_larger_error():
    found = comparison({"drawn": (0.02, 2.0), "weighted": (0.005, 0.5), "full": (0.0, 8.0),
                        "mls.x1": (0.01, 4.0), "coarse.2": (0.03, 0.1), "nearest": (0.05, 0.0),
                        "interpolated": (0.01, 0.0)})
    assert recorded(found, ("drawn", "weighted")) == pytest.approx({
        "drawn.beats.nearest": 2.5, "drawn.beats.interpolated": 0.5, "drawn.beats.full": 2.0,
        "weighted.beats.nearest": 10.0, "weighted.beats.interpolated": 2.0,
        "weighted.beats.full": 16.0})


def test_interpolation_is_compared_where_there_is_one():
    found = comparison({"drawn": (0.05, 2.0), "full": (0.0, 8.0), "interpolated": (0.01, 0.0)}, {
        "inside": {"drawn": 0.02, "full": 0.0, "interpolated": 0.01},
        "outside": {"drawn": 0.08, "full": 0.0}})
    assert recorded(found, ("drawn",))["drawn.beats.interpolated"] == pytest.approx(0.5)


def test_a_reduced_run_that_broke_down_beats_none():
    found = comparison({"drawn": (inf, 1.0), "full": (0.0, 8.0), "nearest": (0.1, 0.0)})
    assert set(recorded(found, ("drawn",)).values()) == {0.0}
