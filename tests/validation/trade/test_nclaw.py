"""What errors of small trainings cost, and what a step of learned laws costs."""

from types import SimpleNamespace

import numpy as np
import pytest
from small_toys import Records, known

from mpm_ref.materials.learned import weights
from mpm_ref.scene import build
from validation.nclaw import bundle, small_runs, small_trainings
from validation.nclaw.evaluate import ComparedError
from validation.nclaw.initial_laws import untrained
from validation.nclaw.small_runs import Measured, measured, seed_range, training_seconds
from validation.nclaw.small_trainings import Small, bundled, identity, small_nets
from validation.trade import nclaw as trade
from validation.trade import nclaw_inference as inference
from validation.trade.nclaw_inference import frames_error, round_digits, round_weights


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Where weights are looked for; nothing is remembered."""
    monkeypatch.setattr(small_trainings, "FOLDER", tmp_path)
    bundled.cache_clear()
    yield tmp_path
    bundled.cache_clear()


# errors

def test_trainings_are_run_side_by_side(folder, monkeypatch):
    """Each size once, with all its laws; what is not trained is told."""
    for name in ("small", "small-edge-5"):
        bundle.save(folder / f"{name}.npz", known({
            "cpu_seconds": [30.0, *[1.0] * 99], **identity(small_nets()[name])}))
    asked = []

    def compared(scene, makers):
        asked.append((scene.body[0].sampling.counts[0], len(makers)))
        return [ComparedError(0.1 * len(asked) + k, 7 if len(asked) == 2 else -1)
                for k in range(len(makers))]

    monkeypatch.setattr(small_runs, "compare", compared)
    records = Records()
    found = measured(records, ["small", "small-edge-5", "small-edge-8"])
    assert asked == [*[(6, 2)] * 4, (10, 2), *[(5, 2)] * 4, (10, 2)]
    assert [(row.name, row.epoch) for row in found] == [("small", 10), ("small", 100),
                                                        ("small-edge-5", 10), ("small-edge-5", 100)]
    assert found[0].training_run == pytest.approx(0.1)
    assert found[1].training_run == pytest.approx(1.1)
    assert found[0].thrown == pytest.approx(0.3)
    assert found[0].full == found[0].compared == pytest.approx(0.5)
    assert [row.step for row in found] == [7, 7, -1, -1]
    assert (found[0].cpu, found[1].cpu) == (10.0, 100.0)
    value, note = records["trade.nclaw.x.untrained"]
    assert value == 1
    assert note == "no weights small-edge-8.npz: python -m validation.training.nclaw small-edge-8"


def test_a_training_that_stopped_is_told(monkeypatch):
    gone = SimpleNamespace(laws={}, about={"stopped": "epoch 4, step 3: no place"})
    monkeypatch.setattr(small_runs, "load_available",
                        lambda run, names, load: {"small-gap-400": gone})
    notes = []
    records = Records()
    records.note = notes.append
    assert measured(records, ["small-gap-400"]) == []
    assert notes == ["small-gap-400: the training stopped in epoch 4, step 3: no place"]


def test_scenes_are_of_the_training_s_size_but_the_last():
    found = small_runs.scenes(Small("plasticine"), full=True)
    assert [scene.body[0].sampling.counts[0] for scene in found] == [6, 6, 6, 6, 10]
    assert len({scene.body[0].velocity.linear for scene in found}) == 4
    assert {scene.body[0].material.law for scene in found} == {"hencky"}
    assert len(small_runs.scenes(Small(), full=False)) == 4


def row(name="small", **changes):
    return Measured(name, 100, 60.0, 1e-4, 2e-4, np.nan, -1)._replace(**changes)


def test_seeds_give_the_spread():
    some = [row(), row("small-seed-1", training_run=3e-4), row("small-third", training_run=9.0)]
    assert seed_range(some, small_trainings.SEEDS) == (1e-4, 3e-4)
    assert np.isnan(seed_range([], small_trainings.SEEDS)).all()


def test_the_first_epoch_costs_as_much_as_others(monkeypatch):
    monkeypatch.setattr(small_runs, "bundled", lambda name: SimpleNamespace(
        about={"cpu_seconds": [40.0, 1.0, 2.0, 1.0, 3.0]}))
    assert training_seconds("small", 5) == pytest.approx(9.0)
    assert training_seconds("small", 3) == pytest.approx(5.0)


def test_the_front_is_of_the_error_in_the_same_body(monkeypatch):
    """A training of its own size has the smaller error there, but not in the paper's body."""
    some = [row(cpu=10.0, training_run=1e-5, full=3e-3), row("small-epochs-30", cpu=5.0, full=1e-3),
            row("small-plasticine-epochs", cpu=50.0, full=9.0, step=3)]
    monkeypatch.setattr(trade, "measured", lambda *_: some)
    records = Records()
    trade.training(records)
    columns, rows = records["trainings"]
    assert [dict(zip(columns, one, strict=True))["pareto"] for one in rows] == [0, 1, 1]
    assert "nothing is better" in records["trade.nclaw.x.small-epochs-30.100"][1]
    assert "nothing is better" not in records["trade.nclaw.x.small.100"][1]
    assert "broke down in step 3" in records["trade.nclaw.x.small-plasticine-epochs.100"][1]


def test_what_is_seen_stands_beside_the_seeds(monkeypatch):
    some = [row(), row("small-seed-1", training_run=3e-4), row("small-every-5", training_run=7e-4)]
    monkeypatch.setattr(trade, "measured", lambda *_, **__: some)
    records = Records()
    trade.observations(records)
    value, note = records["trade.nclaw.sight.small-every-5"]
    assert value == 7e-4
    assert "full observations 0.0001 to 0.0003 m^2 by seed" in note
    columns, rows = records["trainings"]
    assert dict(zip(columns, rows[2], strict=True))["every"] == 5


# what a step costs

@pytest.mark.parametrize("bits", [4, 8, 11, 24])
def test_numbers_have_so_many_digits(rng, bits):
    a = rng.normal(size=1000) * 10.0 ** rng.integers(-9, 9, 1000)
    short = round_digits(a, bits)
    assert np.abs(short / a - 1.0).max() <= 2.0**-bits
    assert np.abs(short / a - 1.0).max() > 2.0 ** -(bits + 2)
    assert np.array_equal(round_digits(short, bits), short)
    if bits == 24:
        assert np.array_equal(short, a.astype(np.float32))


def test_all_weights_are_rounded():
    laws = untrained()
    short = round_weights(laws, 8)
    for part in weights.PARTS:
        assert getattr(short, part).kind == getattr(laws, part).kind
        for (W, _), (was, _) in zip(getattr(short, part).layers, getattr(laws, part).layers,
                                    strict=True):
            assert np.array_equal(W, round_digits(was, 8))
            assert not np.array_equal(W, was)
    assert all(np.array_equal(a[0], b[0]) for a, b in
               zip(round_weights(laws, 24).elastic.layers, laws.elastic.layers, strict=True))


def weights_of(*numbers):
    """Laws of two layers of these weights each, and biases of zero."""
    layer = np.array([numbers]), np.zeros(len(numbers))
    return weights.LearnedLaws(*[weights.LawWeights((layer, layer), None)] * 2, {})


@pytest.mark.parametrize(("numbers", "exponent"), [
    ((0.5, 0.75, -0.5, 0.625), 1), ((0.5, 0.25, -1.5, 1.0), 2),
    ((0.0, 0.5, 2.0**-15, 0.5), 4), ((0.0, 0.5, 2.0**-16, 0.5), 5)])
def test_weights_take_digits_and_an_exponent_of_their_range(numbers, exponent):
    """16 weights: of 1, 3, 15 and 16 exponents, and one value for zero."""
    assert inference.weights_size(weights_of(*numbers), 8) == 16 * (8 + exponent) / 8


def test_the_front_of_digits_is_of_error_and_bytes(monkeypatch):
    """Fewer digits with the same error are better."""
    errors = iter((2.0, 1.0, 1.0, 3.0))
    monkeypatch.setattr(inference, "NAMES", ("jelly",))
    monkeypatch.setattr(inference, "DIGITS", {"standard": (24, 16, 11, 8)})
    monkeypatch.setattr(inference, "trained", lambda name: untrained())
    monkeypatch.setattr(inference, "compare", lambda scene, laws: [
        ComparedError(next(errors), -1, "lost" if k == 3 else "") for k, _ in enumerate(laws)])
    records = Records()
    inference.digits(records)
    columns, rows = records["digits"]
    found = [dict(zip(columns, row, strict=True)) for row in rows]
    assert [row["pareto"] for row in found] == [0, 0, 1, 1]
    sizes = [row["bytes"] for row in found]
    assert sizes == sorted(sizes, reverse=True)
    assert sizes[0] - sizes[1] == 11008 * 8 / 8
    assert records["trade.nclaw.digits.jelly.16"] == (1.0, f"weights of {sizes[1]:.0f} bytes")
    assert records["trade.nclaw.digits.jelly.8"] == (
        3.0, f"weights of {sizes[3]:.0f} bytes; {inference.ON_FRONT}; lost")


def test_wider_networks_cost_more():
    body = build(Small().scene).bodies[0]
    cheap = inference.point_cost(body.law, body.flow)
    dear = inference.learned_point_cost(untrained(), body)
    assert 0.0 < 2.0 * cheap < dear < 1e-3


def test_runs_that_break_down_are_infinitely_far():
    x = [np.zeros((2, 3)), np.ones((2, 3))]
    assert frames_error(x[:1], x) == np.inf
    assert frames_error([x[0], 3.0 * x[1]], x) == pytest.approx(2.0)


def test_longer_steps_meet_the_same_times():
    laws = inference.time_steps("jelly", (1.0, 4.0), 80)
    assert [one.factor for one in laws] == [1.0, 4.0]
    assert laws[0].true_error == 0.0
    assert 0.0 < laws[1].true_error < 1e-6
    assert laws[1].cpu < 0.7 * laws[0].cpu
