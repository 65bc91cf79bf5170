"""Records that were edited, or whose source has changed, are found; and made again, compared."""

import json
import time
from pathlib import Path

import msgspec
import pytest
from typer.testing import CliRunner

from validation import __main__ as cli
from validation.common import standing
from validation.common.provenance import Occupation, busy_cores, occupation
from validation.common.recheck import ChangedNumber, differences, is_timed, recheck, sample
from validation.common.record import Measurement, Origin, read_records, sealed, write_records
from validation.common.registry import Catalogue, Experiment, discover
from validation.common.results import RESULTS, ProfileResults
from validation.common.run import RunSetting, run_all
from validation.common.source_digest import ROOT, STORAGE, closure, file_of, source_digest
from validation.common.standing import (
    WORDS,
    Marker,
    Standing,
    disturbed,
    read_markers,
    refusals,
    standing_text,
    standings,
    state_of,
    was_disturbed,
    with_verdicts,
)
from validation.common.targets import Targets, load
from validation.hot.table3 import table3

ID = "verification.toy"
SHORT, FEW = 20.0, 5        # CPU seconds and number of the published records that are made again


def toy(run):
    run.record(f"{ID}.error", 0.5, comparator="<=", bound=1.0)
    run.record(f"{ID}.drawn", float(run.rng.random()), comparator="info")
    run.table("curve", ["x"], [(1,)])


toy.__module__ = table3.__module__         # a module of the repository has a digest
TOY = Experiment(ID, "A toy", ("quick",), {"quick": 1.0}, toy)


@pytest.fixture
def results(tmp_path):
    """Results of the toy."""
    assert run_all([TOY], RunSetting("quick", tmp_path / "quick", seed=3)) == []
    return ProfileResults(tmp_path / "quick")


def state(results, experiments=None):
    one, = standings(results, {ID: TOY} if experiments is None else experiments)
    return one.state


def edit(results, change):
    """Change the text of the records, as by hand."""
    file = results.folder / f"{ID}.json"
    file.write_text(change(file.read_text()))


def test_new_records_are_current(results):
    origin = results.records(ID)[0].origin
    assert (origin.digest, len(origin.seal)) == (source_digest(table3.__module__), 64)
    assert state(results) == "current"


@pytest.mark.parametrize("change", [
    lambda text: text.replace("0.5", "0.4"), lambda text: text.replace('"A toy"', '"A game"'),
    lambda text: json.dumps(json.loads(text)[:-1]),
    lambda text: text.replace('"bound": 1.0', '"bound": 2.0'),
    lambda text: text.replace('"seed": 3', '"seed": 4')],
    ids=["value", "note", "record", "bound", "seed"])
def test_an_edit_by_hand_shows(results, change):
    edit(results, change)
    assert state(results) == "edited"


def test_an_edit_of_a_table_shows(results):
    (results.folder / f"{ID}.curve.csv").write_text("x\n2\n")
    assert state(results) == "edited"


def test_another_layout_of_the_same_content_is_no_edit(results):
    edit(results, lambda text: json.dumps(json.loads(text)))
    assert state(results) == "current"


def test_another_source_makes_records_stale(results, monkeypatch):
    monkeypatch.setattr(standing, "source_digest", lambda module, root: "0" * 16)
    assert state(results) == "stale"


def test_a_changed_data_file_makes_records_stale(results):
    records = results.records(ID)
    inputs = {"scenes/hello.toml": "0" * 16}
    origin = msgspec.structs.replace(records[0].origin, inputs=inputs, seal="")
    write_records(results.folder / f"{ID}.json", sealed(
        [msgspec.structs.replace(records[0], origin=origin), *records[1:]],
        results.table_bytes(ID)))
    assert state(results) == "stale"


def test_records_without_an_experiment_are_orphaned(results):
    assert state(results, {}) == "orphaned"


def test_records_without_a_digest_are_early(results):
    records = read_records(results.folder / f"{ID}.json")
    write_records(results.folder / f"{ID}.json",
                  [msgspec.structs.replace(r, origin=None) for r in records])
    assert state(results) == "early"
    text = standing_text(standings(results, {ID: TOY}))
    assert text.splitlines() == [
        "0 of 1 experiments are current", f"1 made before records had digests and seals: {ID}"]


# The source of an experiment

def test_closure_has_what_a_module_imports_in_any_way(tmp_path):
    write(tmp_path, "validation/toy/run.py", "from ..common import cells\nimport mpm_ref.step\n"
          "def f():\n    from mpm_ref.laws import soft\n")
    for file in ("validation/common/cells.py", "mpm_ref/step.py", "mpm_ref/laws/soft.py",
                 "mpm_ref/laws/__init__.py", "validation/__init__.py", "mpm_ref/other.py"):
        write(tmp_path, file, "")
    assert closure("validation.toy.run", tmp_path) == {
        "validation.toy.run", "validation", "validation.common.cells", "mpm_ref.step",
        "mpm_ref.laws", "mpm_ref.laws.soft"}


@pytest.mark.parametrize(("file", "text", "changes"), [
    ("mpm_ref/step.py", '"""Words."""\ndt = 1  # more words\n', False),
    ("mpm_ref/step.py", "dt = 2\n", True),
    ("mpm_ref/other.py", "dt = 2\n", False),
    ("validation/toy/run.py", "import mpm_ref.step\nn = 1\n", True),
])
def test_digest_follows_the_code_that_is_imported(tmp_path, file, text, changes):
    roots = tmp_path / "before", tmp_path / "after"
    for root in roots:
        write(root, "validation/toy/run.py", "import mpm_ref.step\n")
        write(root, "mpm_ref/step.py", "dt = 1\n")
        write(root, "mpm_ref/other.py", "dt = 1\n")
    write(roots[1], file, text)
    before, after = (source_digest("validation.toy.run", root) for root in roots)
    assert (before != after) is changes


def test_a_module_elsewhere_has_no_digest(tmp_path):
    assert source_digest("json", tmp_path) == ""


def write(root, file, text):
    path = Path(root, file)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def test_the_storage_of_numbers_is_no_source():
    names = closure("validation.hot.table3")
    assert not names & STORAGE
    assert {"validation.common.scenes", "mpm_ref.hot.step"} <= names
    assert all(file_of(name, ROOT) for name in STORAGE)


# Markers

def marked(state, *patterns, judged=(ID,)):
    return refusals([Standing(ID, state)], [Marker("quick", [*patterns], "of late")], {*judged})


def test_a_judged_record_that_is_not_current_needs_a_marker():
    assert marked("current") == [] == marked("stale", ID) == marked("early", "verification.*")
    assert marked("stale") == [f"{ID}: {WORDS['stale']}"]
    assert len(marked("early")) == 1
    assert marked("stale", judged=()) == []


@pytest.mark.parametrize("state", ["edited", "orphaned"])
def test_no_marker_excuses_an_edit_or_a_record_without_experiment(state):
    assert f"{ID}: {WORDS[state]}" in marked(state, ID)
    assert marked(state, judged=()) == [f"{ID}: {WORDS[state]}"]


def test_a_marker_that_marks_nothing_is_a_fault():
    assert len(marked("current", ID)) == 1
    assert len(marked("stale", ID, "nsf.*")) == 1


def test_markers_are_read_by_profile(tmp_path):
    assert read_markers(tmp_path, "quick") == []
    (tmp_path / "stale.toml").write_text(
        '[[marker]]\nprofile = "quick"\nids = ["a.*"]\nreason = "of late"\n')
    assert read_markers(tmp_path, "quick") == [Marker("quick", ["a.*"], "of late")]
    assert read_markers(tmp_path, "standard") == []


@pytest.mark.parametrize("profile", ["standard", "paper"])
def test_published_records_are_current_or_marked(profile):
    published = ProfileResults(RESULTS / profile)
    found = standings(published, discover().experiments)
    assert refusals(found, read_markers(RESULTS, profile), with_verdicts(published, load())) == []


def test_a_printed_setting_in_seconds_is_no_time():
    settings = ProfileResults(RESULTS / "standard").records("hot.settings")
    origin = msgspec.structs.replace(settings[0].origin or Origin(), others=2.0)
    first = msgspec.structs.replace(settings[0], origin=origin)
    assert not was_disturbed([first, *settings[1:]], load())


# Times beside other work

@pytest.mark.parametrize(("others", "unit", "rule", "expected"), [
    (0.5, "x", {"comparator": "<=", "bound": 2.0}, [ID]),
    (0.05, "x", {"comparator": "<=", "bound": 2.0}, []),
    (None, "x", {"comparator": "<=", "bound": 2.0}, []),
    (0.5, "x", {"comparator": "info"}, []),
    (0.5, "%", {"comparator": "<=", "bound": 2.0}, []),
    (0.5, "s", {"comparator": "<=", "bound": 2.0}, []),
    (0.5, "s", {"comparator": "<=", "bound": 2.0, "note": "CPU time of a step"}, [ID]),
])
def test_judged_times_measured_beside_other_work_are_listed(tmp_path, others, unit, rule, expected):
    fields = {"note": "", **rule}
    record = msgspec.structs.replace(measured(1.0, unit=unit), origin=Origin(others=others),
                                     **fields)
    write_records(tmp_path / f"{ID}.json", [record])
    assert disturbed(ProfileResults(tmp_path), Targets({})) == expected


def test_cores_that_other_processes_keep_busy():
    before = Occupation(10.0, 100.0, 5.0)
    assert busy_cores(before, Occupation(20.0, 118.0, 15.0)) == 0.8
    assert busy_cores(before, Occupation(20.0, 109.0, 15.0)) == 0.0
    assert busy_cores(before, Occupation(20.0, None, 15.0)) is None


def test_own_work_does_not_count_as_that_of_others():
    before = occupation()
    end = time.process_time() + 0.5
    while time.process_time() < end:
        pass
    after = occupation()
    assert after.process - before.process >= 0.45
    assert after.machine is None or after.machine - before.machine >= 0.4


# Records that are made again

def test_an_experiment_that_is_run_again_with_its_seed_gives_the_same(results, tmp_path):
    setting = RunSetting("quick", results.folder, seed=99)
    assert recheck(TOY, results, setting, tmp_path / "again") == []
    edit(results, lambda text: text.replace('"value": 0.5,', '"value": 0.6,'))
    found = recheck(TOY, results, setting, tmp_path / "again")
    assert [(one.target, one.stored, one.new) for one in found] == [(f"{ID}.error", 0.6, 0.5)]


def measured(value, target=ID, **fields):
    fields = {"unit": "%", "note": "", **fields}
    return Measurement(target=target, value=value, scale="", seconds=1.0, seed=0, command="",
                       commit="", date="", cores=2, comparator="info", **fields)


@pytest.mark.parametrize(("old", "new", "differs"), [
    (measured(1.0), measured(1.0), False),
    (measured(1.0), measured(1.0 + 1e-6), False),
    (measured(1.0), measured(1.0 + 1e-4), True),
    (measured(0.0), measured(1e-30), False),
    (measured(1e-15), measured(2e-12), True), (measured(0.0), measured(1e-9), True),
    (measured(None), measured(None), False),
    (measured(None), measured(1.0), True),
    (measured(1.0, unit="s"), measured(1.9), False),
    (measured(1.0, unit="s"), measured(2.1), True), (measured(1.0, unit="s"), measured(0.4), True),
    (measured(1.0, unit="GB"), measured(1.1), False),
    (measured(1.0, unit="GB"), measured(2.0), True),
    (measured(1.0, unit="1", note="CPU time of a step"), measured(1.9), False),
    (measured(1.0, note="a run takes 1 CPU s"), measured(1.9), True),
    (measured(1.0, note="errors at 31 times"), measured(1.9), True),
    (measured(1.0, scatter=0.2), measured(1.1), False),
    (measured(1.0, scatter=0.2), measured(1.5), True),
    (measured(1.0), measured(1.0, target="verification.other"), True),
])
def test_numbers_are_compared_within_their_scatter(old, new, differs):
    assert bool(differences([old], [new])) is differs


def test_a_missing_number_differs_without_bound():
    assert differences([measured(1.0)], []) == [ChangedNumber(ID, 1.0, None, float("inf"))]


def test_the_cheapest_are_sampled_or_drawn_with_a_seed(tmp_path):
    experiments = {}
    for k, seconds in enumerate((3.0, 1.0, 2.0)):
        id = f"verification.toy{k}"
        experiments[id] = TOY._replace(id=id)
        write_records(tmp_path / f"{id}.json",
                      [msgspec.structs.replace(measured(1.0, id), seconds=seconds)])
    stored = ProfileResults(tmp_path)
    ids = [e.id for e in sample(stored, experiments, 2)]
    assert ids == ["verification.toy1", "verification.toy2"]
    drawn = {tuple(e.id for e in sample(stored, experiments, 2, seed)) for seed in range(8)}
    assert len(drawn) > 2
    assert sample(stored, {}, 2) == []


@pytest.mark.slow
def test_some_published_records_come_out_again(tmp_path):
    """A few short ones whose source is today's, drawn; within their scatter, but for times, and for
    memory, which is of a process: here of one that ran other tests before.
    """
    published, experiments = ProfileResults(RESULTS / "standard"), discover().experiments
    short = {one.experiment: experiments[one.experiment]
             for one in standings(published, experiments) if one.state == "current"
             and published.records(one.experiment)[0].cpu_seconds < SHORT}
    assert len(short) >= FEW
    setting = RunSetting("standard", published.folder, targets=load())
    for experiment in sample(published, short, FEW, seed=1):
        machine = {one.target for one in published.records(experiment.id)
                   if is_timed(one) or one.unit == "GB"}
        found = [one for one in recheck(experiment, published, setting, tmp_path)
                 if one.target not in machine]
        assert not found, (experiment.id, found)


# The command line

@pytest.fixture
def invoke(monkeypatch, results):
    """Run the command line on the toy's results."""
    monkeypatch.setattr(cli, "discover", lambda: Catalogue({ID: TOY}, {}))
    place = ["--profile", "quick", "--results", str(results.folder.parent)]
    return lambda *words: CliRunner().invoke(cli.app, [*words, *place])


def test_status_lists_what_is_not_current_and_is_strict_on_request(invoke, results):
    assert invoke("status", "--strict").exit_code == 0
    edit(results, lambda text: text.replace("0.5", "0.4"))
    told = invoke("status")
    assert (told.exit_code, invoke("status", "--strict").exit_code) == (0, 1)
    assert f"1 changed by hand after they were made: {ID}" in told.output


def test_status_accepts_what_is_marked(invoke, results, monkeypatch):
    monkeypatch.setattr(standing, "source_digest", lambda module, root: "0" * 16)
    strict = invoke("status", "--strict")
    assert (strict.exit_code, f"{ID}: {WORDS['stale']}" in strict.output) == (1, True)
    (results.folder.parent / "stale.toml").write_text(
        f'[[marker]]\nprofile = "quick"\nids = ["{ID}"]\nreason = "of late"\n')
    assert invoke("status", "--strict").exit_code == 0


def test_recheck_runs_a_sample_and_leaves_the_records(invoke, results):
    told = invoke("recheck", "--sample", "1")
    assert (told.exit_code, f"{ID}: the same" in told.output) == (0, True)
    edit(results, lambda text: text.replace('"value": 0.5,', '"value": 0.6,'))
    told = invoke("recheck", "--sample", "1")
    assert (told.exit_code, f"{ID}.error: 0.6 stored, 0.5 now" in told.output) == (1, True)
    assert results.value(ID, f"{ID}.error") == 0.6


@pytest.mark.parametrize("profile", ["standard", "paper"])
def test_no_published_record_was_edited(profile):
    published = ProfileResults(RESULTS / profile)
    assert len(published.ids()) > 5
    assert not [id for id in published.ids() if state_of(published, id, None) == "edited"]
