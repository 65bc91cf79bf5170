"""`python -m validation.training.nclaw ENVIRONMENT-gnn`: from runs to weights that tables find.
Needs PyTorch.
"""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from mpm_ref.nclaw.gnn.train.examples import training_run  # noqa: E402
from mpm_ref.nclaw.gnn.train.fit import GraphRecipe  # noqa: E402
from validation.common.scenes import with_  # noqa: E402
from validation.nclaw import trained_laws  # noqa: E402
from validation.nclaw.evaluate import compare  # noqa: E402
from validation.nclaw.simulators import GraphNet, framed_run, simulators  # noqa: E402
from validation.nclaw.tasks import reconstruction, velocity  # noqa: E402
from validation.nclaw.trained_laws import trained  # noqa: E402
from validation.training import nclaw  # noqa: E402

pytestmark = pytest.mark.usefixtures("one_torch_thread")


def scene(made=reconstruction, *seed):
    return with_(made("water", *seed), steps=15)


@pytest.fixture
def places(tmp_path, monkeypatch):
    """Folders of weights and checkpoints; two runs of three frames, and next to no training."""
    monkeypatch.setattr(nclaw, "scenes_of", lambda net: [scene(), scene(velocity, 100)])
    monkeypatch.setattr(nclaw, "graph_recipe", lambda net: GraphRecipe(
        steps=2, check=1, width=4, blocks=1, batch=1))
    monkeypatch.setattr(trained_laws, "FOLDER", tmp_path / "weights")
    trained.cache_clear()
    yield tmp_path / "weights", tmp_path / "checkpoints"
    trained.cache_clear()


def test_a_graph_network_is_trained_stored_found_and_run(places):
    nclaw.main(["water-gnn-10"], *places)
    found = trained("water-gnn-10")
    assert (found.about["method"], found.about["runs"]) == ("gnn", 10)
    assert found.about["command"] == "python -m validation.training.nclaw water-gnn-10"
    assert len(found.about["errors"]) == len(found.about["losses"]) == 2
    assert found.about["cpu_seconds"] > 0.0
    assert not list(places[1].iterdir())        # the checkpoint is not needed any more
    error = compare(scene(), [found])[0].error
    assert error == pytest.approx(found.about["errors"][found.about["picked"]], rel=1e-3)


def test_what_a_net_says_is_what_is_trained():
    net = GraphNet("sand", steps=3000, width=7, batch=3, noise=2e-4, first_rate=1e-2,
                   last_rate=1e-4, seed=5)
    recipe, plain = nclaw.graph_recipe(net), GraphRecipe(steps=1000)
    for name in ("steps", "width", "batch", "noise", "first_rate", "last_rate", "seed"):
        assert getattr(recipe, name) == getattr(net, name) != getattr(plain, name)
    for name in ("blocks", "radius", "check", "checked"):
        assert getattr(recipe, name) == getattr(plain, name)
    assert all(nclaw.graph_recipe(net).rounds == net.steps // 1000
               for net in simulators().values())


def test_the_network_is_shown_the_run_that_is_seen():
    seen = framed_run(scene())
    run = training_run(seen.x, seen.v, seen.dt, seen.box)
    assert run.count == 3
    assert np.diff(run.frames, axis=0)[:5] == pytest.approx(
        np.broadcast_to(seen.dt * seen.v, (5, 1000, 3)))
