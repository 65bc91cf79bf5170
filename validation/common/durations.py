"""Times of a whole profile: what its experiments should take, and what those that ran took."""

from typing import NamedTuple

HOUR = 3600.0   # [s]


class Durations(NamedTuple):
    """Times of the experiments of a profile."""

    count: int          # of experiments
    budget: float       # wall time that they may take, one after the other [s]
    stored: int         # of those that have records
    cpu: float          # time of these on all their threads [s]
    wall: float         # the same by the clock, other work included [s]

    @property
    def sentence(self):
        """The times in words."""
        text = f"{self.count} experiments with budgets of {hours(self.budget)} in all"
        if not self.stored:
            return text
        return (f"{text}; the {self.stored} that have records took {hours(self.cpu)} of CPU time, "
                f"{hours(self.wall)} by the clock")


def hours(seconds):
    """Return a time in words."""
    minutes = round(seconds / 60.0, 1)
    return f"{seconds / HOUR:.1f} h" if minutes >= 60.0 else f"{minutes:.1f} min"


def durations(experiments, stored, profile):
    """Return the `Durations` of experiments that run at a profile; stored: its
    `ProfileResults`.
    """
    own = [e for e in experiments if profile in e.profiles]
    ids = set(stored.ids())
    first = [stored.records(e.id)[0] for e in own if e.id in ids]
    return Durations(len(own), sum(e.seconds(profile) for e in own), len(first),
                     sum(one.cpu_seconds for one in first), sum(one.seconds for one in first))
