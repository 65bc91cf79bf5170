"""What a training takes, in however many parts it is made."""

from time import perf_counter, process_time
from typing import NamedTuple


class Cost(NamedTuple):
    """Time taken."""

    cpu: float          # [s], of all threads
    wall: float         # [s]


class Meter:
    """Measures from its making on, and adds what parts before took."""

    def __init__(self):
        self.before, self.start = Cost(0.0, 0.0), clocks()

    @property
    def total(self):
        """`Cost` up to now."""
        return Cost(*(a + now - start for a, now, start in
                      zip(self.before, clocks(), self.start, strict=True)))


def clocks():
    """Readings of the two clocks."""
    return Cost(process_time(), perf_counter())
