"""Bundles of small trainings, and what an experiment hands out and takes."""

from types import SimpleNamespace

from validation.nclaw.bundle import Bundle
from validation.nclaw.initial_laws import untrained


class Records(dict):
    """What an experiment records: {target: (value, note)}."""

    experiment, profile = SimpleNamespace(id="trade.nclaw.x"), "standard"

    def record(self, target, value, note="", **rule):
        self[target] = value, note

    def table(self, name, columns, rows):
        self[name] = columns, rows

    def choose(self, **by_profile):
        return by_profile[self.profile]

    def progress(self, some, words=""):
        return some


def known(about=None, epochs=(10, 100)):
    """A `Bundle` of untrained laws, of which this is known."""
    laws = untrained()
    return Bundle({k: laws._replace(about={"seen": {"low": [0.9], "high": [1.1]}, "dt": k * 1e-5})
                   for k in epochs}, about or {})
