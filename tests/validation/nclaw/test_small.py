"""Trainings of which not all is seen, and the trainer of small laws. Needs PyTorch."""

import numpy as np
import pytest
from nclaw_toys import cube

torch = pytest.importorskip("torch")

from mpm_ref.materials.learned.response import Correction, Stress  # noqa: E402
from mpm_ref.nclaw.batched_step import make_world  # noqa: E402
from mpm_ref.nclaw.train import fit  # noqa: E402
from mpm_ref.nclaw.train.fit import train  # noqa: E402
from mpm_ref.nclaw.train.neural_laws import neural_laws  # noqa: E402
from mpm_ref.nclaw.train.observations import (  # noqa: E402
    PartialTrajectory,
    Trajectory,
    trajectory_of,
)
from mpm_ref.nclaw.train.recipe import Recipe  # noqa: E402
from mpm_ref.nclaw.train.rollout import segment_errors  # noqa: E402
from mpm_ref.training import Diverged  # noqa: E402
from mpm_ref.trajectories import Observed, observed  # noqa: E402
from validation.common.scenes import with_  # noqa: E402
from validation.nclaw.observation import Observation  # noqa: E402
from validation.nclaw.small_trainings import Small, identity  # noqa: E402
from validation.training import small  # noqa: E402
from validation.training.small import bundled, run_of, training_data  # noqa: E402

STEPS = 11
SHORT = Recipe(epochs=3, first=3, last=6, batch=2, elastic_rate=1e-2, plastic_rate=1e-3)

pytestmark = pytest.mark.usefixtures("one_torch_thread")


@pytest.fixture(scope="module")
def run():
    """`World` and `Trajectory` of a small cube."""
    problem = cube(STEPS)
    return make_world(problem), trajectory_of(observed(problem))


def laws():
    return neural_laws(0, Stress(1e5), Correction(0.1))


def partial(whole, weight):
    return PartialTrajectory(*whole, torch.from_numpy(np.ascontiguousarray(weight)))


def ones(whole):
    return np.ones(whole.x.shape[:2])


def gradients(data, where, cuts, velocity=0.0):
    """The loss of segments, and its gradients."""
    made = laws()
    loss = segment_errors(made, where, data, cuts[:-1], cuts[1:], Recipe(velocity=velocity)).loss
    loss.backward()
    return loss.item(), [a.grad.clone() for law in made for a in law.parameters()]


# What counts.

def test_what_is_seen_in_whole_trains_as_ever(run):
    """Bit for bit, but for how sums are ordered."""
    where, whole = run
    for velocity in (0.0, 1e-4):
        one = gradients(whole, where, [0, 5, STEPS], velocity)
        same = gradients(partial(whole, ones(whole)), where, [0, 5, STEPS], velocity)
        assert same[0] == pytest.approx(one[0], rel=1e-12)
        for a, b in zip(same[1], one[1], strict=True):
            assert 0.0 < b.norm()
            assert (a - b).norm() <= 1e-5 * b.norm()


def test_what_is_not_seen_is_never_read(run):
    """Errors count where weights do; the rest may be anything, in the gradients too."""
    where, whole = run
    weight = ones(whole)
    weight[:, ::2] = 0.0
    weight[[2, 3, 7]] = 0.0
    hidden = [torch.where(torch.from_numpy(weight).reshape(*weight.shape, *[1] * (a.ndim - 2)) > 0,
                          a, torch.nan) for a in whole]
    begins = [0, 5, STEPS]
    for a, true in zip(hidden, whole, strict=True):
        a[[0, 5]] = true[[0, 5]]        # where segments begin all is known
    one = gradients(partial(whole, weight), where, begins, 1e-4)
    other = gradients(partial(hidden, weight), where, begins, 1e-4)
    assert other[0] == one[0] > 0.0
    assert all(map(torch.equal, one[1], other[1]))


def test_weights_are_those_of_squared_errors(run):
    whole = run[1]
    weight = np.random.default_rng(0).random(whole.x.shape[:2])
    data, a = partial(whole, weight), whole.x[[4, 6]] + 0.1
    expected = 0.01 * weight[[4, 6]].mean(axis=1).sum()
    assert data.squared_error("x", a, torch.tensor([4, 6])).item() == pytest.approx(expected)
    assert data.squared_error("v", whole.v[[4]], torch.tensor([4])).item() == 0.0


def test_segments_begin_where_something_is_seen(run):
    weight = ones(run[1])
    weight[[1, 2, 3, 6]] = 0.0
    data = partial(run[1], weight)
    assert data.restarts([0, 2, 4, 6, STEPS]) == [0, 4, 5, STEPS]
    assert data.restarts([0, 3, STEPS]) == [0, STEPS]
    assert run[1].restarts([0, 3, STEPS]) == [0, 3, STEPS]


def test_a_training_counts_its_segments_as_they_are(run):
    weight = ones(run[1])
    weight[1:5] = 0.0
    session = train(SHORT, laws(), run[0], partial(run[1], weight))
    assert [epoch.segments for epoch in session.history] == [3, 2, 2]
    assert [epoch.segments for epoch in train(SHORT, laws(), *run).history] == [4, 3, 3]


def test_a_checkpoint_knows_what_was_seen(run, tmp_path, monkeypatch):
    monkeypatch.setattr(fit, "SAVE", 1)
    where, whole = run
    weight = ones(whole)
    weight[:, 0] = 0.0
    train(SHORT, laws(), where, partial(whole, weight), tmp_path / "a.pt")
    with pytest.raises(ValueError, match="is a checkpoint of the training"):
        train(SHORT, laws(), where, partial(whole, ones(whole)), tmp_path / "a.pt")


# The trainer.

@pytest.fixture
def toy(monkeypatch):
    """The trainer on a small cube of a few steps."""
    monkeypatch.setattr(small, "run_of", lambda net: observed(cube(STEPS)))
    monkeypatch.setattr(small, "build", lambda scene: cube(STEPS))
    return Small(epochs=3, first=3, last=6, checkpoints=(1, 2))


def test_a_bundle_holds_what_was_asked_for(toy):
    made = bundled("toy", toy, 1)
    assert list(made.laws) == [1, 2, 3]
    assert {key: made.about[key] for key in identity(toy)} == identity(toy)
    assert len(made.about["errors"]) == len(made.about["cpu_seconds"]) == 3
    assert made.about["stopped"] == ""
    weights = [kept.elastic.layers[0][0] for kept in made.laws.values()]
    assert not np.array_equal(*weights[:2])
    for kept in made.laws.values():
        assert kept.about["dt"] == 5e-4
        assert len(kept.about["seen"]["low"]) == 4


def test_laws_are_as_wide_as_asked_for(toy):
    made = bundled("toy", toy._replace(width=8, checkpoints=()), 1)
    assert [W.shape for W, _ in made.laws[3].elastic.layers] == [(13, 8), (8, 8), (8, 9)]


def test_the_same_seed_gives_the_same_laws(toy):
    one, again, other = (bundled("toy", toy._replace(seed=seed), 1).laws[3].plastic.layers[0][0]
                         for seed in (0, 0, 1))
    assert np.array_equal(one, again)
    assert not np.array_equal(one, other)


def test_a_training_that_diverges_is_kept_as_far_as_it_came(toy, monkeypatch):
    def broken(recipe, laws, where, data, checkpoint, show):
        done = train(Recipe(epochs=2, first=3, last=6), laws, where, data, None, show)
        assert len(done.history) == 2
        raise Diverged("epoch 2: the loss is nan; try smaller rates")

    monkeypatch.setattr(small, "train", broken)
    made = bundled("toy", toy, 1)
    assert list(made.laws) == [1, 2]
    assert made.about["stopped"] == "epoch 2: the loss is nan; try smaller rates"


@pytest.mark.parametrize("observation", [Observation(every=3), Observation(positions=True),
                                         Observation(share=0.5, noise=1e-4)])
def test_a_training_takes_what_is_observed(toy, observation):
    true = observed(cube(STEPS))
    found, data = training_data(toy._replace(observation=observation), true)
    assert isinstance(data, PartialTrajectory)
    assert isinstance(found, Observed)
    made = bundled("toy", toy._replace(observation=observation), 1)
    assert np.isfinite(made.about["errors"]).all()
    assert isinstance(training_data(toy, true)[1], Trajectory)


def test_a_run_is_of_all_steps(monkeypatch):
    short = with_(Small().scene, steps=7)
    monkeypatch.setattr(Small, "scene", short)
    assert run_of(Small()).x.shape == (8, 216, 3)
