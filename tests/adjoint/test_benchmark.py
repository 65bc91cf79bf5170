"""The gradients that `python -m benchmarks gradients` times."""

import numba
import numpy as np
import pytest

from benchmarks import gradients
from benchmarks.gradients import AGREE, disagreement, gradient_rows, require_agreement
from benchmarks.ours_gradient import OurGradient
from benchmarks.problem import block, loss_of_run
from mpm_ref.core.jit import set_threads

CELLS, STEPS, THREADS = 7, 3, 1


@pytest.fixture(autouse=True)
def threads():
    """Backends set the number of threads."""
    before = numba.get_num_threads()
    yield
    set_threads(before)


@pytest.fixture(scope="module")
def small():
    return block(CELLS, shuffle=True)


def loss_of(small, x, v):
    return OurGradient(loss_of_run(small._replace(x=x, v=v), STEPS), THREADS).gradient()[0]


def test_gradient_agrees_with_central_differences(small):
    _, x_bar, v_bar = OurGradient(loss_of_run(small, STEPS), THREADS).gradient()
    rng = np.random.default_rng(1)
    for bar, h, axis in ((x_bar, 1e-6, 0), (v_bar, 1e-3, 1)):
        d = rng.standard_normal(small.x.shape)
        sides = []
        for sign in (1.0, -1.0):
            state = [small.x, small.v]
            state[axis] = state[axis] + sign * h * d
            sides.append(loss_of(small, *state))
        assert (sides[0] - sides[1]) / (2.0 * h) == pytest.approx(np.sum(bar * d), rel=1e-6)


def found(x_bar):
    return 1.0, np.array(x_bar), np.array([2.0])


def test_disagreement_is_relative_to_the_largest_entry_of_the_first():
    assert disagreement({"a": found([1.0, -4.0]), "b": found([2.0, -5.0])}) == 0.25
    assert disagreement({"a": found([1.0])}) == 0.0


@pytest.mark.parametrize("other", [1.0 + 4.0 * AGREE, np.nan])
def test_gradients_that_disagree_are_refused(other):
    with pytest.raises(SystemExit, match="a, b disagree"):
        require_agreement({"a": found([1.0]), "b": found([other])})


def test_row_of_our_backend(small, monkeypatch):
    timed = {"mpm_ref": [2.0, 10.0]}, {"mpm_ref": [5.0, 25.0]}, {"mpm_ref": 7}
    monkeypatch.setattr(gradients, "timed_rounds", lambda plain, tapes, problem, repeats: (
        *timed, {"mpm_ref": tapes["mpm_ref"].run(1)[2]}))
    (row,) = gradient_rows(small, ["mpm_ref"], 2, THREADS, 1)
    assert row == {"particles": len(small.x), "steps": 2, "backend": "mpm_ref",
                   "forward_wall_ns": 2.0, "forward_cpu_ns": 10.0, "gradient_wall_ns": 5.0,
                   "gradient_cpu_ns": 25.0, "cpu_ratio": 2.5, "cpu_ratio_to_ours": 1.0,
                   "memory_bytes": 7, "disagreement": 0.0}


def test_gradients_that_change_from_call_to_call_are_refused(small, monkeypatch):
    def timed(plain, tapes, problem, repeats):
        return *({"mpm_ref": [1.0, 1.0]} for _ in range(3)), {
            "mpm_ref": found([1.0]), "other": found([2.0])}

    monkeypatch.setattr(gradients, "timed_rounds", timed)
    with pytest.raises(SystemExit, match="disagree"):
        gradient_rows(small, ["mpm_ref"], 2, THREADS, 1)
