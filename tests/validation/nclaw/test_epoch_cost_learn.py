"""The cost of an epoch, which `nclaw.segments` measures in processes of its own. Needs PyTorch."""

from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("torch")

from validation.training.epoch_cost import epoch_cost, session_of

MB = 1e6

pytestmark = pytest.mark.usefixtures("one_torch_thread")


class Allocating:
    """A session whose epoch fills an array of so many megabytes, which it frees again."""

    def __init__(self, megabytes):
        self.megabytes, self.history = megabytes, []

    def epoch(self):
        np.ones(int(self.megabytes * MB / 8)).sum()
        self.history.append(SimpleNamespace(loss=3.0, steepness=(1.0, 2.0)))


def test_memory_is_of_the_epoch_whatever_was_needed_before():
    np.ones(int(600 * MB / 8)).sum()
    found = epoch_cost(Allocating(200))
    assert 150 * MB < found["during"] - found["before"] < 300 * MB
    assert found["process"] >= found["before"] + 500 * MB
    assert found["cpu"] > 0.0
    assert (found["loss"], found["gradients"]) == (3.0, (1.0, 2.0))


@pytest.mark.parametrize("keep_every", [1, 3])
def test_the_observed_run_is_the_only_segment(keep_every):
    session = session_of(keep_every, 7)
    session.epoch()
    assert (session.history[-1].segments, len(session.observed.x)) == (1, 8)
    assert session.recipe.keep_every == keep_every
    assert session.history[-1].error < 1e-3
