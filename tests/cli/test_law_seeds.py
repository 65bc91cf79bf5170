"""`mpm-ref law train --seeds`: trainings that differ in their seed alone. Needs PyTorch."""

import pytest
from command_line import assert_told, mpm_ref
from small_laws import write_study

pytest.importorskip("torch")

from mpm_ref.cli.law_seeds import error_lines
from mpm_ref.executor.tasks import set_stop_source
from mpm_ref.materials.learned import weights
from mpm_ref.nclaw.study.seeds import (
    SeedErrors,
    errors_of,
    seed_trainings,
    train_seed,
    trained_before,
    with_seed,
)
from mpm_ref.nclaw.study.study import load

pytestmark = pytest.mark.usefixtures("one_torch_thread")


def bits(path):
    """Weights and errors of a file."""
    laws = weights.load(path)
    return [[a.tobytes() for layer in law.layers for a in layer]
            for law in laws[:2]] + [laws.about["errors"], laws.about["run_error"]]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Folder with a study, and the laws of two seeds; the text that was printed in stdout."""
    folder = tmp_path_factory.mktemp("seeds")
    done = mpm_ref("law", "train", write_study(folder), "--out", folder / "law.npz", "--seeds", "2",
                   "--workers", "1")
    assert done.exit_code == 0, done.output
    (folder / "stdout").write_text(done.stdout)
    return folder


@pytest.mark.parametrize("seed", [0, 1])
def test_weights_are_those_of_a_training_with_that_seed(made, tmp_path, seed):
    study = write_study(tmp_path, ("[train]", f"[train]\nseed = {seed}"))
    assert mpm_ref("law", "train", study, "--out", tmp_path / "one.npz").exit_code == 0
    assert bits(tmp_path / "one.npz") == bits(made / f"law.seed-{seed}.npz")
    assert bits(made / "law.seed-0.npz") != bits(made / "law.seed-1.npz")


def test_the_errors_of_all_are_printed(made):
    *each, last = (made / "stdout").read_text().splitlines()[-3:]
    for seed, line in enumerate(each):
        known = errors_of(weights.load(made / f"law.seed-{seed}.npz"))
        assert line == (f"law.seed-{seed}.npz: mean squared error of a step [m^2] {known.last:.3g} "
                        f"at last; its run is off by {100.0 * known.run:.3g} % of the motion")
    assert last.startswith("2 seeds: error of a run in the median ")


def test_processes_give_the_same_bits_and_keep_what_is_there(made, tmp_path):
    study = write_study(tmp_path)
    (tmp_path / "law.seed-0.npz").write_bytes((made / "law.seed-0.npz").read_bytes())
    kept = (tmp_path / "law.seed-0.npz").stat().st_mtime_ns
    done = mpm_ref("law", "train", study, "--out", tmp_path / "law.npz", "--seeds", "3",
                   "--workers", "2")
    assert done.exit_code == 0, done.output
    assert (tmp_path / "law.seed-0.npz").stat().st_mtime_ns == kept
    assert bits(tmp_path / "law.seed-1.npz") == bits(made / "law.seed-1.npz")
    assert "3 seeds" in done.stdout
    assert not list(tmp_path.glob("*.pt"))


def test_weights_of_another_training_are_not_replaced(made, tmp_path):
    study = write_study(tmp_path, ("epochs = 4", "epochs = 2"))
    (tmp_path / "law.seed-1.npz").write_bytes((made / "law.seed-1.npz").read_bytes())
    before = (tmp_path / "law.seed-1.npz").read_bytes()
    options = "--out", tmp_path / "law.npz", "--seeds", "2", "--workers", "1"
    assert_told(mpm_ref("law", "train", study, *options), 2, "law.seed-1.npz exists: add --over")
    assert (tmp_path / "law.seed-1.npz").read_bytes() == before
    assert not (tmp_path / "law.seed-0.npz").exists()
    assert mpm_ref("law", "train", study, *options, "--overwrite").exit_code == 0
    assert (tmp_path / "law.seed-1.npz").read_bytes() != before


@pytest.mark.parametrize(("options", "words"), [
    (("--seeds", "2", "--scheduler", "here"), "scheduler 'here': expected local:N"),
    (("--seeds", "2", "--data", "run.csv"), "run.csv")])
def test_bad_options_are_one_sentence(tmp_path, options, words):
    study = write_study(tmp_path)
    assert_told(mpm_ref("law", "train", study, "--out", tmp_path / "law.npz", *options), 2, words)
    assert not list(tmp_path.glob("*.npz"))


def test_a_training_stops_when_its_executor_asks(made, tmp_path):
    one, = seed_trainings(load(made / "cubes.toml"), 1, made / "law.run.h5", tmp_path / "law.npz",
                          "")
    set_stop_source(lambda: True)
    try:
        with pytest.raises(KeyboardInterrupt):
            train_seed(one)
    finally:
        set_stop_source(None)
    assert not (tmp_path / "law.seed-0.npz").exists()
    assert trained_before(one) is None
    train_seed(one)
    assert trained_before(one) == errors_of(weights.load(made / "law.seed-0.npz"))
    another = one._replace(study=with_seed(one.study, 7))
    assert trained_before(another) is None


def test_a_run_that_breaks_down_is_the_worst(made):
    study = load(made / "cubes.toml")
    trainings = seed_trainings(study, 3, "run.h5", "law.npz", "")
    errors = [SeedErrors(1e-8, 0.1), SeedErrors(1e-8, None), SeedErrors(1e-8, 0.02)]
    lines = error_lines(study, trainings, errors)
    assert lines[1].endswith("its run breaks down")
    assert lines[-1] == ("3 seeds: error of a run in the median 10 %, from 2 % to that of a run "
                         "that breaks down")
