"""`mpm-ref rom generate` and `train`: what they write, say and refuse."""

import shutil

import h5py
import pytest
from command_line import assert_told, mpm_ref
from small_studies import CURVED, STEPS, ended, write

from mpm_ref.cli.catalogue import bundled_studies
from mpm_ref.cli.study_kinds import is_study
from mpm_ref.rom.study import reduce
from mpm_ref.rom.study.generate import FINISHED, GeneratedRun
from mpm_ref.rom.study.methods import LDM_METHOD
from mpm_ref.rom.study.study import load
from mpm_ref.scene import build
from mpm_ref.store.running import Options, run
from mpm_ref.store.writer import StoredFields

ONE = ("--workers", 1)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Folder with a study, its runs and its map, made by the two commands."""
    folder = tmp_path_factory.mktemp("made")
    study = write(folder)
    for arguments, said in ((("generate", study, "--out", folder / "data", *ONE),
                             "made 4, continued 0, 0 were there; 1 held out"),
                            (("train", study, "--data", folder / "data",
                              "--out", folder / "map.npz"), "modes, r = 3, of 3 runs")):
        done = mpm_ref("rom", *arguments)
        assert done.exit_code == 0, done.output
        assert said in done.stdout
    return folder


# generate

def test_what_is_there_is_not_made_again(made):
    before = {file: file.stat().st_mtime_ns for file in (made / "data").iterdir()}
    done = mpm_ref("rom", "generate", made / "bars.toml", "--out", made / "data", *ONE)
    assert done.exit_code == 0
    assert "4 runs of bars: made 0, continued 0, 4 were there; 1 held out" in done.stdout
    assert {file: file.stat().st_mtime_ns for file in (made / "data").iterdir()} == before


def test_where_no_bar_is_shown_each_run_has_a_line(made):
    done = mpm_ref("rom", "generate", made / "bars.toml", "--out", made / "data", *ONE)
    first, *lines, last = done.stdout.splitlines()
    assert first == f"{made / 'data'}: 4 runs of bars, 1 at a time"
    assert lines == [f"{k + 1} of 4: {made / 'data'}/case-00{k}.h5, g = {k + 1}: was there"
                     for k in range(4)]
    assert last.startswith(f"{made / 'data'}: 4 runs of bars: made 0")


def test_runs_are_results_files(made):
    done = mpm_ref("info", made / "data" / "case-002.h5")
    assert f"{STEPS + 1} frames" in done.stdout
    assert "(x v F)" in done.stdout


def test_an_unstable_run_has_status_3_and_says_which(tmp_path):
    study = write(tmp_path, ("to = 4.0\ncount = 4", "to = 1e6\ncount = 3"))
    done = mpm_ref("rom", "generate", study, "--out", tmp_path / "data", *ONE)
    assert_told(done, 3, "run 1 (g = 500000", "unstable")
    assert ended(tmp_path / "data" / "case-000.h5") == ("finished", STEPS + 1)


@pytest.mark.parametrize(("before", "after", "words"), [
    ('transfer = "pic"', 'transfer = "flip"', "has the transfer flip"),
    ('transfer = "pic"', 'transfer = "apic", rpic = 0.5', "has scheme.rpic"),
    ("dim = 2", 'dim = 2\nintegrator = "hot"', "has the implicit integrator"),
    ('law = "fixed_corotated", E = 1e4, nu = 0.3',
     'law = "hencky", E = 1e4, nu = 0.3, flow = { type = "von_mises", tau_y = 1.0 }',
     "has plastic flow"),
])
def test_scenes_that_reduced_runs_do_not_know_are_refused_before_any_run(
        tmp_path, before, after, words):
    text = (write(tmp_path).parent / "bar.toml").read_text()
    assert before in text
    study = write(tmp_path, scene=text.replace(before, after))
    assert_told(mpm_ref("rom", "generate", study, "--out", tmp_path / "data"), 2, words)
    assert not (tmp_path / "data").exists()


def test_data_go_into_a_folder(made, tmp_path):
    (tmp_path / "file").write_text("x")
    done = mpm_ref("rom", "generate", made / "bars.toml", "--out", tmp_path / "file")
    assert_told(done, 4, "this is no folder")


def test_a_folder_is_not_named_as_files_are(made, tmp_path):
    done = mpm_ref("rom", "generate", made / "bars.toml", "--out", tmp_path / "data.npz", *ONE)
    assert_told(done, 2, "data.npz: expected the name of a folder", "leave the ending out")
    assert list(tmp_path.iterdir()) == []


def test_a_study_that_does_not_exist_is_told_with_those_of_reduced_models():
    told = mpm_ref("rom", "generate", "none")
    for name, path in bundled_studies().items():
        assert (name in told.stderr.split(": ")[-1].strip().split(", ")) == is_study(path)
    assert_told(told, 2, "no such file")


def test_ctrl_c_says_how_far_it_is_and_how_to_go_on(made, tmp_path, monkeypatch):
    def interrupted(*_):
        yield GeneratedRun(0, FINISHED)
        raise KeyboardInterrupt
    monkeypatch.setattr("mpm_ref.cli.rom_train.generate", interrupted)
    done = mpm_ref("rom", "generate", made / "bars.toml", "--out", tmp_path, *ONE)
    assert_told(done, 130, "interrupted after 1 of 4 runs; the same command again goes on")


def test_a_run_that_was_cut_off_counts_as_continued(made, tmp_path):
    study = write(tmp_path)
    shutil.copy(made / "data" / "case-000.h5", tmp_path)
    bars = load(study)
    run(build(bars.scene(bars.mu[1])), tmp_path / "case-001.h5",
        Options(steps=3, fields=StoredFields(LDM_METHOD.stored)))
    done = mpm_ref("rom", "generate", study, "--out", tmp_path, *ONE)
    assert "made 2, continued 1, 1 were there; 1 held out" in done.stdout
    assert [line.split(": ")[-1] for line in done.stdout.splitlines()[1:-1]] == [
        "was there", "continued", "made", "made"]


@pytest.mark.parametrize("edits", [
    (("test = 1", 'test = 1\nsampling = "latin"'),),
    (("test = 1", 'test = 1\nsampling = "latin"\ncount = 4'),),
])
def test_a_count_in_the_wrong_place_is_told_where_it_belongs(tmp_path, edits):
    done = mpm_ref("rom", "generate", write(tmp_path, *edits))
    assert_told(done, 2, "`count = N`", "beside `sampling`")


# train

def test_data_that_are_not_there_are_told_with_the_command_that_makes_them(made, tmp_path):
    done = mpm_ref("rom", "train", made / "bars.toml", "--data", tmp_path,
                   "--out", tmp_path / "map.npz")
    assert_told(done, 2, "lacks 3 of 3 runs", "mpm-ref rom generate")
    assert not (tmp_path / "map.npz").exists()


def test_damaged_data_are_told(made, tmp_path):
    shutil.copytree(made / "data", tmp_path / "data")
    file = next(file for file in sorted((tmp_path / "data").glob("case-00?.h5"))
                if int(file.stem[-1]) in load(made / "bars.toml").train)
    content = bytearray(file.read_bytes())
    with h5py.File(file) as h5:
        at = h5.userblock_size + h5["bodies/bar/F"].id.get_chunk_info(2).byte_offset
    content[at] ^= 1
    file.write_bytes(content)
    done = mpm_ref("rom", "train", made / "bars.toml", "--data", tmp_path / "data",
                   "--out", tmp_path / "map.npz")
    assert_told(done, 2, file.name, "is damaged",
                f"remove the file, and make it again: mpm-ref rom generate {made / 'bars.toml'}")


@pytest.mark.parametrize("saved", [False, True])
def test_ctrl_c_in_a_training_says_how_to_go_on(made, tmp_path, monkeypatch, saved):
    def interrupted(study, snapshots, about, checkpoint, threads):
        if saved:
            checkpoint.write_bytes(b"x")
        raise KeyboardInterrupt
    monkeypatch.setattr("mpm_ref.cli.rom_train.compute_model", interrupted)
    done = mpm_ref("rom", "train", made / "bars.toml", "--data", made / "data",
                   "--out", tmp_path / "map.npz")
    assert_told(done, 130, f"goes on from {tmp_path / 'map.pt'}" if saved else
                "before there was a checkpoint; the same command again begins anew")


def test_a_checkpoint_that_cannot_be_written_is_told(made, tmp_path, monkeypatch):
    def full(study, snapshots, about, checkpoint, threads):
        raise OSError(f"{checkpoint} could not be written: no space left; is the disk full?")
    monkeypatch.setattr("mpm_ref.cli.rom_train.compute_model", full)
    done = mpm_ref("rom", "train", made / "bars.toml", "--data", made / "data",
                   "--out", tmp_path / "map.npz")
    assert_told(done, 4, "map.pt could not be written: no space left")


@pytest.mark.parametrize(("options", "status", "words"), [
    (("--out", "{}/map.npz"), 2, "exists: add --overwrite"),
    (("--out", "{}/map.h5"), 2, "ends in .npz"),
    (("--out", "{}/bars.toml"), 2, "this is the scene itself"),
    (("--out", "{}/no/map.npz"), 4, "there is no folder"),
    (("--out", "{}/other.npz", "--kind", "mode"), 2, "kind = 'mode': expected one of"),
])
def test_maps_are_not_written_anywhere(made, options, status, words):
    before = (made / "map.npz").read_bytes()
    done = mpm_ref("rom", "train", made / "bars.toml", "--data", made / "data",
                   *(option.format(made) for option in options))
    assert_told(done, status, words)
    assert (made / "map.npz").read_bytes() == before


def test_more_modes_than_the_data_have_are_refused(made, tmp_path):
    study = write(tmp_path, ("r = 3", "r = 27"))
    done = mpm_ref("rom", "train", study, "--data", made / "data", "--out", tmp_path / "map.npz")
    assert_told(done, 2, "r = 27: the snapshots hold only ")


def test_a_curved_map_is_made_at_once(made, tmp_path):
    study, out = write(tmp_path, *CURVED), tmp_path / "map.npz"
    done = mpm_ref("rom", "train", study, "--data", made / "data", "--out", out)
    assert done.exit_code == 0, done.output
    assert "curved, r = 2, of 3 runs" in done.stdout
    assert reduce.load(out, load(study)).about["command"].endswith("--kind curved --threads 1")


def test_a_study_without_the_settings_of_a_curved_map_makes_none(made, tmp_path):
    done = mpm_ref("rom", "train", made / "bars.toml", "--data", made / "data", "--kind", "curved",
                   "--out", tmp_path / "map.npz")
    assert_told(done, 2, "modes = none: expected more than r = 3", "bars.toml or a copy",
                'in [map] kind = "curved" and `modes`', 'in [run] projection = "nonlinear"')


def test_the_name_of_a_map_is_looked_at_first(made):
    done = mpm_ref("rom", "train", made / "bars.toml", "--kind", "curved", "--out", "map.txt")
    assert_told(done, 2, "--out map.txt: expected a name that ends in .npz\n")


def test_a_network_is_trained_with_torch(made, tmp_path):
    pytest.importorskip("torch")
    study = write(tmp_path, ("r = 3", "r = 2"), ('"modes"', '"network"\nepochs = 2'))
    out = tmp_path / "map.npz"
    done = mpm_ref("rom", "train", study, "--data", made / "data", "--out", out)
    assert done.exit_code == 0, done.output
    assert "network, r = 2" in done.stdout
    assert not out.with_suffix(".pt").exists()
    about = reduce.load(out, load(study)).about
    assert (about["map"]["epochs"], about["threads"], len(about["loss"])) == (2, 1, 2)
    assert about["command"].startswith(f"mpm-ref rom train {study}")
