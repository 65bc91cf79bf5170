"""Laws that go on with longer horizons: what is recorded of them."""

from types import SimpleNamespace

import numpy as np
import pytest

from validation.nclaw.errors import ErrorRow
from validation.nclaw.longer_horizons import STARTS, by_method, longer_nets, record_task, seed_of
from validation.nclaw.trained_laws import identity, nets

ROWS = [ErrorRow(method, "water", "velocity", draw, error, -1, "")
        for method, own in {"ours": (1.0, 3.0), "ours-seed-1": (8.0, 8.0),
                            "ours-seed-2": (5.0, 1.0),
                            "longer": (1e-4, 1e-4), "longer-seed-1": (np.inf, 1e-4),
                            "longer-seed-2": (2e-4, 2e-4)}.items()
        for draw, error in enumerate(own)]


def test_each_goes_on_from_weights_of_its_environment_and_seed():
    for name, net in longer_nets().items():
        printed = nets()[net.start]
        assert (printed.environment, printed.seed) == (net.environment, net.seed)
        assert (net.elastic, net.plastic, printed.method) == (
            printed.elastic, printed.plastic, net.method)
        assert name not in nets()
        assert identity(net)["start"] == net.start
    assert len(longer_nets()) == len(STARTS)
    assert sorted(map(seed_of, STARTS)) == [0, 0, 0, 0, 1, 2]


def test_identities_of_other_trainings_stay():
    assert not {"first", "last", "start"} & {*identity(nets()["water"])}


def test_errors_are_means_over_draws_for_each_seed():
    assert by_method(ROWS) == {"ours": [2.0, 8.0, 3.0], "longer": [1e-4, np.inf, 2e-4]}


@pytest.mark.parametrize(("profile", "rules"), [("standard", [("<=", 1.9e-5), ("<=", 1.0)]),
                                                ("quick", [("<=", 1.9e-5), ("info", None)])])
def test_medians_stand_beside_the_printed_error(profile, rules):
    found = {}
    run = SimpleNamespace(profile=profile, record=lambda name, value, **rule: found.update(
        {name: (value, rule["comparator"], rule.get("bound"))}))
    record_task(run, "water", "velocity", by_method(ROWS))
    start = "nclaw.longer.water.velocity"
    assert {name: value for name, (value, *_) in found.items()} == {
        start: 2e-4, f"{start}.ratio": pytest.approx(2e-4 / 3.0)}
    assert [rule[0] for _, *rule in found.values()] == [rule[0] for rule in rules]
    assert found[f"{start}.ratio"][2] == rules[1][1]
    assert found[start][2] == rules[0][1]
