"""Laws that go on with longer horizons: what is recorded of them."""

from types import SimpleNamespace

import numpy as np
import pytest

from mpm_ref.materials.learned.weights import LearnedLaws
from validation.nclaw import longer_horizons
from validation.nclaw.errors import ErrorRow
from validation.nclaw.longer_horizons import STARTS, by_kind, longer_nets, record_task
from validation.nclaw.trained_laws import file_digest, identity, nets

ROWS = [ErrorRow(method, "water", "velocity", draw, error, -1, "")
        for method, own in {"ours": (1.0, 3.0), "ours-seed-1": (8.0, 8.0),
                            "ours-seed-2": (5.0, 1.0),
                            "longer": (1e-4, 1e-4), "longer-seed-1": (np.inf, 1e-4),
                            "longer-seed-2": (2e-4, 2e-4), "admissible": (4.0, 4.0),
                            "admissible longer": (1e-6, 3e-6)}.items()
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
    assert sorted(net.seed for net in longer_nets().values()) == [*8 * [0], 1, 2]


def test_laws_that_went_on_from_other_weights_are_refused(monkeypatch):
    laws = LearnedLaws(None, None, {"start_sha256": file_digest("water")})
    monkeypatch.setattr(longer_horizons, "stored", lambda name, expected: laws)
    assert longer_horizons.longer_laws.__wrapped__("water-longer") is laws
    with pytest.raises(ValueError, match=r"water-seed-1-longer.npz goes on from other weights"):
        longer_horizons.longer_laws.__wrapped__("water-seed-1-longer")


def test_identities_of_other_trainings_stay():
    assert not {"first", "last", "start"} & {*identity(nets()["water"])}


def test_errors_are_means_over_draws_for_each_seed():
    assert by_kind(ROWS) == {"ours": [2.0, 8.0, 3.0], "longer": [1e-4, np.inf, 2e-4],
                             "admissible": [4.0], "admissible longer": [2e-6]}


@pytest.mark.parametrize(("profile", "rules"), [("standard", [("<=", 1.9e-5), ("<=", 1.0)]),
                                                ("quick", [("<=", 1.9e-5), ("info", None)])])
@pytest.mark.parametrize(("method", "id", "after", "before"), [
    ("ours", "nclaw.longer.water.velocity", 2e-4, 3.0),
    ("admissible", "nclaw.longer.admissible.water.velocity", 2e-6, 4.0)])
def test_medians_stand_beside_the_printed_error(profile, rules, method, id, after, before):
    found = {}
    run = SimpleNamespace(profile=profile, record=lambda name, value, **rule: found.update(
        {name: (value, rule["comparator"], rule.get("bound"))}))
    record_task(run, ("water", "velocity"), method, by_kind(ROWS))
    assert found == {id: (pytest.approx(after), *rules[0]),
                     f"{id}.ratio": (pytest.approx(after / before), *rules[1])}
