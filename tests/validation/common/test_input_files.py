"""The data files and the results that an experiment has read are noted with their hashes."""

import hashlib
from pathlib import Path

from validation.common import input_files
from validation.common.input_files import opened
from validation.common.registry import Experiment
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.common.scenes import catalogue_scene
from validation.common.source_digest import ROOT
from validation.hot.table3 import table3

ID = "verification.toy"


def write(root, file, text):
    path = Path(root, file)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def test_data_files_that_are_opened_are_noted_with_their_hash(tmp_path):
    for file in ("scenes/a.toml", "validation/nsf/weights/b.npz", "validation/targets/c.toml",
                 "mpm_ref/code.py", "results/d.json"):
        write(tmp_path, file, file)
        (tmp_path / file).read_bytes()
    write(tmp_path, "scenes/unread.toml", "")
    (tmp_path / "scenes/unread.toml").unlink()
    assert opened(tmp_path) == {file: hashlib.sha256(file.encode()).hexdigest()[:16]
                                for file in ("scenes/a.toml", "validation/nsf/weights/b.npz")}


def test_a_result_counts_where_it_is_declared(tmp_path, monkeypatch):
    monkeypatch.setattr(input_files, "_opened", set())
    monkeypatch.setattr(input_files, "_declared", set())
    write(tmp_path, "results/d.csv", "1")
    assert opened(tmp_path) == {}
    input_files.declare("results/d.csv")
    input_files.declare("results/missing.csv")
    assert opened(tmp_path) == {"results/d.csv": input_files.file_hash(tmp_path / "results/d.csv")}


def test_an_experiment_records_the_scene_that_it_reads(tmp_path, monkeypatch):
    monkeypatch.setattr(input_files, "_opened", set())

    def reads_a_scene(run):
        catalogue_scene("hello")
        run.record(f"{ID}.error", 0.5, comparator="<=", bound=1.0)

    reads_a_scene.__module__ = table3.__module__        # a module of the repository has a digest
    assert run_all([Experiment(ID, "A toy", ("quick",), {"quick": 1.0}, reads_a_scene)],
                   RunSetting("quick", tmp_path)) == []
    inputs = ProfileResults(tmp_path).records(ID)[0].origin.inputs
    assert inputs == input_files.always() | {
        "scenes/hello.toml": input_files.file_hash(ROOT / "scenes/hello.toml")}


def test_printed_values_count_and_their_rules_do_not(tmp_path):
    text = 'paper = "a"\ntargets = [{id = "a.b", value = 1.0, what = "x"}]\n'
    write(tmp_path, "validation/targets/a.toml", text)
    before = input_files.hash_now("validation/targets", tmp_path)
    for new, same in ((text.replace('"x"', '"y"'), True), (text + '[[cause]]\nids = []\n', True),
                      (text.replace("1.0", "2.0"), False)):
        write(tmp_path, "validation/targets/a.toml", new)
        assert (input_files.hash_now("validation/targets", tmp_path) == before) is same


def test_what_an_experiment_declares_does_not_count_for_the_next(tmp_path, monkeypatch):
    monkeypatch.setattr(input_files, "_opened", set())
    result = "results/stale.toml"

    def declares(run):
        input_files.declare(result)
        run.record(f"{ID}.error", 0.5, comparator="<=", bound=1.0)

    def declares_not(run):
        run.record("verification.other.error", 0.5, comparator="<=", bound=1.0)

    declares.__module__ = declares_not.__module__ = table3.__module__
    first, second = (Experiment(id, "A toy", ("quick",), {"quick": 1.0}, function)
                     for id, function in ((ID, declares), ("verification.other", declares_not)))
    assert run_all([first, second], RunSetting("quick", tmp_path)) == []
    inputs = [ProfileResults(tmp_path).records(id)[0].origin.inputs
              for id in (ID, "verification.other")]
    assert [result in each for each in inputs] == [True, False]
