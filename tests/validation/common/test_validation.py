"""The frame of the validation suite: runs, what they leave, the command line."""

import json
import math
import os
import subprocess

import msgspec
import pytest
from typer.testing import CliRunner

from validation import __main__ as cli
from validation.common.provenance import commit
from validation.common.record import read_records, write_whole
from validation.common.registry import Catalogue, Experiment, nearest
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.common.targets import Target, Targets
from validation.common.verdicts import judged

KEYS = {"target", "value", "unit", "scale", "seconds", "seed", "command", "commit", "date", "cores"}
OPTIONAL = {"comparator", "paper", "note", "bound", "cpu_seconds", "versions", "workers", "origin"}

PRINTED = Target(id="nsf.table1.bread.error", value=1.2, unit="%", what="position error of bread",
                 paper_ref="Table 1", kind="error", comparator="<=", confidence="exact")
TARGETS = Targets({PRINTED.id: PRINTED})


def make(function):
    return Experiment(f"verification.{function.__name__}", "A toy", ("quick",), {"quick": 1.0},
                      function)


def run(folder, *functions, **setting):
    """Run toy experiments; returns the ids that failed, and the results."""
    failed = run_all([make(f) for f in functions], RunSetting("quick", folder, **setting))
    return failed, ProfileResults(folder)


def numbers(results, id):
    return [r for r in results.records(id) if r.target != id]


def test_records_have_the_agreed_keys(tmp_path):
    def fall(run):
        run.record("verification.fall.error", 1e-13, unit="m", paper=0.0, comparator="<=",
                   bound=1e-12, scale="as printed", note="round-off")

    assert run(tmp_path, fall, seed=7, commit="abc")[0] == []
    remark, record = json.loads((tmp_path / "verification.fall.json").read_text())
    assert set(record) >= KEYS
    assert set(record) <= KEYS | OPTIONAL
    assert (record["comparator"], record["value"], record["bound"]) == ("<=", 1e-13, 1e-12)
    assert (record["seed"], record["commit"], record["cores"]) == (7, "abc", os.cpu_count())
    assert record["command"] \
        == "python -m validation run verification.fall --profile quick --seed 7"
    assert (remark["target"], remark["note"]) == ("verification.fall", "A toy")
    assert (remark["comparator"], "origin" in record) == ("remark", False)
    assert set(remark["origin"]) >= {"cpu", "memory_gb", "system", "seal", "load"}


def test_printed_number_is_used(tmp_path):
    def bread(run):
        assert run.record(PRINTED.id, 1.1) == "pass"
        assert run.record(PRINTED.id, 0.5) == "better"
        assert run.record(PRINTED.id, 1.3) == "miss"
        assert run.record(f"{PRINTED.id}.modes", 1.1) == "pass"

    failed, results = run(tmp_path, bread, targets=TARGETS)
    assert failed == []
    stored = {(r.paper, r.unit, r.comparator) for r in numbers(results, "verification.bread")}
    assert stored == {(None, "%", "printed")}


@pytest.mark.parametrize("id", [PRINTED.id, f"{PRINTED.id}.modes"])
@pytest.mark.parametrize(("fields", "fault"), [
    ({"unit": "1"}, "the paper's number is in '%'"),
    ({"paper": 1.3}, "paper given, but the number is printed"),
    ({"comparator": "info"}, "comparator given, but the number is printed: its rule is in "),
    ({"factor": 2.0, "note": "coarser"}, "factor given"),
])
def test_the_rule_of_a_printed_number_is_in_the_target_file_alone(tmp_path, id, fields, fault):
    def bread(run):
        with pytest.raises(ValueError, match=fault):
            run.record(id, 1.0, **fields)

    assert run(tmp_path, bread, targets=TARGETS)[0] == []


def test_a_number_that_repeats_another_is_not_recorded(tmp_path):
    again = msgspec.structs.replace(PRINTED, id="nsf.again", again=PRINTED.id)

    def bread(run):
        with pytest.raises(ValueError, match=f"nsf.again repeats {PRINTED.id}"):
            run.record("nsf.again", 1.0)

    assert run(tmp_path, bread, targets=Targets({**TARGETS, again.id: again}))[0] == []


def test_a_widened_check_says_why(tmp_path):
    def toy(run):
        with pytest.raises(ValueError, match="say why in note="):
            run.record("verification.toy.size", 1.0, comparator="~", paper=1.0, factor=2.0)

    assert run(tmp_path, toy)[0] == []


def test_number_without_paper_needs_a_comparator(tmp_path):
    def toy(run):
        with pytest.raises(ValueError, match="comparator= must be given"):
            run.record("verification.toy.error", 1.0)

    assert run(tmp_path, toy)[0] == []


def test_not_finite_is_a_miss_that_says_so(tmp_path):
    def blown(run):
        run.record("verification.blown.x", math.nan, comparator="<=", bound=1.0, note="at t = 1")

    record, = numbers(run(tmp_path, blown)[1], "verification.blown")
    assert (record.value, judged(record, TARGETS).verdict) == (None, "miss")
    assert record.note == "the run gave nan; at t = 1"


def test_failure_is_reported_and_others_go_on(tmp_path, capsys):
    def broken(run):
        run.record("verification.broken.before", 1.0, comparator="info")
        raise RuntimeError("particle 3 left the domain")

    def sound(run):
        run.record("verification.sound.x", 1.0, comparator="info")

    failed, results = run(tmp_path, broken, sound)
    assert failed == ["verification.broken"]
    *_, before, failure = results.records("verification.broken")
    assert before.target == "verification.broken.before"
    assert (failure.comparator, failure.value) == ("runs", None)
    assert judged(failure, TARGETS).verdict == "miss"
    assert failure.note == "failed: RuntimeError: particle 3 left the domain"
    assert results.value("verification.sound", "verification.sound.x") == 1.0
    assert "Traceback" in capsys.readouterr().err


def test_tables_come_back(tmp_path):
    def curve(run):
        run.table("errors", ["n", "error", "law"], [(16, 1e-3, "a, b"), (32, 2.5e-4, "c")])

    results = run(tmp_path, curve)[1]
    assert results.tables("verification.curve") == ["errors"]
    table = results.table("verification.curve", "errors")
    assert table["error"].tolist() == [1e-3, 2.5e-4]
    assert table["law"].tolist() == ["a, b", "c"]


def test_table_of_an_earlier_run_goes(tmp_path):
    def toy(run):
        run.table("new", ["x"], [[1]])

    for name in ("toy.old", "toy.other.old"):
        (tmp_path / f"verification.{name}.csv").write_text("x\n1\n")
    results = run(tmp_path, toy)[1]
    assert results.tables("verification.toy") == ["new"]
    assert results.tables("verification.toy.other") == ["old"]


@pytest.mark.parametrize(("name", "rows", "said"), [
    ("a.b", [], "lower-case"), ("a", [[1]], "1 entries")])
def test_bad_table_is_refused(tmp_path, name, rows, said):
    def toy(run):
        with pytest.raises(ValueError, match=said):
            run.table(name, ["x", "y"], rows)

    assert run(tmp_path, toy)[0] == []


def test_random_numbers_follow_seed_and_id(tmp_path):
    drawn = {}

    def first(run):
        drawn.setdefault("first", []).append(run.rng.random())

    def second(run):
        drawn.setdefault("second", []).append(run.rng.random())

    for seed in (0, 0, 1):
        run(tmp_path, first, second, seed=seed)
    a, again, other = drawn["first"]
    assert a == again
    assert len({a, other, drawn["second"][0]}) == 3


def test_progress_and_choice(tmp_path):
    def loop(run):
        assert list(run.progress(3, "steps")) == [0, 1, 2]
        assert list(run.progress("ab", "letters")) == ["a", "b"]
        assert run.choose(quick=16, paper=128) == 16
        with pytest.raises(ValueError, match="nothing was given for profile 'quick'"):
            run.choose(paper=128)

    assert run(tmp_path, loop)[0] == []


def test_progress_says_what_is_left(tmp_path, capsys):
    def a(run):
        pass

    def b(run):
        pass

    run(tmp_path, a, b)
    said = capsys.readouterr().err
    assert "[1/2] verification.a: about 1 s, 2 s left in all" in said
    assert "[2/2] verification.b: done in" in said


# Files

def test_write_is_whole_or_not_at_all(tmp_path, monkeypatch):
    file = tmp_path / "a.json"
    write_whole(file, b"old")

    def crash(*_):
        raise OSError("disk gone")

    monkeypatch.setattr(os, "replace", crash)
    with pytest.raises(OSError, match="disk gone"):
        write_whole(file, b"new")
    assert file.read_bytes() == b"old"


def test_damaged_results_are_named(tmp_path):
    file = tmp_path / "verification.toy.json"
    file.write_text('[{"target": "x"}]')
    with pytest.raises(ValueError, match=r"verification\.toy\.json is not a list of records"):
        read_records(file)


def test_missing_results_are_named(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"no results of verification\.toy"):
        ProfileResults(tmp_path).records("verification.toy")


def test_commit_says_whether_the_source_is_changed(tmp_path):
    assert commit(tmp_path) == "unknown"
    git = ["git", "-C", tmp_path, "-c", "user.name=a", "-c", "user.email=a@b.c"]
    (tmp_path / "b.py").touch()
    for arguments in (["init", "-q"], ["add", "b.py"], ["commit", "-q", "-m", "first"]):
        subprocess.run([*git, *arguments], check=True)
    clean = commit(tmp_path)
    assert len(clean) == 12
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "a.json").touch()
    assert commit(tmp_path) == clean
    for arguments in (["add", "results"], ["commit", "-q", "-m", "results"]):
        subprocess.run([*git, *arguments], check=True)
    assert commit(tmp_path) == clean        # of the source, which is the same
    (tmp_path / "a.py").touch()
    assert commit(tmp_path) == clean + "+changes"


# The command line

@pytest.fixture
def invoke(tmp_path, monkeypatch):
    """Run the command line on toy experiments, one of which fails."""
    def sound(run):
        run.record("verification.sound.x", 1.0, paper=2.0, comparator="<=", unit="m")

    def broken(run):
        raise RuntimeError("no")

    toys = {made.id: made for made in map(make, (sound, broken))}
    monkeypatch.setattr(cli, "discover", lambda: Catalogue(toys, {}))
    return lambda *words: CliRunner().invoke(cli.app, [*words])


def test_list(invoke, tmp_path):
    for profile, cost in (("quick", ["1", "s"]), ("paper", ["—", "A"])):
        said = invoke("list", "--profile", profile, "--results", str(tmp_path))
        assert said.exit_code == 0
        header, toy, _, others, last = map(str.split, said.output.splitlines())
        assert header == ["experiment", profile, "title"]
        assert toy[:3] == ["verification.sound", *cost]
        assert others[0] == "—:"
        assert last[:2] == [{"quick": "2", "paper": "0"}[profile], "experiments"]


def test_the_list_has_the_time_of_the_records_of_its_folder(invoke, tmp_path):
    invoke("run", "verification.sound", "--results", str(tmp_path))
    assert "the 1 that have records took" in invoke("list", "--results", str(tmp_path)).output
    assert "records" not in invoke("list", "--results", str(tmp_path / "other")).output


@pytest.mark.parametrize(("content", "fault"), [
    ("[{", "is not a list of records"), ("[]", "has no record")])
def test_a_damaged_record_ends_the_list_with_a_sentence(invoke, tmp_path, content, fault):
    invoke("run", "verification.sound", "--results", str(tmp_path))
    (tmp_path / "quick" / "verification.sound.json").write_text(content)
    said = invoke("list", "--results", str(tmp_path))
    assert said.exit_code == 2
    assert fault in said.stderr


def test_run_writes_results_and_report(invoke, tmp_path):
    said = invoke("run", "verification.sound", "--results", str(tmp_path))
    assert said.exit_code == 0, said.output
    assert {f.name for f in (tmp_path / "quick").iterdir()} \
        == {"verification.sound.json", "report.html", "report.md"}


def test_run_with_a_failure_reports_it_and_exits_1(invoke, tmp_path):
    said = invoke("run", "--results", str(tmp_path))
    assert said.exit_code == 1
    assert "failed: verification.broken" in said.output
    assert "RuntimeError: no" in (tmp_path / "quick" / "report.md").read_text()


def test_unknown_id_is_one_line_and_exit_2(invoke, tmp_path):
    said = invoke("run", "verification.nothing", "--results", str(tmp_path))
    assert said.exit_code == 2
    assert said.output.startswith("no experiment 'verification.nothing'")


@pytest.mark.parametrize(("wanted", "first"), [
    ("fig18", "hot.fig18"), ("HOT.FIG18", "hot.fig18"), ("hot.fgi8", "hot.fig8"),
    ("cantilever", "verification.cantilever"), ("hot.scene", "hot.scenes.twist")])
def test_nearest_ids_are_offered_first(wanted, first):
    ids = ["hot.fig8", "hot.fig18", "hot.fig19", "hot.scenes.twist", "verification.cantilever"]
    assert nearest(wanted, ids)[0] == first
    assert nearest("xyz", ids) == []


def test_report_of_nothing_is_refused(invoke, tmp_path):
    said = invoke("report", "--results", str(tmp_path / "nothing"))
    assert said.exit_code == 2
    assert said.output.startswith(f"no results in {tmp_path / 'nothing' / 'quick'}")
    assert not (tmp_path / "nothing").exists()


def test_broken_module_makes_exit_1(monkeypatch):
    monkeypatch.setattr(cli, "discover", lambda: Catalogue({}, {"a.b": ImportError("no torch")}))
    assert CliRunner().invoke(cli.app, ["list"]).exit_code == 1
