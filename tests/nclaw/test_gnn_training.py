"""Training of the graph network: rounds, free runs that pick, checkpoints, refusals. Needs
PyTorch.
"""

from dataclasses import replace
from itertools import islice

import gnn_toys as toys
import numpy as np
import pytest
from gnn_toys import DT, RADIUS

torch = pytest.importorskip("torch")

from mpm_ref.nclaw.gnn.simulator import Simulator  # noqa: E402
from mpm_ref.nclaw.gnn.train import fit  # noqa: E402
from mpm_ref.nclaw.gnn.train.examples import example, training_run  # noqa: E402
from mpm_ref.nclaw.gnn.train.fit import (  # noqa: E402
    GraphRecipe,
    GraphSession,
    train_graph,
)
from mpm_ref.nclaw.gnn.train.network import export_weights  # noqa: E402
from mpm_ref.nclaw.gnn.weights import load, save  # noqa: E402
from mpm_ref.training import Diverged  # noqa: E402

pytestmark = pytest.mark.usefixtures("one_torch_thread")

SHORT = GraphRecipe(steps=12, width=6, blocks=2, batch=2, radius=RADIUS, first_rate=1e-2,
                    last_rate=1e-3, check=3)


@pytest.fixture(scope="module")
def runs():
    """Two runs that slow down."""
    return [training_run(*toys.braked(seed=seed), DT, toys.box()) for seed in (0, 1)]


def bits(session):
    """Weights, those picked, and history of a training."""
    return (session.history, [a.numpy().tobytes() for a in session.best.state_dict().values()],
            [a.detach().numpy().tobytes() for a in session.network.parameters()])


# rounds

def losses(session):
    """The mean loss of frames that are the same each time."""
    with torch.no_grad():
        return np.mean([session.loss(np.random.default_rng(k)).item() for k in range(30)])


def test_training_lowers_the_loss_and_the_error_of_free_runs(runs):
    recipe = replace(SHORT, steps=160, check=40, noise=1e-5, width=32, batch=1)
    session = GraphSession(recipe, runs, DT)
    loss, error = losses(session), session.error()
    session = train_graph(recipe, runs, DT)
    assert len(session.history) == 4
    assert losses(session) < 0.5 * loss
    assert session.history[-1].error == session.error() < 0.2 * error


def test_rates_fall_evenly_in_their_logarithm(runs):
    session, rates = GraphSession(SHORT, runs, DT), []
    for k in range(SHORT.steps):
        session.step(k)
        rates.append(session.optimiser.param_groups[0]["lr"])
    assert rates == pytest.approx(np.geomspace(1e-2, 1e-3, 13)[:-1])


def test_the_loss_is_summed_over_axes(runs, monkeypatch):
    """A network that answers zero has the loss of what is expected: about one for each axis."""
    session = GraphSession(SHORT, runs, DT)
    monkeypatch.setattr(session.network, "forward", lambda points, *rest: torch.zeros_like(
        points[:, :3]).requires_grad_())
    found = [session.loss(np.random.default_rng(k)).item() for k in range(50)]
    assert np.mean(found) == pytest.approx(3.0, rel=0.1)


def test_a_batch_is_the_mean_of_its_frames(runs):
    session = GraphSession(replace(SHORT, batch=3), runs, DT)
    draws = np.random.default_rng((SHORT.seed, 5))
    with torch.no_grad():
        losses = [session.loss(draws).item() for _ in range(3)]
    assert session.step(5) == pytest.approx(np.mean(losses), rel=1e-6)


def test_runs_and_their_frames_come_at_random(runs, monkeypatch):
    session, seen = GraphSession(SHORT, runs, DT), set()
    numbers = {id(run.frames): k for k, run in enumerate(runs)}

    def noted(run, k, reading, noise):
        seen.add((numbers[id(run.frames)], k))
        return example(run, k, reading, noise)

    monkeypatch.setattr(fit, "example", noted)
    for k in range(120):
        session.loss(np.random.default_rng(k))
    assert seen == {(number, k) for number in (0, 1) for k in range(7)}


# what is picked

@pytest.mark.parametrize("checked", [1, 2])
def test_the_error_is_that_of_free_runs_from_the_start(runs, double, checked):
    """Over all frames, the first one included; of the first runs, as many as are asked for."""
    session, errors = GraphSession(replace(SHORT, checked=checked), runs, DT), []
    session.network.double()
    for seed, run in enumerate(runs):
        x, v = toys.braked(seed=seed)
        simulator = Simulator(export_weights(session.network), session.reading, {})
        found = simulator.run(x[0], v, run.box)
        errors.append(np.mean((np.array(list(islice(found, 8))) - x) ** 2))
    assert session.error() == pytest.approx(np.mean(errors[:checked]), rel=1e-9)
    assert abs(errors[1] - errors[0]) > 1e-2 * errors[0]


def test_the_round_with_the_least_error_is_picked(runs, monkeypatch, tmp_path):
    errors, at_rounds = iter([3.0, np.inf, 1.0, 2.0]), []
    monkeypatch.setattr(GraphSession, "error", lambda self: at_rounds.append(
        self.network.answer.layers[2].weight.detach().clone()) or next(errors))
    session = train_graph(SHORT, runs, DT)
    assert session.picked == 2
    save(tmp_path / "gnn.npz", session.simulator({"picked": 2}))
    W = load(tmp_path / "gnn.npz").network.answer.layers[2][0]
    np.testing.assert_array_equal(W.T, at_rounds[2].double().numpy())
    assert not np.array_equal(W.T, at_rounds[3].double().numpy())
    assert torch.equal(session.network.answer.layers[2].weight, at_rounds[3])


def test_free_runs_that_break_down_are_told(runs, monkeypatch):
    monkeypatch.setattr(GraphSession, "answer", lambda self, points, *rest: np.full(
        (len(points), 3), np.nan))
    session = train_graph(SHORT, runs, DT)
    assert [one.error for one in session.history] == 4 * [np.inf]
    with pytest.raises(Diverged, match=r"^all 4 free runs broke down; try more steps"):
        session.simulator({})


def test_a_loss_that_is_no_number_is_told(runs):
    session = GraphSession(SHORT, runs, DT)
    with torch.no_grad():
        session.network.points.layers[0].bias[0] = np.nan
    with pytest.raises(Diverged, match=r"^step 3: the loss is nan; try smaller rates$"):
        session.step(3)


# checkpoints

def test_a_training_that_was_cut_off_goes_on_bit_for_bit(tmp_path, runs):
    whole, rounds = bits(train_graph(SHORT, runs, DT)), []

    def cut(history):
        rounds.append(len(history))
        if rounds == [1, 2]:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train_graph(SHORT, runs, DT, tmp_path / "a.pt", cut)
    torch.rand(3)
    assert bits(train_graph(SHORT, runs, DT, tmp_path / "a.pt", cut)) == whole
    assert rounds[2:] == [3, 4]


@pytest.mark.parametrize("settings", [
    {"steps": 12}, {"width": 7}, {"blocks": 1}, {"batch": 1}, {"noise": 0.0}, {"radius": 0.1},
    {"first_rate": 1e-4}, {"last_rate": 1e-6}, {"check": 6}, {"checked": 2}, {"seed": 1}])
def test_a_checkpoint_of_another_recipe_is_refused(tmp_path, runs, settings):
    path, recipe = tmp_path / "a.pt", replace(SHORT, steps=6)
    train_graph(recipe, runs, DT, path)
    with pytest.raises(ValueError, match=r"is a checkpoint of the training .*, not of .*; remove"):
        train_graph(replace(recipe, **settings), runs, DT, path)


def test_a_checkpoint_of_other_runs_is_refused(tmp_path, runs):
    path, recipe = tmp_path / "a.pt", replace(SHORT, steps=3)
    train_graph(recipe, runs, DT, path)
    moved = runs[0]._replace(box=toys.box()._replace(low=np.full(3, 1e-3)))
    for others, dt in ((runs[::-1], DT), ([moved, runs[1]], DT), (runs, 2.0 * DT)):
        with pytest.raises(ValueError, match="is a checkpoint of the training"):
            train_graph(recipe, others, dt, path)


# recipes

@pytest.mark.parametrize(("settings", "said"), [
    ({"width": 0}, "width = 0: expected at least 1"),
    ({"radius": 0.0}, "radius = 0.0: expected a positive number"),
    ({"noise": -1.0}, "noise = -1.0: expected a number >= 0"),
    ({"last_rate": np.inf}, "last_rate = inf: expected a positive number"),
    ({"steps": 13}, "steps = 13, check = 3: expected a multiple of it, so that the last step")])
def test_recipes_that_cannot_be_are_refused(settings, said):
    with pytest.raises(ValueError, match=said):
        replace(SHORT, **settings)


def test_by_default_a_recipe_is_that_of_the_graph_network_paper():
    recipe = GraphRecipe()
    assert (recipe.width, recipe.blocks, recipe.batch, recipe.noise) == (128, 10, 2, 3e-4)
    assert (recipe.steps, recipe.rate(0), recipe.rate(20_000_000)) == (
        20_000_000, 1e-4, pytest.approx(1e-6))
