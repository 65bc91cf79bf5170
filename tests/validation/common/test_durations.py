"""How long the experiments of a profile take in all."""

from validation.common.durations import Durations, durations, hours
from validation.common.registry import Experiment


class Stored:
    """Records of one experiment."""

    def ids(self):
        """Of experiments with records."""
        return ["a.b", "a.gone"]

    def records(self, id):
        """Of an experiment: the time stands in each."""
        return [type("Record", (), {"cpu_seconds": 90.0, "seconds": 60.0})] * 2


def test_times_are_those_of_the_experiments_of_the_profile():
    toys = [Experiment("a.b", "", ("quick", "standard"), {"standard": 100.0}, None),
            Experiment("a.c", "", ("standard",), {}, None),
            Experiment("a.d", "", ("quick",), {}, None)]
    found = durations(toys, Stored(), "standard")
    assert found == Durations(2, 700.0, 1, 90.0, 60.0)
    assert found.sentence == ("2 experiments with budgets of 11.7 min in all; the 1 that have "
                              "records took 1.5 min of CPU time, 1.0 min by the clock")


def test_a_record_of_another_experiment_does_not_count():
    found = durations([Experiment("a.c", "", ("standard",), {}, None)], Stored(), "standard")
    assert (found.stored, found.cpu) == (0, 0.0)


def test_long_times_are_in_hours():
    assert [hours(s) for s in (30.0, 3599.0, 9000.0)] == ["0.5 min", "1.0 h", "2.5 h"]


def test_without_records_the_times_are_those_expected():
    found = Durations(198, 3600.0, 0, 0.0, 0.0)
    assert found.sentence == "198 experiments with budgets of 1.0 h in all"
