"""Bread with other weak elements, and sand past its training."""

from types import SimpleNamespace

import numpy as np
import pytest

from mpm_ref.rom.kinematics import NoBody
from mpm_ref.rom.study import monitor
from mpm_ref.rom.study.full_model import nsf_full_model
from mpm_ref.rom.study.run import nsf_run
from validation.nsf import reduced_runs, unseen_runs
from validation.nsf.studies import bread


@pytest.fixture(scope="module")
def slice_of_bread():
    return reduced_runs.fit_study(bread(4, train=3)._replace(test=(unseen_runs.E,)))


def boxes(scene):
    """Lower and upper ends of the weak boxes along x."""
    return np.array([[box.lower[0], box.upper[0]] for box in scene.body[1].shape.shapes])


def test_weak_boxes_are_shifted_in_both_bodies_and_stay_between_the_ends():
    base = bread(2).run(unseen_runs.E)
    mild, rough = (unseen_runs.shifted(base, scale, 0) for scale in (0.08, 0.3))
    for scene in (mild, rough):
        assert scene.body[0].shape.minus == scene.body[1].shape.shapes
        assert (boxes(scene)[:, 0] > 0.4 - 1e-12).all()
        assert (boxes(scene)[:, 1] < 0.6 + 1e-12).all()
        assert np.allclose(np.ptp(boxes(scene), axis=1), 0.025)
    off = [np.abs(boxes(scene) - boxes(base)).max() for scene in (mild, rough)]
    assert 0.005 < off[0] <= 0.02
    assert off[1] > 2.0 * off[0]
    assert unseen_runs.shifted(base, 0.08, 0) == mild
    assert unseen_runs.shifted(base, 0.08, 1) != mild


def test_points_are_in_the_order_of_training(slice_of_bread):
    one = slice_of_bread
    scene = unseen_runs.shifted(one.study.run(unseen_runs.E), 0.3, 0)
    assert not np.array_equal(nsf_full_model(scene).X, one.runs.X)
    test = unseen_runs.simulated(one, scene)
    assert np.abs(test.X - one.runs.X).max() < 1e-12
    assert np.abs(test.x[0, 0] - one.runs.X).max() < 1e-6
    usual = one.tests[unseen_runs.E]
    assert test.x.shape == usual.x.shape
    assert np.abs(test.x[0, -1] - usual.x[0, -1]).max() > 1e-3


def test_other_points_are_refused(slice_of_bread):
    scene = bread(5).run(unseen_runs.E)
    with pytest.raises(ValueError, match="expected the same slice"):
        unseen_runs.simulated(slice_of_bread, scene)


@pytest.mark.parametrize(("shift", "side", "end"), [(1.0, "upper", 0.6), (-1.0, "lower", 0.4)])
def test_a_box_goes_no_farther_than_the_held_ends(shift, side, end):
    box = bread(2).run(unseen_runs.E).body[1].shape.shapes[0]
    gone = unseen_runs.shifted_box(box, shift)
    assert getattr(gone, side)[0] == pytest.approx(end)
    assert gone.upper[0] - gone.lower[0] == pytest.approx(box.upper[0] - box.lower[0])
    assert gone.lower[1:] == pytest.approx(box.lower[1:])


def test_the_farthest_state_is_that_of_the_whole_run(slice_of_bread, monkeypatch):
    """A run with the value of training stays near it; where it breaks down, what it reached
    counts.
    """
    one, value = slice_of_bread, slice_of_bread.study.train[1]
    seen = []

    class Watched(monitor.FieldMonitor):
        def check(self, state, last=None):
            seen.append(super().check(state, last))
            return seen[-1]

    monkeypatch.setattr(unseen_runs, "field_monitor", lambda fields, xhat: Watched(
        *monitor.field_monitor(fields, xhat)))
    far = unseen_runs.farthest(one, value)
    assert len(seen) == nsf_full_model(one.study.run(value)).problem.clock.steps + 1
    assert far == max(sight.beyond for sight in seen)

    def breaks(*given):
        def states():
            for k, state in enumerate(nsf_run(*given).states()):
                if k == 3:
                    raise NoBody("gone")
                yield state

        return SimpleNamespace(states=states)

    monkeypatch.setattr(unseen_runs, "nsf_run", breaks)
    assert unseen_runs.farthest(one, value) == max(sight.beyond for sight in seen[:3])
