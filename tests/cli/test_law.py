"""`mpm-ref law train`: weights, progress, checkpoints, the run to learn from. Needs PyTorch."""

import hashlib
from shutil import copyfile

import h5py
import numpy as np
import pytest
from command_line import assert_told, mpm_ref
from small_laws import FLOWING, STEPS, E, write_study

torch = pytest.importorskip("torch")

from mpm_ref import training  # noqa: E402
from mpm_ref.cli import law_train  # noqa: E402
from mpm_ref.materials.learned import weights  # noqa: E402
from mpm_ref.materials.learned.strain_range import strain_bounds  # noqa: E402
from mpm_ref.nclaw.batched_step import make_world  # noqa: E402
from mpm_ref.nclaw.bodies import body_maker  # noqa: E402
from mpm_ref.nclaw.study import study as law_study  # noqa: E402
from mpm_ref.nclaw.study.study import load  # noqa: E402
from mpm_ref.nclaw.study.training import run_error  # noqa: E402
from mpm_ref.nclaw.train import fit  # noqa: E402
from mpm_ref.nclaw.train import train as law_trainer  # noqa: E402
from mpm_ref.nclaw.train.labeled import labels_of, train_labeled  # noqa: E402
from mpm_ref.nclaw.train.observations import trajectory_of  # noqa: E402
from mpm_ref.scene import digest  # noqa: E402
from mpm_ref.store.journal import JournaledFile  # noqa: E402
from mpm_ref.store.running import Options, checkpoint_of, run  # noqa: E402
from mpm_ref.store.writer import StoredFields  # noqa: E402
from mpm_ref.trajectories import observed  # noqa: E402

pytestmark = pytest.mark.usefixtures("one_torch_thread")


def train(study, out, *options):
    return mpm_ref("law", "train", study, "--out", out, *options)


def bits(path):
    """Weights, kinds and errors of a file."""
    laws = weights.load(path)
    return [(repr(law.kind), [a.tobytes() for layer in law.layers for a in layer])
            for law in laws[:2]] + [laws.about["errors"]]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Folder with a study, and its laws in whole.npz; what the command said in said.txt."""
    folder = tmp_path_factory.mktemp("made")
    done = train(write_study(folder), folder / "whole.npz")
    assert done.exit_code == 0, done.output
    (folder / "said.txt").write_text(done.output)
    return folder


# What is learned.

def test_methods_are_those_that_are_learned():
    assert set(law_study.METHOD_KINDS) == {*law_trainer.METHODS, law_trainer.SYS_ID}
    assert law_study.SYS_ID == law_trainer.SYS_ID
    assert set(law_train.OF_ERRORS) == {law_trainer.LABELED}


def test_weights_are_those_of_the_training_by_hand(made):
    study = load(made / "cubes.toml")
    laws = law_trainer.drawn_laws("ours", 0, *study.tables.records)
    data = trajectory_of(observed(study.problem()))
    session = fit.train(study.tables.train, laws, make_world(study.problem()), data)
    found = weights.load(made / "whole.npz")
    assert found.about["errors"] == [epoch.error for epoch in session.history]
    for own, law in zip(found[:2], laws, strict=True):
        for (W, b), (V, c) in zip(own.layers, law.weights().layers, strict=True):
            assert np.array_equal(W, V)
            assert np.array_equal(b, c)


def test_a_training_goes_on_from_the_laws_of_another(made, tmp_path):
    """Its first epoch has the error of those laws, over the same segments."""
    first = tmp_path / "first.npz"
    copyfile(made / "whole.npz", first)
    study = load(write_study(tmp_path, ("[train]", 'start = "first.npz"\n[train]')))
    laws = law_trainer.drawn_laws("ours", 0, *study.tables.records)
    with torch.no_grad():
        for own, law in zip(weights.load(first)[:2], laws, strict=True):
            for (W, _), V in zip(own.layers, law.parameters(), strict=True):
                V.copy_(torch.from_numpy(W.T))
    data = trajectory_of(observed(study.problem()))
    session = fit.train(study.tables.train, laws, make_world(study.problem()), data)
    assert train(study.path, tmp_path / "laws.npz").exit_code == 0
    found, drawn = (weights.load(path).about for path in (tmp_path / "laws.npz",
                                                          made / "whole.npz"))
    assert found["errors"] == [epoch.error for epoch in session.history]
    assert found["errors"][0] != drawn["errors"][0]
    assert found["start_sha256"] == hashlib.sha256(first.read_bytes()).hexdigest()
    assert "start_sha256" not in drawn


def test_what_a_training_cannot_go_on_from_is_refused_before_the_run(made, tmp_path):
    copyfile(made / "whole.npz", tmp_path / "first.npz")
    study = write_study(tmp_path, ("[train]", 'start = "first.npz"\n[train]'))
    assert_told(train(study, tmp_path / "laws.npz", "--seeds", "2"), 2, "leave out --seeds")
    assert_told(train(study, tmp_path / "first.npz", "--overwrite"), 2, "name another one")
    (tmp_path / "first.npz").write_bytes(b"no weights")
    assert_told(train(study, tmp_path / "laws.npz", "--data", tmp_path / "run.h5"), 2, "first.npz")
    assert not (tmp_path / "run.h5").exists()


def test_weights_say_how_they_were_made(made):
    study, about = load(made / "cubes.toml"), weights.load(made / "whole.npz").about
    assert about["scene_sha256"] == digest(study.scene)
    assert (about["method"], about["dt"], about["threads"]) == ("ours", 5e-4, 1)
    assert about["recipe"]["epochs"] == len(about["errors"]) == 4
    assert about["torch"] == torch.__version__
    assert about["seen"] == strain_bounds(observed(study.problem()).F)
    assert about["run_error"] == run_error(
        study.problem(), body_maker(weights.load(made / "whole.npz")), observed(study.problem()).x)
    assert about["command"] == (f"mpm-ref law train {made / 'cubes.toml'} --out "
                                f"{made / 'whole.npz'} --threads 1")


def test_info_says_it(made):
    about = weights.load(made / "whole.npz").about
    *_, trained, met, by = mpm_ref("info", made / "whole.npz").stdout.splitlines()
    first, last = about["errors"][0], about["errors"][-1]
    assert trained == (f"trained on Cube, scene {about['scene_sha256'][:12]}, 4 epochs: mean "
                       f"squared error of a step [m^2] {first:.3g} at first, over up to 5 steps "
                       f"from a restart; {last:.3g} at last, over up to 9")
    assert met.startswith("met in training: stretches 0.")
    assert by == f"made by: {about['command']}, source sha256 {about['source_sha256'][:12]}"


def test_progress_is_said_where_there_is_no_terminal(made):
    *epochs, last = (made / "said.txt").read_text().splitlines()
    errors = weights.load(made / "whole.npz").about["errors"]
    assert [line.split(":")[0] for line in epochs] == [f"epoch {k} of 4" for k in range(1, 5)]
    assert f"error {errors[1]:.2e} m^2, loss " in epochs[1]
    assert epochs[1].endswith(" s left")
    assert ", 4 segments of 5" in epochs[0]
    assert last == (f"{made / 'whole.npz'}: ours, 4 epochs on {STEPS} steps of 27 points; mean "
                    f"squared error of a step [m^2] {errors[0]:.3g} at first, over up to 5 steps "
                    f"from a restart; {errors[-1]:.3g} at last, over up to 9")


def test_labeled_laws_are_trained_on_answers(tmp_path):
    study = load(write_study(tmp_path, ('method = "ours"', 'method = "labeled"'), scene=[FLOWING]))
    problem, data = study.problem(), trajectory_of(observed(study.problem()))
    labels = labels_of(data, problem.bodies[0].law, problem.clock.dt)
    laws = law_trainer.drawn_laws("labeled", 0, *study.tables.records)
    session = train_labeled(study.tables.train, laws, make_world(problem), labels)
    done = train(study.path, tmp_path / "laws.npz")
    errors = weights.load(tmp_path / "laws.npz").about["errors"]
    assert done.stdout.endswith("labeled, 4 epochs on 20 steps of 27 points; squared error of F "
                                f"{errors[0]:.3g} at first, {errors[-1]:.3g} at last\n")
    assert errors == [epoch.error for epoch in session.history]


def test_constants_of_the_scene_are_identified(tmp_path):
    """They begin too small (see `sysid`). The modulus grows; as nothing yields yet, the yield
    stress has no gradient.
    """
    study = write_study(tmp_path, ('method = "ours"', 'method = "sys-id"'), scene=[FLOWING])
    assert train(study, tmp_path / "laws.npz").exit_code == 0
    law, flow = (trained.kind for trained in weights.load(tmp_path / "laws.npz")[:2])
    true = load(study).problem().bodies[0]
    assert (type(law), type(flow)) == (type(true.law), type(true.flow))
    assert law.mu / law.lam == pytest.approx(true.law.mu / true.law.lam)
    assert E**-0.2 < law.mu / true.law.mu < 1.0
    assert flow.tau_y / true.flow.tau_y == pytest.approx(0.8)
    assert mpm_ref("law", "evaluate", tmp_path / "laws.npz", tmp_path / "cube.toml").exit_code == 0


def test_where_there_is_nothing_to_learn_a_warning_says_so(tmp_path):
    apart = (("lower = [0.11, 0.11, 0.11]", "lower = [0.25, 0.25, 0.25]"),
             ("upper = [0.22, 0.22, 0.22]", "upper = [0.75, 0.75, 0.75]"))
    done = train(write_study(tmp_path, scene=apart), tmp_path / "laws.npz")
    assert_told(done, 0, "the motion hardly depends on stress; are points more than a cell apart")


# Trainings that are cut off.

def test_a_training_that_was_cut_off_goes_on_bit_for_bit(made, tmp_path, monkeypatch):
    def cut(self, history):
        if len(history) == 3:
            raise KeyboardInterrupt

    out = tmp_path / "laws.npz"
    monkeypatch.setattr(fit, "SAVE", 1)
    with monkeypatch.context() as patch:
        patch.setattr(law_train.Epochs, "show", cut)
        assert_told(train(made / "cubes.toml", out), 130, "interrupted before the laws were learn",
                    f"the same command again goes on from {tmp_path / 'laws.pt'}")
    assert not out.exists()
    done = train(made / "cubes.toml", out)
    assert done.output.splitlines()[0].startswith("epoch 4 of 4: ")
    assert bits(out) == bits(made / "whole.npz")
    assert [file.name for file in tmp_path.iterdir()] == ["laws.npz"]


def test_a_training_that_was_cut_off_early_begins_anew(made, tmp_path, monkeypatch):
    def cut(self, history):
        raise KeyboardInterrupt

    monkeypatch.setattr(law_train.Epochs, "show", cut)
    assert_told(train(made / "cubes.toml", tmp_path / "laws.npz"), 130,
                "before there was a checkpoint; the same command again begins anew")
    assert list(tmp_path.iterdir()) == []


def test_a_training_that_diverges_ends_with_status_3(tmp_path, monkeypatch):
    monkeypatch.setattr(fit, "SAVE", 1)
    study = write_study(tmp_path, ("epochs = 4", "epochs = 4\nelastic_rate = 1e12"))
    done = train(study, tmp_path / "laws.npz")
    assert_told(done, 3, "cubes.toml: epoch 2, steps ",
                f"{tmp_path / 'laws.pt'} is of this training: remove it when the study changes")
    assert not (tmp_path / "laws.npz").exists()
    write_study(tmp_path)
    assert_told(train(study, tmp_path / "laws.npz"), 2, "is a checkpoint of the training")


def test_weights_that_cannot_be_written_lose_nothing(made, tmp_path, monkeypatch):
    def full(path, laws):
        raise OSError(f"{path} could not be written: no space left; is the disk full?")

    monkeypatch.setattr(fit, "SAVE", 1)
    with monkeypatch.context() as patch:
        patch.setattr(law_train.weights, "save", full)
        done = train(made / "cubes.toml", tmp_path / "laws.npz")
    assert done.exit_code == 4
    assert done.stderr == (f"mpm-ref: {tmp_path / 'laws.npz'} could not be written: no space left; "
                           "is the disk full?\n")
    assert [file.name for file in tmp_path.iterdir()] == ["laws.pt"]
    assert train(made / "cubes.toml", tmp_path / "laws.npz").exit_code == 0
    assert bits(tmp_path / "laws.npz") == bits(made / "whole.npz")


def test_a_checkpoint_that_cannot_be_written_is_told(made, tmp_path, monkeypatch):
    def full(path, content):
        raise OSError(f"{path} could not be written: no space left; is the disk full?")

    monkeypatch.setattr(fit, "SAVE", 2)
    monkeypatch.setattr(training.weights_file, "write_checkpoint", full)
    assert_told(train(made / "cubes.toml", tmp_path / "laws.npz"), 4, "laws.pt could not be writ")
    assert list(tmp_path.iterdir()) == []


# The run to learn from.

def test_a_run_that_is_kept_gives_the_same_laws_and_is_not_made_again(made, tmp_path):
    file, kept = tmp_path / "run.h5", []
    for again in ((), ("--overwrite",)):
        done = train(made / "cubes.toml", tmp_path / "laws.npz", "--data", file, *again)
        assert done.exit_code == 0, done.output
        assert bits(tmp_path / "laws.npz") == bits(made / "whole.npz")
        kept.append(file.read_bytes())
        checkpoint_of(file).unlink(missing_ok=True)
    assert kept[0] == kept[1]
    assert f"{STEPS + 1} frames" in mpm_ref("info", file).stdout


def test_a_fluid_is_kept_with_j_alone(tmp_path):
    water = 'law = "fixed_corotated", E = 100000.0, nu = 0.2', 'law = "fluid", lam = 1e5'
    study = write_study(tmp_path, ("epochs = 4", "epochs = 1"), scene=[water])
    for name, options in (("a.npz", ()), ("b.npz", ("--data", tmp_path / "run.h5"))):
        assert train(study, tmp_path / name, *options).exit_code == 0
    assert bits(tmp_path / "a.npz") == bits(tmp_path / "b.npz")


def test_a_run_that_was_cut_off_goes_on(made, tmp_path):
    study = load(made / "cubes.toml")
    options = Options(steps=7, fields=StoredFields(("x", "v", "C", "F")))
    run(study.problem(), tmp_path / "run.h5", options)
    done = train(made / "cubes.toml", tmp_path / "laws.npz", "--data", tmp_path / "run.h5")
    assert done.exit_code == 0, done.output
    assert "part: steps 7 to 20" in mpm_ref("info", tmp_path / "run.h5").stdout
    assert bits(tmp_path / "laws.npz") == bits(made / "whole.npz")


def test_ctrl_c_in_the_run_says_how_far_it_is(made, tmp_path, monkeypatch):
    monkeypatch.setattr(law_train.training, "make_run", lambda path, problem, watch: 7)
    done = train(made / "cubes.toml", tmp_path / "laws.npz", "--data", tmp_path / "run.h5")
    assert_told(done, 130, f"interrupted at step 7 of {STEPS} of the run to learn from")


def test_runs_of_other_scenes_and_of_fewer_fields_are_refused(made, tmp_path):
    study = load(made / "cubes.toml")
    run(study.problem(), tmp_path / "few.h5", Options(fields=StoredFields(("x", "v", "F"))))
    other = load(write_study(tmp_path, ("[train]", "[set]\nsteps = 2\n[train]")))
    run(other.problem(), tmp_path / "other.h5", Options(fields=StoredFields(("x", "v", "C", "F"))))
    (tmp_path / "none.h5").write_bytes(b"x")
    for name, words in (("few.h5", "C of body 'cube' is not stored"),
                        ("other.h5", "holds results of another scene"),
                        ("none.h5", "cannot be read as HDF5")):
        done = train(made / "cubes.toml", tmp_path / "laws.npz", "--data", tmp_path / name)
        assert_told(done, 2, name, words)
        assert not (tmp_path / "laws.npz").exists()


@pytest.mark.parametrize("name", ["x", "C", "F"])
def test_a_run_that_holds_no_numbers_is_refused(made, tmp_path, name):
    study = load(made / "cubes.toml")
    run(study.problem(), tmp_path / "run.h5", Options(fields=StoredFields(("x", "v", "C", "F"))))
    with JournaledFile(tmp_path / "run.h5", checked=True) as file:
        with h5py.File(file, "r+") as h5:
            h5[f"bodies/cube/{name}"][7, 5] = np.nan
        file.commit()
    done = train(made / "cubes.toml", tmp_path / "laws.npz", "--data", tmp_path / "run.h5")
    assert_told(done, 2, f"run.h5: {name} of particle 5 after step 7 is [", "make the run again")


def test_a_run_that_becomes_unstable_has_status_3(tmp_path):
    scene = ("dim = 3", 'dim = 3\nunstable = "allow"'), ("dt = 0.0005", "dt = 0.05")
    done = train(write_study(tmp_path, scene=scene), tmp_path / "laws.npz")
    assert_told(done, 3, "cubes.toml: unstable at step ")
