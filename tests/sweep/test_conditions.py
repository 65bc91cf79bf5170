from types import SimpleNamespace

import numpy as np
import pytest

from mpm_ref.sweep.conditions import ImpulseRecorder


@pytest.fixture
def recorder():
    given = SimpleNamespace(apply=lambda grid, t, dt: grid, walls="walls")
    return ImpulseRecorder(given, ["floor"], 2)


def test_impulses_of_steps_add_up(recorder):
    for k in range(1, 4):
        recorder.apply(np.array([[1.0, k]]), t=0.1 * k, dt=0.1)
        assert recorder.impulses()["floor"] == pytest.approx([k, k * (k + 1) / 2])


def test_a_step_that_is_taken_again_counts_once(recorder):
    recorder.apply(np.array([[1.0, 1.0]]), t=0.1, dt=0.1)
    recorder.apply(np.array([[9.0, 9.0]]), t=0.3, dt=0.2)       # rejected
    recorder.apply(np.array([[2.0, 2.0]]), t=0.2, dt=0.1)
    recorder.apply(np.array([[4.0, 4.0]]), t=0.3, dt=0.1)
    assert recorder.impulses()["floor"] == pytest.approx([7.0, 7.0])


def test_other_attributes_are_those_of_the_conditions(recorder):
    assert recorder.walls == "walls"
