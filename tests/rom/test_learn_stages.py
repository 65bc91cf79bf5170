"""NSF's training in three stages: position and encoder, then stress and affine field on latents
that stay. Needs PyTorch.
"""

import field_toys
import numpy as np
import pytest
import rom_toys

torch = pytest.importorskip("torch")

from mpm_ref.rom import model_file  # noqa: E402
from mpm_ref.rom.fields.architecture import row_per_axis  # noqa: E402
from mpm_ref.rom.snapshots import position_error  # noqa: E402
from mpm_ref.rom.train import decoder, field, schedule, session, stages  # noqa: E402
from mpm_ref.rom.train.decoder import DecoderTraining  # noqa: E402
from mpm_ref.rom.train.field import FieldData, FieldTraining  # noqa: E402
from mpm_ref.rom.train.networks import Encoder  # noqa: E402
from mpm_ref.rom.train.stages import POSITION, StagePlan, position_snapshots, printed_plan  # noqa: E402

pytestmark = pytest.mark.usefixtures("one_torch_thread")
DATA = field_toys.histories()


def plan(epochs=40, follows=True, **more):
    g = DecoderTraining(1, (8, 8), "encoder-nsf", POSITION, epochs, 4, schedule="steps", **more)
    h = FieldTraining((8, 8), follows, epochs, 4, **more)
    return StagePlan(g, h, FieldTraining((8, 8), False, epochs, 4, **more))


def observed(data=DATA):
    """Stresses, with latent coordinates as a first stage might find them."""
    xhat = np.broadcast_to(np.linspace(-1.0, 1.0, data.x.shape[1])[:, None],
                           (*data.x.shape[:2], 1))
    return FieldData(data.X, xhat, data.mu, data.tau, data.dt)


def bits(*arrays):
    return [np.asarray(a).tobytes() for a in arrays]


def all_of(done):
    """All numbers of trained `Stages`."""
    g, h, l = done
    return bits(*g.decoder.net, *g.decoder.units, g.xhat, g.history, *h.field.net, *h.field.units,
                h.history, *l.field.net, *l.field.units, l.history)


@pytest.fixture
def fast(monkeypatch):
    """Rates for tiny networks."""
    monkeypatch.setattr(schedule, "PRINTED", (1e-2, 5e-3, 1e-3))


# The networks.

def test_the_encoder_is_that_of_the_paper():
    """NSF-encoder: 3 channels of kernel 6 and stride 4, 32, r; of 40,000 points 9 values are left,
    in 3 rows.
    """
    e = Encoder(row_per_axis(3, 40_000), 5)
    assert [tuple(c.weight.shape) for c in e.convolutions] == [(3, 3, 6)] * 6
    assert {c.stride for c in e.convolutions} == {(4,)}
    assert (e.full.in_features, e.full.out_features) == (27, 32)
    assert (e.last.in_features, e.last.out_features) == (32, 5)


def test_each_axis_is_a_row_of_the_encoder(d):
    """By hand: the first convolution of the first snapshot."""
    torch.manual_seed(0)
    e, u = Encoder(row_per_axis(d, 30), 2), torch.randn(4, 30, d)
    seen = []
    e.convolutions[0].register_forward_hook(lambda _, given, out: seen.append(out))
    assert e(u).shape == (4, 2)
    W, b = e.convolutions[0].weight.detach(), e.convolutions[0].bias.detach()
    by_hand = [[(W[k] * u[0, 4 * i:4 * i + 6].T).sum().item() + b[k].item() for i in range(7)]
               for k in range(3)]
    assert torch.allclose(seen[0][0], torch.tensor(by_hand), atol=1e-6)


def test_rates_are_those_printed_in_equal_shares():
    """NSF-train."""
    found = [schedule.steps((k + 0.5) / 10) for k in range(10)]
    assert found == [1e-3, 1e-3, 5e-4, 5e-4, 2e-4, 2e-4, 1e-4, 1e-4, 5e-5, 5e-5]
    assert schedule.steps(0.0) == 1e-3


def test_a_warm_start_rises_to_its_rate_and_falls_from_there():
    found = [schedule.warm(k / 1000) for k in range(1001)]
    top = int(np.argmax(found))
    assert (found[0], found[top]) == (0.0, pytest.approx(schedule.FAST))
    assert top == 1000 * schedule.SOON
    assert (np.diff(found[:top + 1]) > 0.0).all()
    assert (np.diff(found[top:]) < 0.0).all()
    assert found[-1] == pytest.approx(schedule.SLOWEST)


def test_rates_are_asked_for_in_every_step(monkeypatch):
    shares = []
    monkeypatch.setitem(schedule.SCHEDULES, "steps", lambda share: shares.append(share) or 0.0)
    field.train_field(FieldTraining((4,), epochs=3, batch=8), observed())      # 15 snapshots
    assert shares == pytest.approx(np.arange(6) / 6)


def test_the_papers_plan():
    found = printed_plan(3, 6, (48, 64, 64), follows=True)
    assert [own.hidden for own in found] == [(144,) * 5, (384,) * 5, (576,) * 5]
    assert [own.epochs for own in found] == [1500, 3000, 3000]
    assert [own.batch for own in found] == [32] * 3
    assert [own.schedule for own in found] == ["steps"] * 3
    assert (found.g.latent, found.g.weights, found.g.r) == ("encoder-nsf", POSITION, 6)
    assert (found.h.follows, found.l.follows) == (True, False)


# Training.

@pytest.mark.usefixtures("fast")
def test_the_loss_of_every_stage_falls():
    done = stages.train_stages(plan(200), DATA)
    assert done.g.history[-1, 0] < 0.03 * done.g.history[0, 0]
    for fitted in (done.h, done.l):
        assert fitted.history.shape == (200,)
        assert fitted.history[-1] < 0.1 * fitted.history[0]
    model = done.model({"seed": 0})
    tau = model.field.h.values(DATA.X, model.xhat[1, 3], DATA.mu[1])
    assert position_error(tau, DATA.tau[1, 3]) < 0.35
    assert position_error(model.field.l.values(DATA.X, model.xhat[1, 3]), DATA.C[1, 3]) < 0.35


@pytest.mark.usefixtures("fast")
def test_only_its_parameter_tells_the_stress_of_runs_apart_that_move_alike():
    """NSF-mu-dep: positions are the same in all runs, so are latents, and the stress is not."""
    knows, does_not = (field.train_field(FieldTraining((16, 16), follows, 300, 4), observed())
                       for follows in (True, False))
    assert does_not.field.parameters == 0
    xhat = observed().xhat[0, 4]
    ratio = [norm_of(knows.field.values(DATA.X, xhat, mu)) for mu in DATA.mu]
    exact = [norm_of(DATA.tau[run, 4]) for run in range(3)]
    assert np.array(ratio) == pytest.approx(np.array(exact), rel=0.1)
    assert exact[2] > 1.9 * exact[0]
    assert knows.history[-1] < 0.2 * does_not.history[-1]


def norm_of(a):
    return float(np.linalg.norm(a))


def test_the_latents_of_later_stages_are_those_of_the_first():
    """They are no unknowns: h and l change nothing of g and of them."""
    whole, data = stages.train_stages(plan(3), DATA), observed()
    alone = decoder.train_decoder(plan(3).g, position_snapshots(DATA))
    assert bits(whole.g.xhat, *whole.g.decoder.net) == bits(alone.xhat, *alone.decoder.net)
    under_way, before = field.FieldSession(plan(3).h, data), data.xhat.copy()
    assert not under_way.variables.requires_grad
    assert {*under_way.networks} == {"f"}
    under_way.epoch()
    np.testing.assert_array_equal(data.xhat, before)
    np.testing.assert_array_equal(whole.model({}).xhat, whole.g.xhat)


def test_the_loss_is_the_mean_squared_error_of_standardised_values():
    """By hand, at some points of two snapshots, with the field as it is exported."""
    under_way = field.FieldSession(FieldTraining((8,), True, points=5), observed())
    state = under_way.random.get_state()
    total, terms = under_way.error(torch.tensor([7, 2]))            # run 1, level 2; run 0, level 2
    under_way.random.set_state(state)
    points = under_way.draw_points().numpy()
    under_way.history = [[0.0]]
    found = under_way.result().field
    left = [(found.values(DATA.X[points], observed().xhat[run, 2], DATA.mu[run])
             - DATA.tau[run, 2, points]) / found.units.std for run in (1, 0)]
    assert (len(points), terms) == (5, ())
    assert total.item() == pytest.approx(np.mean(np.square(left)), rel=1e-5)


def test_the_same_seed_gives_the_same_numbers():
    first = all_of(stages.train_stages(plan(2), DATA))
    torch.rand(3)
    assert all_of(stages.train_stages(plan(2), DATA)) == first
    assert all_of(stages.train_stages(plan(2, seed=1), DATA))[1] != first[1]


def test_stored_single_precision_is_trained_on_as_it_is(rng):
    """Values are standardised in double precision, batch by batch."""
    data = observed()._replace(values=DATA.tau.astype(np.float32))
    found = field.train_field(FieldTraining((4,), epochs=2), data).field.units
    assert found.mean == pytest.approx(DATA.tau.mean(axis=(0, 1, 2)), rel=1e-6)


def test_three_stages_are_one_file(tmp_path):
    done = stages.train_stages(plan(2), DATA).model({"seed": 0})
    model_file.save(tmp_path / "fields.npz", done)
    back = model_file.load(tmp_path / "fields.npz")
    one, other = (bits(of.xhat, of.rest, *of.field.h.net) for of in (back, done))
    assert one == other
    assert back.rest == pytest.approx(done.xhat[:, 0].mean(axis=0))


# What goes on, and what is refused.

def test_a_training_that_was_cut_off_goes_on_bit_for_bit(tmp_path, monkeypatch):
    """In the second stage; the first is read from its checkpoint, and not made again."""
    monkeypatch.setattr(decoder, "SAVE", 2)
    monkeypatch.setattr(field, "SAVE", 2)
    whole, seen = stages.train_stages(plan(6, points=7), DATA), []

    def cut(stage, history):
        seen.append((stage, len(history)))
        if seen[-1] == ("h", 5) and len(seen) == 11:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stages.train_stages(plan(6, points=7), DATA, tmp_path, cut)
    torch.rand(3)
    assert all_of(stages.train_stages(plan(6, points=7), DATA, tmp_path, cut)) == all_of(whole)
    assert seen[11:] == [("h", 5), ("h", 6), *(("l", k) for k in range(1, 7))]
    assert sorted(file.name for file in tmp_path.iterdir()) == ["g.pt", "h.pt", "l.pt"]


@pytest.mark.parametrize("change", [
    {"X": 1.01 * DATA.X}, {"values": 1.01 * DATA.tau}, {"xhat": 1.01 * observed().xhat},
    {"mu": 1.01 * DATA.mu}, {"dt": 0.2}], ids=lambda change: next(iter(change)))
def test_a_checkpoint_of_other_data_is_refused(tmp_path, monkeypatch, change):
    monkeypatch.setattr(field, "SAVE", 1)
    training = FieldTraining((4,), epochs=1)
    field.train_field(training, observed(), tmp_path / "h.pt")
    with pytest.raises(ValueError, match="is a checkpoint of the training"):
        field.train_field(training, observed()._replace(**change), tmp_path / "h.pt")


def test_a_checkpoint_of_another_training_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(field, "SAVE", 1)
    field.train_field(FieldTraining((4,), epochs=1), observed(), tmp_path / "h.pt")
    with pytest.raises(ValueError, match="is a checkpoint of the training"):
        field.train_field(FieldTraining((4,), True, epochs=1), observed(), tmp_path / "h.pt")


@pytest.mark.parametrize("of", ["g", "h"])
def test_a_loss_that_is_not_finite_ends_the_training(of):
    """The one before is kept: no weight of it is spoilt."""
    under_way = (decoder.DecoderSession(plan().g, position_snapshots(DATA)) if of == "g"
                 else field.FieldSession(plan().h, observed()))
    with torch.no_grad():
        under_way.f.layers[0].weight[0, 0] = np.inf
    with pytest.raises(session.Diverged, match=r"epoch 1: the loss is (nan|inf)\. Are the data"):
        under_way.epoch()
    assert under_way.history == []
    assert all(torch.isfinite(own).all() for own in under_way.f.layers[-1].parameters())


@pytest.mark.parametrize(("settings", "said"), [
    ({"epochs": 0}, "epochs = 0: expected at least 1"), ({"batch": 0}, "batch = 0"),
    ({"points": -1}, "points = -1: expected 0 or more"),
    ({"schedule": "linear"}, "schedule = 'linear': expected one of cosine, steps, warm"),
])
def test_settings_that_mean_nothing_are_refused(settings, said):
    for made in (lambda: FieldTraining((4,), **settings), lambda: DecoderTraining(2, **settings)):
        with pytest.raises(ValueError, match=said):
            made()


@pytest.mark.parametrize("settings", [{}, {"weights": POSITION, "latent": "modes"}])
def test_positions_alone_train_no_error_of_gradients(settings):
    with pytest.raises(ValueError, match="snapshots of positions alone, for latent"):
        decoder.train_decoder(DecoderTraining(2, (4,), epochs=1, **settings),
                              position_snapshots(DATA))


def test_positions_alone_give_the_decoder_that_all_gives():
    """What the loss does not ask for does not matter."""
    whole = rom_toys.snapshots(2)
    one, other = (decoder.train_decoder(DecoderTraining(2, (6,), "encoder-nsf", POSITION, 3), data)
                  for data in (whole, whole._replace(F=None, v=None)))
    assert one.decoder.net.W == pytest.approx(other.decoder.net.W, rel=1e-4, abs=1e-6)
