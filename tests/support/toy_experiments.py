"""Experiments for tests that run them in other processes."""

import os

from validation.common.registry import Experiment


def fall(run):
    for k in run.progress(3, "heights"):
        run.record(f"verification.fall.{k}", float(run.rng.random()), comparator="info")
    run.table("heights", ("h",), [(1.0,)])


def breaks(run):
    raise ArithmeticError("no ground")


def dies(run):
    os._exit(3)


def toy(id):
    """The experiment of an id."""
    function = globals()[id.removeprefix("verification.")]
    return Experiment(id, "A toy", ("quick",), {"quick": 1.0}, function)


def toys(*names):
    return [toy(f"verification.{name}") for name in names]
