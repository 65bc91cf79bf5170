"""The tables "which model" are computed from records: training is shared by the runs, a method
that broke down is never the nearest, and none beyond the error is the cheapest.
"""

import sys
from math import inf

import pytest

from validation.common.citations import ROOT
from validation.common.results import RESULTS, ProfileResults

sys.path.insert(0, str(ROOT / "docs"))

from extensions import which_model


def method(name, error, run, fit=0.0, data=0.0, pairs=0.0):
    """A row of the table of `trade.reduced`."""
    return {"method": name, "error": error, "cpu_run": run, "cpu_fit": fit, "cpu_data": data,
            "cpu_pairs": pairs}


FULL, COARSE = method("full.apic", 0.0, 8.0), method("coarse.2.mls", 0.03, 2.0)
REDUCED = method("pod.few", 0.01, 1.0, fit=100.0, data=150.0, pairs=50.0)
ALL = [FULL, COARSE, REDUCED]


def test_training_is_shared_by_the_runs():
    assert which_model.cost(REDUCED, 100) == 4.0
    assert which_model.cheapest_text(ALL, 100, 0.01) == "**LDM, 50 samples**: 4 s"
    assert which_model.cheapest_text(ALL, 10, 0.01) == "full: 8 s"


def test_a_method_beyond_the_error_is_not_the_cheapest():
    assert which_model.cheapest_text(ALL, 1000, 0.03) == "**LDM, 50 samples**: 1.3 s"
    assert which_model.cheapest_text(ALL, 1000, 0.005) == "full: 8 s"
    assert which_model.cheapest_text(ALL, 100, 0.03) == "grid x 2, MLS-MPM: 2 s"


def test_methods_as_cheap_are_named_together():
    near = method("coarse.4.apic", 0.03, 2.1)
    assert which_model.cheapest_text([*ALL, near], 100, 0.03) == (
        "grid x 2, MLS-MPM or grid x 4: 2 s")


def test_recorded_methods_have_their_names():
    results = ProfileResults(RESULTS / "standard")
    names = {which_model.reduced_name(row["method"])
             for row in which_model.records(results, "trade.reduced", "methods")}
    assert names >= {"full, MLS-MPM", "grid x 1.25", "**grid x 4, corrected**",
                     "**LDM, curved map**"}


def test_the_mean_of_draws_counts_unless_one_broke_down():
    assert which_model.mean_of({0: 3.0, 1: 1.0, 2: 5.0}) == 3.0
    assert which_model.mean_of({0: 3.0, 1: inf, 2: 2.0}) == inf


def test_the_smallest_error_is_marked_and_no_breakdown():
    texts = [*which_model.marked({"admissible": 2e-5, "ours": 1e-5, "neural": inf})]
    assert texts == ["2.0e-05", "—", "**1.0e-05**", "—", "—", "breaks down", "—"]
    assert "**" not in "".join(which_model.marked({"neural": inf}))


def test_laws_are_ranked_by_printed_errors():
    table = {("jelly", "time"): {"ours": 2.0, "neural": inf},
             ("sand", "time"): {"ours": 2.0, "neural": 1.0}}
    printed = {("jelly", "time"): 1.0, ("sand", "time"): 4.0}
    assert which_model.rank("ours", table, printed) == (0, pytest.approx(1.0), 2.0, 1, 2, "ours")
    assert which_model.rank("neural", table, printed) == (1, inf, inf, 1, 2, "neural")


def test_all_laws_are_ranked_on_the_same_tasks():
    _, _, *rows, end = which_model.law_ranks(ProfileResults(RESULTS / "standard"))
    assert end == ""
    assert len(rows) == len(which_model.LAWS)
    assert {row.split("|")[2].strip() for row in rows} == {"12"}
