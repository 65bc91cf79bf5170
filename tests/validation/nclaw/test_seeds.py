"""Trainings that differ by their seed alone, and what is recorded of them."""

from types import SimpleNamespace

import pytest

from validation.nclaw.seeds import laws_by_seed, record_task, seed_nets
from validation.nclaw.trained_laws import identity, nets


def test_trainings_differ_by_their_seed_alone():
    found = seed_nets()
    assert len(found) == 8 + 3 * 3 + 4 * 3
    for name, net in found.items():
        first, _, seed = name.partition("-seed-")
        assert net == nets()[first]._replace(seed=int(seed or 0))
        if name in nets():
            assert identity(net) == identity(nets()[name])


def test_laws_are_sorted_by_method_and_seed():
    laws = dict.fromkeys(("water", "jelly", "water-seed-5", "jelly-admissible-seed-1"), "laws")
    assert laws_by_seed(laws) == {"ours": {"water": "laws", "jelly": "laws"},
                                  "ours-seed-5": {"water": "laws"},
                                  "admissible-seed-1": {"jelly": "laws"}}


@pytest.mark.parametrize(("profile", "rule"), [("standard", ("<=", 1.9e-5)),
                                               ("quick", ("info", None))])
def test_median_of_seeds_stands_beside_the_printed_error(profile, rule):
    found = {}
    run = SimpleNamespace(profile=profile, record=lambda name, value, **rest: found.update(
        {name: (value, rest["comparator"], rest.get("bound"))}))
    record_task(run, ("water", "velocity"), "admissible", [1e-6, 8e-6, 2e-6])
    id = "nclaw.seeds.admissible.water.velocity"
    assert found == {id: (2e-6, *rule), f"{id}.spread": (pytest.approx(8.0), "info", None)}
    record_task(run, ("water", "velocity"), "admissible", [1e-6, 8e-6])
    assert found[id] == (4.5e-6, "info", None)      # a seed is missing


@pytest.mark.parametrize("errors", [[1e-6, float("inf"), 2e-6, 2e-6], [2e-6]])
def test_there_is_no_spread_of_one_seed_nor_where_one_breaks_down(errors):
    found = {}
    run = SimpleNamespace(profile="standard",
                          record=lambda name, value, **rest: found.update({name: value}))
    record_task(run, ("water", "velocity"), "ours", errors)
    assert found == {"nclaw.seeds.ours.water.velocity": 2e-6}
