"""NSF's reduced runs beside their simplest rivals."""

from math import inf
from types import SimpleNamespace

import numpy as np
import pytest
from small_toys import Records

from mpm_ref.monitor import Unstable
from mpm_ref.rom.study.errors import PositionErrors
from mpm_ref.rom.study.full_model import field_of
from mpm_ref.scene import build
from mpm_ref.simulate import simulate
from validation.common.scenes import catalogue_scene, with_
from validation.common.tracers import advected
from validation.nsf import rivals
from validation.nsf.rivals import Rival, Source, interpolation_errors, record_beats, run_errors


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


def test_tracers_outside_of_matter_stand_still():
    problem = build(scene_of_a_few_steps())
    far = np.array([[3.0, 3.0]])
    *_, (_, x) = advected(problem, far)
    assert x.tolist() == far.tolist()


def source(x, raises=None):
    def states():
        for level, state in enumerate(x):
            yield 0.1 * level, state
        if raises:
            raise raises
    return Source("toy", states, lambda state: state, 8)


@pytest.fixture
def histories(rng):
    return SimpleNamespace(X=rng.uniform(size=(4, 2)), x=rng.uniform(size=(1, 3, 4, 2)), dt=0.1)


def test_errors_leave_out_the_start_and_are_infinite_of_runs_that_end_early(histories):
    off = histories.x[0] * [[[7.0]], [[1.01]], [[1.01]]]
    assert run_errors(source(off), histories).origin == pytest.approx(0.01)
    fault = Unstable("toy", step=1, t=0.1, body="a", particle=0, cfl=1.0, J=1.0, energy=1.0,
                     advice="")
    assert run_errors(source(off, fault), histories) == PositionErrors(inf, inf, inf)
    off[2, 0, 0] = np.nan
    assert run_errors(source(off), histories) == PositionErrors(inf, inf, inf)


def test_interpolation_is_between_the_neighbours_of_the_test(histories):
    low, high, far = np.random.default_rng(3).uniform(size=(3, 3, 4, 2))
    runs = SimpleNamespace(X=histories.X, mu=np.array([[2.0], [0.0], [9.0]]),
                           x=np.stack([high, low, far]))
    test = SimpleNamespace(x=(0.75 * low + 0.25 * high)[None] * 1.02)
    one = SimpleNamespace(runs=runs, tests={0.5: test})
    assert interpolation_errors(one, 0.5).origin == pytest.approx(1.0 - 1.0 / 1.02)


def test_the_longest_step_is_chosen_on_a_training_run(monkeypatch):
    seen = []
    study = SimpleNamespace(train=(5.0, 6.0), test=(1.0,), run=lambda value: value)
    monkeypatch.setattr(rivals, "stretched", lambda scene, factor: (scene, factor))
    monkeypatch.setattr(rivals, "mls", lambda scene: scene)
    monkeypatch.setattr(rivals, "ends", lambda scene: seen.append(scene) or scene[1] < 2.0)
    assert rivals.longest_step(study) == 1.5
    assert {value for value, _ in seen} == {5.0}


def test_reduced_runs_are_compared_with_the_cheapest_run_of_no_larger_error():
    def rival(name, error, cpu):
        return name, Rival(name, PositionErrors(error, error, error), cpu, 0)

    found = dict([rival("drawn", 0.02, 2.0), rival("weighted", 0.02, 1.0),
                  rival("full", 0.0, 8.0), rival("mls.x1", 0.01, 4.0),
                  rival("coarse.2", 0.03, 0.5), rival("nearest", 0.05, 0.0),
                  rival("interpolated", 0.01, 0.0)])
    run = Records()
    record_beats(run, "beats", found["drawn"], found, "")
    assert run.values == pytest.approx({
        "beats.nearest": 2.5, "beats.interpolated": 0.5, "beats.full": 2.0})
