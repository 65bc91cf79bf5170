"""Training of neural laws: epochs, batches, checkpoints, and what goes wrong. Needs PyTorch."""

import json
from dataclasses import replace

import numpy as np
import pytest
from nclaw_toys import cube

torch = pytest.importorskip("torch")

from mpm_ref import training  # noqa: E402
from mpm_ref.materials.learned.response import Correction, PlainStress, Stress  # noqa: E402
from mpm_ref.nclaw.batched_step import make_world  # noqa: E402
from mpm_ref.nclaw.train import fit  # noqa: E402
from mpm_ref.nclaw.train.fit import TrajectorySession, train  # noqa: E402
from mpm_ref.nclaw.train.neural_laws import (  # noqa: E402
    NeuralLawModule,
    NoFlowModule,
    UnshiftedLawModule,
    neural_laws,
)
from mpm_ref.nclaw.train.observations import Trajectory, trajectory_of  # noqa: E402
from mpm_ref.nclaw.train.recipe import Recipe  # noqa: E402
from mpm_ref.nclaw.train.rollout import LawPair  # noqa: E402
from mpm_ref.training import Diverged  # noqa: E402
from mpm_ref.trajectories import observed  # noqa: E402

STEPS = 11          # segments of 3 and 2 steps
SHORT = Recipe(epochs=5, first=3, last=6, batch=2, elastic_rate=1e-2, plastic_rate=1e-3)

pytestmark = pytest.mark.usefixtures("one_torch_thread")


@pytest.fixture(scope="module")
def run():
    """`World` and `Trajectory` of a small cube."""
    problem = cube(STEPS)
    return make_world(problem), trajectory_of(observed(problem))


def laws():
    """Laws whose answers matter, though their weights begin near one."""
    return neural_laws(0, Stress(1e5), Correction(0.1))


def parameters(laws):
    return [a for law in laws for a in law.parameters()]


def bits(session):
    """Weights and history of a training."""
    return session.history, [a.detach().numpy().tobytes() for a in parameters(session.laws)]


# Epochs.

@pytest.mark.slow
def test_training_lowers_the_error(run):
    recipe = replace(SHORT, epochs=40, last=3)
    history = train(recipe, laws(), *run).history
    assert len(history) == 40
    assert history[-1].error < 0.3 * history[0].error


@pytest.mark.parametrize("reading", ["release", "printed"])
def test_what_an_epoch_says(run, reading):
    """The release's loss is 1e4 segments/steps times the sum, the printed one the mean error."""
    session = train(replace(SHORT, reading=reading), laws(), *run)
    assert [epoch.segments for epoch in session.history] == [4, 4, 3, 3, 2]
    for epoch in session.history:
        factor = 1e4 * epoch.segments if reading == "release" else 1.0
        assert epoch.loss == pytest.approx(factor * epoch.error, rel=1e-12)


def test_errors_are_of_positions_whatever_velocities_weigh(run):
    """Their term is in the loss alone, in proportion to its weight."""
    none, one, two = (first_gradients(replace(SHORT, velocity=weight), laws(), run)[1]
                      for weight in (0.0, 1e-4, 2e-4))
    assert none.error == one.error == two.error > 0.0
    assert one.loss > 1.001 * none.loss
    assert two.loss - none.loss == pytest.approx(2.0 * (one.loss - none.loss), rel=1e-9)


def test_a_training_says_what_its_errors_are_of(run):
    """Checkpoints with a term of velocities that do not say it had that in their errors."""
    for weight in (0.0, 1e-4):
        session = TrajectorySession(replace(SHORT, velocity=weight), laws(), *run)
        assert ("errors_of" in json.loads(session.description)) == (weight > 0.0)
    session.epoch()
    assert session.errors == {"errors": [session.history[0].error], "errors_of": "positions"}


def test_checkpoints_of_before_go_on(run):
    """A training without a term that is newer describes itself as before."""
    plain, term = (json.loads(TrajectorySession(replace(SHORT, idempotence=weight), laws(),
                                                *run).description) for weight in (0.0, 1e-3))
    assert term == {**plain, "idempotence": 1e-3}
    assert "idempotence" not in plain


def first_gradients(recipe, laws, run):
    """Those that the first epoch steps with, and what it says."""
    session = TrajectorySession(recipe, laws, *run)
    session.epoch()
    return [a.grad for a in parameters(laws)], session.history[0]


def norm(arrays):
    return sum(a.norm().item() ** 2 for a in arrays) ** 0.5


def test_gradients_are_those_of_the_loss_that_is_said(run):
    """Those of the release are 1e4 times the segments those of the printed mean error."""
    uncut = replace(SHORT, clip=1e9)
    release, said = first_gradients(uncut, laws(), run)
    printed, _ = first_gradients(replace(uncut, reading="printed"), laws(), run)
    for a, b in zip(release, printed, strict=True):
        assert 0.0 < (a / (1e4 * 4) - b).norm() < 1e-5 * b.norm()
    assert said.steepness == pytest.approx((norm(release[:3]), norm(release[3:])), rel=1e-5)


@pytest.mark.parametrize("batch", [1, 3, 9])
def test_a_batch_changes_nothing_but_round_off(run, monkeypatch, batch):
    """With networks of doubles; segments are of unlike lengths."""
    monkeypatch.setattr(torch.Tensor, "float", torch.Tensor.double)
    found, said = [], []
    for recipe in (SHORT, replace(SHORT, batch=batch)):
        doubles = LawPair(*(law.double() for law in laws()))
        for into, what in zip((found, said), first_gradients(recipe, doubles, run)):
            into.append(what)
    assert said[1].loss == pytest.approx(said[0].loss, rel=1e-12)
    for a, b in zip(*found, strict=True):
        assert 0.0 < (a - b).norm() < 1e-11 * b.norm()


def test_gradients_are_cut_to_a_norm_law_by_law(run):
    steep = replace(SHORT, scale=1e12)       # PyTorch adds 1e-6 to norms before it divides
    whole, said = first_gradients(replace(steep, clip=1e9), laws(), run)
    clip = 0.5 * (said.steepness[0] + said.steepness[1])
    found, again = first_gradients(replace(steep, clip=clip), laws(), run)
    assert again == said                            # as it was before
    for of in (slice(0, 3), slice(3, 6)):
        assert norm(found[of]) == pytest.approx(min(clip, norm(whole[of])), rel=1e-4)
        for a, b in zip(found[of], whole[of], strict=True):
            assert norm([a / norm(found[of]) - b / norm(whole[of])]) < 1e-5


def test_rates_fall_by_half_a_cosine(run):
    """NCLAW-train: each law at its own rate, down to zero."""
    rates, session = [], TrajectorySession(SHORT, laws(), *run)
    for _ in range(SHORT.epochs):
        rates.append([optimiser.param_groups[0]["lr"] for optimiser in session.optimisers])
        session.epoch()
    share = 0.5 * (1.0 + np.cos(np.pi * np.arange(SHORT.epochs) / SHORT.epochs))
    assert np.array(rates) == pytest.approx(np.outer(share, (1e-2, 1e-3)))
    assert session.optimisers[0].param_groups[0]["lr"] == pytest.approx(0.0, abs=1e-12)


def test_one_law_alone_is_trained(run):
    class Identity(torch.nn.Module):
        def forward(self, F):
            return F

    elastic = laws().elastic
    before = [a.clone() for a in elastic.parameters()]
    session = train(SHORT, LawPair(elastic, Identity()), *run)
    assert [epoch.steepness[1] for epoch in session.history] == [0.0] * SHORT.epochs
    assert not any(map(torch.equal, before, elastic.parameters()))


# What goes wrong.

def test_a_law_that_answers_no_number_is_told(run):
    broken = laws()
    with torch.no_grad():
        broken.elastic.net.layers[0].weight[3, 2] = np.nan
    with pytest.raises(Diverged, match=r"^epoch 1, steps 0 to 6: particle \d+ of body \d is at "
                                       r"\[.*nan.*has the law made the run unstable\? Try "
                                       "smaller rates, a smaller unit or shorter horizons$"):
        train(SHORT, broken, *run)
    with pytest.raises(Diverged, match=r"^epoch 1, steps 0 to 1: the loss is nan\. Try "):
        train(replace(SHORT, first=1, last=1, batch=1), broken, *run)


def test_a_training_that_explodes_is_told(run):
    """Absurd rates: the first step takes the weights too far, the second epoch breaks down."""
    seen = []
    with pytest.raises(Diverged, match=r"^epoch 2, steps 0 to \d+: "):
        train(replace(SHORT, elastic_rate=1e12), laws(), *run, on_epoch=seen.append)
    assert len(seen) == 1


def test_a_gradient_that_is_not_finite_is_told(run):
    broken = laws()
    broken.plastic.net.layers[1].weight.register_hook(lambda g: g / 0.0)
    with pytest.raises(Diverged, match=r"^epoch 1: a gradient of norm (inf|nan)\. Try "):
        train(SHORT, broken, *run)


# Checkpoints.

@pytest.mark.parametrize("save", [1, 2])
def test_a_training_that_was_cut_off_goes_on_bit_for_bit(tmp_path, monkeypatch, run, save):
    monkeypatch.setattr(fit, "SAVE", save)
    whole, epochs = bits(train(SHORT, laws(), *run)), []

    def cut(history):
        epochs.append(len(history))
        if epochs == [1, 2, 3]:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(SHORT, laws(), *run, tmp_path / "a.pt", cut)
    torch.rand(3)
    other = neural_laws(7, Stress(1e5), Correction(0.1))
    assert bits(train(SHORT, other, *run, tmp_path / "a.pt", cut)) == whole
    assert epochs[3:] == list(range(3 // save * save + 1, 6))
    assert [file.name for file in tmp_path.iterdir()] == ["a.pt"]


def test_the_cost_is_that_of_all_parts(tmp_path, monkeypatch, run):
    now = [0.0]
    monkeypatch.setattr(training, "process_time", lambda: 10.0 + 2.0 * now[0])
    monkeypatch.setattr(training, "perf_counter", lambda: 30.0 + 3.0 * now[0])
    monkeypatch.setattr(fit, "SAVE", 2)

    def second(history):
        now[0] += 1.0
        if len(history) == 3 and now[0] == 3.0:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(SHORT, laws(), *run, tmp_path / "a.pt", second)
    now[0] += 100.0
    session = train(SHORT, laws(), *run, tmp_path / "a.pt", second)
    # Saved within the second epoch's second, before it is over: 1 s, then three epochs.
    assert session.meter.total == pytest.approx((2.0 * 4.0, 3.0 * 4.0))


@pytest.fixture
def checkpoint(tmp_path, monkeypatch, run):
    monkeypatch.setattr(fit, "SAVE", 1)
    train(replace(SHORT, epochs=1), laws(), *run, tmp_path / "a.pt")
    return tmp_path / "a.pt"


def refused(path, said, run, recipe, begun=None):
    with pytest.raises(ValueError, match=said) as refusal:
        train(recipe, begun or laws(), *run, path)
    text = str(refusal.value)
    assert text.startswith(str(path))
    assert "; remove it" in text
    assert "\n" not in text


@pytest.mark.parametrize("settings", [
    {"epochs": 2}, {"seed": 1}, {"elastic_rate": 2.0}, {"plastic_rate": 1.0}, {"clip": 1.0},
    {"first": 2}, {"last": 7}, {"reading": "printed"}, {"scale": 1.0}])
def test_a_checkpoint_of_another_recipe_is_refused(checkpoint, run, settings):
    recipe = replace(SHORT, **{"epochs": 1, **settings})
    refused(checkpoint, "is a checkpoint of the training .*, not of ", run, recipe)


@pytest.mark.parametrize("others", [
    {"elastic": lambda: NeuralLawModule(Stress(2e5))},
    {"elastic": lambda: NeuralLawModule(PlainStress(1e5))},
    {"elastic": lambda: NeuralLawModule(Stress(1e5), hidden=(64, 8))},
    {"elastic": lambda: UnshiftedLawModule(Stress(1e5))},
    {"plastic": lambda: NoFlowModule(Correction(0.1))},
    {"plastic": lambda: NeuralLawModule(Correction(0.2))}],
    ids=["unit", "kind", "sizes", "biases", "class", "alpha"])
def test_a_checkpoint_of_other_laws_is_refused(checkpoint, run, others):
    begun = laws()._replace(**{part: make() for part, make in others.items()})
    refused(checkpoint, "is a checkpoint of the training", run, replace(SHORT, epochs=1), begun)


def test_a_checkpoint_goes_on_in_other_batches(checkpoint, run):
    other = replace(SHORT, epochs=1, batch=SHORT.batch + 1)
    train(other, laws(), *run, checkpoint, lambda _: pytest.fail("trained anew"))


@pytest.mark.parametrize("name", [*Trajectory._fields, "dx", "dt", "gravity", "eps", "low", "high",
                                  "lower", "upper", "m", "V0"])
def test_a_checkpoint_of_other_data_is_refused(checkpoint, run, name):
    of, data = run
    if name in Trajectory._fields:
        data = data._replace(**{name: 1.01 * getattr(data, name)})
    else:
        of = of._replace(**{name: 2 * getattr(of, name)})
    refused(checkpoint, "is a checkpoint of the training", (of, data), replace(SHORT, epochs=1))


@pytest.mark.parametrize("damage", [lambda b: b[:len(b) // 2], lambda b: b[:20], lambda b: b"",
                                    lambda b: b"text" + b[4:], lambda b: b"no checkpoint",
                                    lambda b: b[:-200] + b"?" + b[-199:]])
def test_a_damaged_checkpoint_is_refused(checkpoint, run, damage):
    checkpoint.write_bytes(damage(checkpoint.read_bytes()))
    refused(checkpoint, "is damaged or no checkpoint", run, replace(SHORT, epochs=1))


def test_a_folder_that_is_not_there_is_named(tmp_path, run):
    path = tmp_path / "none" / "a.pt"
    with pytest.raises(ValueError, match=r"a\.pt: there is no folder .*none; create it or name"):
        train(SHORT, laws(), *run, path)
