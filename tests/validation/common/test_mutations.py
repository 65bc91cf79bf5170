"""The mutation pass: the list covers all experiments with verdicts, and the tool sees a change."""

import math

import pytest
from typer.testing import CliRunner

from mpm_ref.core.spline import base_of
from mpm_ref.explicit import Scheme
from validation import __main__ as suite
from validation.common import targets
from validation.common.registry import Experiment, discover
from validation.common.results import RESULTS, ProfileResults
from validation.common.run import RunSetting
from validation.common.verdicts import judged
from validation.mutations import listing, patch, table, trial
from validation.mutations.listing import Mutation, MutationList, Without
from validation.mutations.scaling import scaled
from validation.verification import convergence

TOY = "verification.toy"


def toy(run):
    run.record(f"{TOY}.size", convergence.rms([[3.0, 4.0]]), comparator="<=", bound=5.1)
    run.record(f"{TOY}.blind", 1.0, comparator="<=", bound=2.0)
    run.record(f"{TOY}.shown", 1.0, comparator="info")
    run.record(f"{TOY}.missed", 3.0, comparator="<=", bound=2.0)


def toy_of(id):
    return Experiment(id, "A toy", ("quick",), {"quick": 1.0}, toy)


def mutation(where="validation.verification.convergence:rms", **change):
    return Mutation("changed", [TOY], "a toy is changed", where,
                    **(change or {"after": "result = 1.1 * result"}))


def judged_experiments():
    """Ids of the experiments with a quick version of which a committed record has a verdict."""
    printed, found = targets.load(), set()
    for profile in ("standard", "paper"):
        results = ProfileResults(RESULTS / profile)
        for id in results.ids():
            verdicts = (judged(record, printed) for record in results.records(id))
            if any(v.kind != "remark" and any(map(math.isfinite, v.interval)) for v in verdicts):
                found.add(id)
    return sorted(id for id, e in discover().experiments.items()
                  if id in found and "quick" in e.profiles)


def test_the_list_covers_each_experiment_with_verdicts():
    assert listing.unlisted(listing.load(), judged_experiments()) == []


def test_a_pattern_that_matches_no_experiment_and_an_id_without_mutation_are_found():
    mutations = MutationList([mutation()], [Without(["hot.*"], "a reason")])
    assert listing.unlisted(mutations, [TOY, "hot.fig7", "ldm.fig4"]) == ["ldm.fig4"]
    assert listing.unused(mutations, [TOY]) == ["hot.*"]
    assert listing.unused(listing.load(), discover().experiments) == []


def test_the_committed_table_has_each_experiment_of_the_list_and_none_survives_without_a_reason():
    mutations, rows = listing.load(), table.read()
    listed = {id for id, e in discover().experiments.items()
              if "quick" in e.profiles and mutations.mutations_of(id)}
    assert set(rows) <= listed
    survivors = {id for id, row in rows.items() if row.checks and not row.broken}
    assert {id for id in {*(listed - set(rows)), *survivors}
            if not mutations.reason_without(id)} == set()
    assert [id for id, row in rows.items() if row.broken and mutations.reason_without(id)] == []


def test_all_mutations_of_the_list_name_what_exists_and_kernels_see():
    discover()
    for one in listing.load().mutation:
        owner, name = patch.owner_of(one)
        patch.require_uncompiled(one, getattr(owner, name))


def test_the_tool_sees_which_verdicts_change(tmp_path):
    setting = RunSetting("quick", tmp_path / "sound")
    broken = setting._replace(folder=tmp_path / "broken")
    assert trial.run_in_new_process([TOY], setting, find=toy_of) == []
    assert trial.run_in_new_process([TOY], broken, mutation(), toy_of) == []
    outcome = trial.compare(TOY, mutation(), setting.folder, broken.folder, setting.targets)
    assert outcome.passing == {f"{TOY}.size", f"{TOY}.blind"}
    assert outcome.broken == {f"{TOY}.size"}
    assert not outcome.raised
    row = table.row_of([outcome], "abc")
    assert (row.mutations, row.checks, row.broken, row.unbroken) == ("changed", 2, 1, "blind")
    table.write(tmp_path / "table.csv", [row])
    assert table.read(tmp_path / "table.csv") == {TOY: row}
    assert convergence.rms([[3.0, 4.0]]) == 5.0        # this process is sound


def test_an_experiment_that_raises_is_no_changed_verdict(tmp_path):
    setting = RunSetting("quick", tmp_path / "sound")
    broken = setting._replace(folder=tmp_path / "broken")
    trial.run_in_new_process([TOY], setting, find=toy_of)
    raising = mutation(after="raise ArithmeticError('no size')")
    assert trial.run_in_new_process([TOY], broken, raising, toy_of) == [TOY]
    outcome = trial.compare(TOY, raising, setting.folder, broken.folder, setting.targets)
    assert outcome.raised
    assert not outcome.broken
    assert "changed (raised)" in table.row_of([outcome], "abc").without_effect


def test_a_row_is_merged_with_what_other_mutations_broke():
    first = table.Row(TOY, "a", "b (raised)", 3, 1, "y; z", "1", "2026-01-01")
    second = table.Row(TOY, "c", "d", 3, 1, "x; z", "2", "2026-01-02")
    assert table.merged(None, second) == second
    assert table.merged(first, second) == table.Row(
        TOY, "a; c", "b (raised); d", 3, 2, "z", "2", "2026-01-02")


def test_what_kernels_hold_a_copy_of_is_refused():
    for where in ("mpm_ref.core.spline:base_of", "mpm_ref.core.spline:STENCILS_OF_NOTHING"):
        with pytest.raises(ValueError, match=r"kernels hold a copy|has no attribute"):
            patch.apply(mutation(where, value="None"))
    assert hasattr(base_of, "py_func")


def test_before_after_and_value_change_calls(monkeypatch):
    monkeypatch.setattr(convergence, "rms", convergence.rms)
    assert patch.replacement(mutation(before="a = 2.0 * a"), lambda a: a)(1.0) == 2.0
    assert patch.replacement(mutation(after="result = result + a"), lambda a: a)(1.0) == 2.0
    assert patch.replacement(mutation(value="lambda a: 3.0 * old(a)"), abs)(-1.0) == 3.0
    with pytest.raises(ValueError, match="give one of before, after and value"):
        mutation(before="a = 1", after="result = 1")


def test_records_are_scaled_within_but_for_dimensions():
    assert scaled((1.0, (2.0, 3)), 2.0) == (2.0, (4.0, 3))
    assert scaled(Scheme(), 2.0) == Scheme()


def test_a_wrong_list_is_refused_in_a_sentence(tmp_path):
    file = tmp_path / "mutations.toml"
    file.write_text('[[mutation]]\nname = "a"\nexperiments = []\nbreaks = ""\nwhere = ""\nof = 1')
    with pytest.raises(ValueError, match=r"mutations\.toml: .*`of`"):
        listing.load(file)


def test_the_command_is_one_of_the_suite():
    told = CliRunner().invoke(suite.app, ["mutate", "--help"])
    assert told.exit_code == 0
    assert "Break the subject" in told.output
