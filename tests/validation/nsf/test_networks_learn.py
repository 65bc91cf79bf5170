"""The command that trains the networks of NSF's scenes, with a small study. Needs PyTorch."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from mpm_ref.rom.fields.pod_fields import Sizes  # noqa: E402
from mpm_ref.rom.snapshots import join_histories  # noqa: E402
from mpm_ref.rom.study.dataset import simulate_history  # noqa: E402
from mpm_ref.rom.train import session  # noqa: E402
from mpm_ref.training import Machine  # noqa: E402
from validation.nsf import networks as kept  # noqa: E402
from validation.nsf.networks import FieldsNet, NetworkPlan, fields_of, trained  # noqa: E402
from validation.nsf.studies import jelly  # noqa: E402
from validation.training import nsf  # noqa: E402

pytestmark = pytest.mark.usefixtures("one_torch_thread")
STUDY = jelly(4)._replace(train=(0.3, 0.5), sizes=Sizes(r=3), samples=20)
NET = FieldsNet(STUDY, NetworkPlan(8, 6, 0.1), NetworkPlan(6, 5, 0.01), NetworkPlan(5, 4, 0.0),
                batch=8, points=16)


@pytest.fixture
def places(tmp_path, monkeypatch):
    """Folders of weights and of checkpoints, where a small net is the only one."""
    monkeypatch.setattr(kept, "FOLDER", tmp_path / "weights")
    for module in (kept, nsf):
        monkeypatch.setattr(module, "nets", lambda: {"jelly": NET})
        monkeypatch.setattr(module, "narrow", dict)
    trained.cache_clear()
    yield tmp_path / "weights", tmp_path / "checkpoints"
    trained.cache_clear()


def test_the_plan_is_that_of_the_net():
    net = NET._replace(study=STUDY._replace(follows=True))
    g, h, l = nsf.plan_of(net)
    assert (g.r, g.hidden, g.latent, g.epochs, g.jitter) == (3, (8,) * 5, "directions", 6, 0.1)
    assert (h.hidden, h.follows, h.epochs, h.jitter) == ((6,) * 5, True, 5, 0.01)
    assert (l.hidden, l.follows, l.epochs, l.jitter) == ((5,) * 5, False, 4, 0.0)
    assert {(own.batch, own.points, own.schedule) for own in (g, h, l)} == {(8, 16, "warm")}
    assert not any(g.weights)


def test_runs_are_those_of_the_study_at_its_spacing():
    runs = nsf.runs_of(STUDY._replace(every=8))
    alone = simulate_history(STUDY.run(0.5), [0.5])
    assert runs.mu.tolist() == [[0.3], [0.5]]
    assert runs.x.shape[1] == 16                    # 30 steps, every second, and the start
    assert runs.x[1] == pytest.approx(alone.x[0, ::2], abs=1e-6)


def test_no_run_is_kept_beside_what_is_made_of_it(monkeypatch):
    """They are joined one by one, each before the next is made."""
    made, kept = [], []
    monkeypatch.setattr(nsf, "simulate_history", lambda scene, mu, *_: made.append(*mu) or mu)

    def joined(runs, count):
        assert count == len(STUDY.train)
        for run in runs:
            kept.append(*run)
            assert kept == made

    monkeypatch.setattr(nsf, "join_histories", joined)
    nsf.runs_of(STUDY)
    assert kept == [0.3, 0.5]


def test_the_command_writes_weights_that_are_taken(places):
    nsf.main(["jelly"], *places)
    model = trained("jelly")
    about = model.about
    assert about["command"] == "python -m validation.training.nsf jelly"
    assert {"commit", "versions", "torch", "threads", "seed", "plan"} <= {*about}
    assert {stage: len(own) for stage, own in about["losses"].items()} == {"g": 6, "h": 5, "l": 4}
    assert {*about["cpu_seconds"]} == {*about["wall_seconds"]} == {*"ghl"}
    assert {*about["errors"]} == {"displacement", "stress", "affine"}
    assert (model.field.g.net.sizes.tolist(), model.xhat.shape) == ([6, *[8] * 5, 3], (2, 31, 3))
    fields = fields_of(model, STUDY)
    assert np.isfinite(fields.stress(np.arange(5), model.rest)).all()
    assert list(places[1].iterdir()) == []


def test_a_training_that_was_cut_off_goes_on(places, monkeypatch):
    """In the second stage; the weights are those of a training in one go."""
    whole = nsf.trained_fields("jelly", places[1] / "whole", Machine())
    monkeypatch.setattr("mpm_ref.rom.train.decoder.SAVE", 2)
    monkeypatch.setattr("mpm_ref.rom.train.field.SAVE", 2)
    show, seen = nsf.ProgressBar.show, []

    def cut(self, stage, losses):
        seen.append((stage, len(losses)))
        show(self, stage, losses)
        if seen[-1] == ("h", 3) and len(seen) == 9:
            raise KeyboardInterrupt

    monkeypatch.setattr(nsf.ProgressBar, "show", cut)
    with pytest.raises(KeyboardInterrupt):
        nsf.main(["jelly"], *places)
    assert not (places[0] / "jelly.npz").exists()
    nsf.main(["jelly"], *places)
    assert seen[9:] == [("h", 3), ("h", 4), ("h", 5), *(("l", k) for k in range(1, 5))]
    again = trained("jelly")
    for one, other in zip(whole.field, again.field, strict=True):
        assert np.array_equal(one.net.W, other.net.W)


def test_the_bar_ends_where_its_total_is():
    moved = []
    bar = type("Bar", (), {"update": lambda _, n: moved.append(n),
                           "set_postfix": lambda *_, **__: None})()
    work = nsf.ProgressBar(NET, bar)
    work.show("g", [[1.0]] * 4)                     # four epochs are in the checkpoint
    for stage, epochs in (("g", 6), ("h", 5), ("l", 4)):
        work.show(stage, np.ones(epochs))
    assert sum(moved) == nsf.ProgressBar.total(NET) == 6 * 64 + 5 * 36 + 4 * 25


def test_a_few_losses_are_kept_the_last_one_among_them():
    own = type("Fitted", (), {"history": np.arange(2003.0)})
    found = nsf.losses(type("Stages", (), {"_asdict": lambda _: {"h": own}})())["h"]
    assert found[-1] == 2002.0
    assert nsf.SHOWN <= len(found) <= nsf.SHOWN + 2


def test_errors_are_shares_of_what_is_learned(monkeypatch):
    """Of networks that answer a known part of the truth; of all levels."""
    monkeypatch.setattr(nsf, "LEVELS", 100)
    runs = join_histories([simulate_history(STUDY.run(value), [value]) for value in STUDY.train])
    xhat = np.arange(62.0).reshape(2, 31, 1)        # tells the snapshot

    def part(values, share):
        return lambda X, xhat, *mu: share * values.reshape(62, *values.shape[2:])[int(xhat[0])]

    class Net:
        def __init__(self, answer):
            self.place = self.values = answer
            self.needed_parameters = lambda mu: mu

    stages = (Net(lambda X, y: X + part(runs.x - X, 0.9)(X, y)), Net(part(runs.tau, 0.8)),
              Net(part(runs.C, 1.3)))
    found = nsf.errors_of(kept_model(stages, xhat), runs)
    assert found == pytest.approx({"displacement": 0.1, "stress": 0.2, "affine": 0.3})


def kept_model(stages, xhat):
    """What `errors_of` asks of a model."""
    return type("Model", (), {"xhat": xhat, "field": stages})


def test_a_long_training_has_few_checkpoints():
    assert [session.checkpoint_interval(epochs, 20) for epochs in (6, 4000, 5000)] == [20, 20, 25]


def test_runs_are_joined_in_single_precision():
    run = simulate_history(STUDY.run(0.3), [0.3], np.float32)
    assert join_histories([run]).x.dtype == np.float32
