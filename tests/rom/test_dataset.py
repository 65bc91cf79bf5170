"""Data of a study, made and read; maps made of them, written and read."""

from collections import Counter

import numpy as np
import pytest
from small_studies import CURVED, STEPS, generated, study

from mpm_ref.rom import model_file
from mpm_ref.rom.fields.pod import basis
from mpm_ref.rom.fields.polynomial_manifold import curved
from mpm_ref.rom.study import dataset, reduce
from mpm_ref.rom.study.dataset import simulate_snapshots
from mpm_ref.rom.study.display import resampled, tabulated
from mpm_ref.rom.study.generate import (
    FINISHED,
    INTERRUPTED,
    SKIPPED,
    STOP_WATCH,
    file_of,
    generate,
    is_finished,
    one_thread,
)
from mpm_ref.scene import build
from mpm_ref.store.results import BadResults, Results
from mpm_ref.store.running import Options, checkpoint_of, run
from mpm_ref.store.weights_file import header, pack
from mpm_ref.store.writer import StoredFields
from mpm_ref.training import Machine

# Data.

@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A study, and the folder with its runs."""
    return generated(tmp_path_factory.mktemp("made"))


def test_data_are_those_of_runs_in_memory_bit_for_bit(made):
    bars, folder = made
    numbers = (3, 1)
    with one_thread():
        there = simulate_snapshots((build(bars.scene(bars.mu[k])) for k in numbers),
                                   bars.mu[list(numbers)])
    found = dataset.load(bars, folder, numbers)
    for a, b in zip(found, there, strict=True):
        np.testing.assert_array_equal(a, b)
    assert found.x.shape == (2, STEPS + 1, len(found.X), 2)


def test_finished_runs_are_not_made_again(made):
    bars, folder = made
    before = {file: file.stat().st_mtime_ns for file in folder.glob("*.h5")}
    assert Counter(done.why for done in generate(bars, folder)) == {SKIPPED: 4}
    assert {file: file.stat().st_mtime_ns for file in folder.glob("*.h5")} == before


def test_a_run_that_was_cut_off_goes_on(made, tmp_path):
    bars, folder = made
    path, scene = file_of(tmp_path, 1), bars.scene(bars.mu[1])
    run(build(scene), path, Options(steps=3, fields=StoredFields(("x", "F", "v"))))
    assert not is_finished(path, scene)
    with pytest.raises(dataset.Missing, match=r"lacks 1 of 1 runs, the first is case-001\.h5"):
        dataset.load(bars, tmp_path, (1,))
    assert [done.why for done in generate(bars, tmp_path)] == [FINISHED] * 4
    with Results(path) as results:
        assert [part["first_step"] for part in results.manifest["parts"]] == [0, 3]
    for a, b in zip(dataset.load(bars, tmp_path, (1,)), dataset.load(bars, folder, (1,)),
                    strict=True):
        np.testing.assert_array_equal(a, b)


class Later:
    """An event that is set after it was asked so many times."""

    def __init__(self, times):
        self.times = times

    def is_set(self):
        self.times -= 1
        return self.times < 0


def test_a_process_that_is_told_to_stop_ends_its_run_with_a_checkpoint(tmp_path, monkeypatch):
    bars = study(tmp_path)
    monkeypatch.setattr(STOP_WATCH, "stop", Later(4))
    assert [done.why for done in generate(bars, tmp_path)] == [INTERRUPTED]
    with Results(file_of(tmp_path, 0)) as results:
        assert results.step[-1] == 4
        assert results.manifest["parts"][-1]["why"] == "interrupted"
    assert not file_of(tmp_path, 1).exists()
    assert checkpoint_of(file_of(tmp_path, 0)).exists()


def test_runs_of_another_study_are_refused_and_left(made, tmp_path):
    _, folder = made
    other = study(tmp_path, ("to = 4.0", "to = 5.0"))
    before = file_of(folder, 1).read_bytes()
    *well, done = generate(other, folder)
    assert [one.why for one in well] == [SKIPPED]           # the first has the same scene
    assert done.why == "refused"
    assert "another scene or study" in done.message
    assert file_of(folder, 1).read_bytes() == before
    with pytest.raises(BadResults, match="another scene or study"):
        dataset.load(other, folder, (1,))


def test_an_unstable_run_ends_the_rest(tmp_path):
    bars = study(tmp_path, ("to = 4.0\ncount = 4", "to = 1e6\ncount = 3"))
    first, second = generate(bars, tmp_path)
    assert (first.why, second.why) == (FINISHED, "unstable")
    assert second.message.startswith("run 1 (g = 500000")


def test_two_processes_make_the_same(made, tmp_path):
    bars, folder = made
    assert {(done.number, done.why) for done in generate(bars, tmp_path, workers=2)} == {
        (k, FINISHED) for k in range(4)}
    for a, b in zip(dataset.load(bars, tmp_path, range(4)), dataset.load(bars, folder, range(4)),
                    strict=True):
        np.testing.assert_array_equal(a, b)


# Maps.

@pytest.fixture(scope="module")
def model(made):
    bars, folder = made
    return reduce.compute_model(bars, dataset.load(bars, folder, bars.train), {"command": "none"})


@pytest.fixture
def bent(made, tmp_path):
    """The same study with a curved map, and that map."""
    bars = study(tmp_path, *CURVED)
    return bars, reduce.compute_model(bars, dataset.load(bars, made[1], bars.train),
                                      {"command": "none"})


def test_modes_hold_the_training_states_and_their_coordinates(made, model):
    bars, folder = made
    data = dataset.load(bars, folder, bars.train)
    assert model.xhat.shape == (3, STEPS + 1, 3)
    assert np.abs(model.field.place(data.X, model.rest) - data.X).max() == 0.0
    off = [model.field.place(data.X, xhat) - x for xhat, x in
           zip(model.xhat.reshape(-1, 3), data.flat()[0], strict=True)]
    assert np.linalg.norm(off) < 0.02 * np.linalg.norm(data.x - data.X)
    assert abs(np.einsum("snd,ndr->r", np.array(off), model.field.U)).max() < 1e-12


def test_a_map_comes_back_bit_for_bit(made, model, tmp_path):
    model_file.save(tmp_path / "map.npz", model)
    back = reduce.load(tmp_path / "map.npz", made[0])
    for a, b in zip((*model.field[:3], model.xhat, model.rest),
                    (*back.field[:3], back.xhat, back.rest), strict=True):
        np.testing.assert_array_equal(a, b)
    assert back.about == model.about
    assert back.about["map"] == {"kind": "modes", "r": 3}
    model_file.save(tmp_path / "again.npz", back)
    assert (tmp_path / "again.npz").read_bytes() == (tmp_path / "map.npz").read_bytes()


def test_a_curved_map_is_that_of_its_settings_and_comes_back_bit_for_bit(made, bent, tmp_path):
    bars, model = bent
    data = dataset.load(bars, made[1], bars.train)
    known = basis(data.X, *data.flat(), 4)
    map = curved(known, 2, 2)
    assert np.array_equal(model.xhat.reshape(-1, 2), known.xhat[:, :2])
    model_file.save(tmp_path / "map.npz", model)
    back = reduce.load(tmp_path / "map.npz", bars)
    for a, b in zip((*map.modes[:3], *map[1:], model.xhat, model.rest),
                    (*back.field.modes[:3], *back.field[1:], back.xhat, back.rest),
                    strict=True):
        np.testing.assert_array_equal(a, b)
    assert np.array_equal(back.field.place(data.X, back.rest), data.X)
    assert back.about == model.about
    assert back.about["map"] == {"kind": "curved", "r": 2, "modes": 4, "degree": 2}


def test_a_curved_map_does_not_go_with_linear_projection(made, bent, tmp_path):
    model_file.save(tmp_path / "map.npz", bent[1])
    with pytest.raises(ValueError, match=r"run\.projection = 'linear': expected 'nonlinear'"):
        reduce.load(tmp_path / "map.npz", made[0])


def test_what_is_no_curved_map_is_refused(bent, tmp_path):
    _, model = bent
    assert model.field.powers.tolist() == [[2, 0], [1, 1], [0, 2]]
    for name, wrong, words in (("C", np.zeros((3, 3)), r"C has shape \(3, 3\), expected \(2, 3\)"),
                               ("powers", np.ones((3, 1)), r"powers has shape \(3, 1\)"),
                               ("powers", np.array(2), r"powers has 0 axes, expected 2"),
                               ("C", np.full((2, 3), np.nan), "C has numbers that are not finite")):
        with pytest.raises(ValueError, match=words):
            model_file.save(tmp_path / "x.npz", model._replace(
                field=model.field._replace(**{name: wrong})))
    assert not (tmp_path / "x.npz").exists()
    content = header("x.npz", model_file.FORMAT, {}) | model_file.arrays_of(model)
    del content["powers"]
    (tmp_path / "x.npz").write_bytes(pack(content))
    with pytest.raises(ValueError, match="lacks powers"):
        model_file.load(tmp_path / "x.npz")


def test_a_map_of_another_study_is_refused(model, tmp_path):
    model_file.save(tmp_path / "map.npz", model)
    with pytest.raises(ValueError, match=r"map\.npz is a map of another study"):
        reduce.load(tmp_path / "map.npz", study(tmp_path, ("to = 4.0", "to = 5.0")))


@pytest.mark.parametrize("damage", [lambda b: b[:-100], lambda b: b[:500] + b"?" + b[501:],
                                    lambda b: b"", lambda b: b"x = 1"])
def test_a_damaged_map_is_refused(made, model, tmp_path, damage):
    model_file.save(tmp_path / "map.npz", model)
    content = (tmp_path / "map.npz").read_bytes()
    (tmp_path / "map.npz").write_bytes(damage(content))
    with pytest.raises(ValueError, match=r"map\.npz is (damaged|not an npz)"):
        reduce.load(tmp_path / "map.npz", made[0])


def test_what_are_no_modes_is_refused(model, tmp_path):
    def written(**changes):
        map = model.field
        arrays = header("x.npz", model_file.FORMAT, {}) | {
            "kind": np.array("pod"), "X": map.X, "U": map.U, "slope": map.slope,
            "xhat": model.xhat, "rest": model.rest} | changes
        path = tmp_path / "map.npz"
        path.write_bytes(pack({k: a for k, a in arrays.items() if a is not None}))
        return path

    assert model_file.load(written()).field.r == 3
    for changes, words in (({"U": None}, "lacks U"), ({"rest": np.zeros(2)}, "rest has shape"),
                           ({"xhat": np.zeros(3)}, "xhat has 1 axes, expected 3"),
                           ({"X": np.full_like(model.field.X, np.nan)}, "not finite"),
                           ({"about": np.array("{")}, r"map\.npz .*about is no JSON"),
                           ({"about": None}, r"map\.npz .*about is no JSON"),
                           ({"format": np.array(2)}, "format reduced model 1")):
        with pytest.raises(ValueError, match=words):
            model_file.load(written(**changes))
    with pytest.raises(ValueError, match="not finite"):
        model_file.save(tmp_path / "x.npz", model._replace(rest=np.full(3, np.inf)))
    assert not (tmp_path / "x.npz").exists()


def test_without_torch_a_network_is_refused_in_one_sentence(made, without_torch):
    with pytest.raises(ValueError, match=r'pip install "mpm_ref\[learn\]"'):
        reduce.train_model(made[0], None, {}, None, None, Machine())


@pytest.mark.parametrize("kind", ["straight", "curved"])
def test_tabulated_modes_are_the_modes(model, bent, kind):
    of = model if kind == "straight" else bent[1]
    X = np.random.default_rng(0).uniform((0.0, 0.0), (0.8, 0.2), (30, 2))
    here = tabulated(of.field, X)
    assert type(here) is type(of.field)
    assert len(getattr(here, "modes", here).X) == 30
    for a, b in zip(here.derivatives(X, of.xhat[2, 5]),
                    of.field.derivatives(X, of.xhat[2, 5]), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-12)


def test_a_body_is_shown_at_any_number_of_its_points(made):
    body = build(resampled(made[0].base, 777)).bodies[0].particles
    assert len(body.x) == 777
    assert body.m.sum() == pytest.approx(1000.0 * 0.8 * 0.2)
    assert (body.x >= 0.0).all()
    assert (body.x <= (0.8, 0.2)).all()
