"""Verdicts on records in tests, by the rules of the papers' printed numbers."""

from functools import cache

from validation.common import targets
from validation.common.verdicts import judged

printed = cache(targets.load)


def verdict(record):
    """Return the verdict on a record."""
    return judged(record, printed()).verdict


def expected(record):
    """Return the printed value beside a record, or the value that a check of our own expects."""
    target = judged(record, printed()).target
    return target.value if target else record.paper
