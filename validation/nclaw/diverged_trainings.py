"""Trainings that diverged: what experiments record of them."""

from .trained_laws import diverged
from .trained_laws import identity as identity_of_laws


def diverged_trainings(all_nets, identity=identity_of_laws):
    """Return {name: plain values, as of `diverged`} of those trainings {name: net} that diverged.
    identity: as `trained_laws.identity`, of such nets.
    """
    found = {name: diverged(name, identity(net)) for name, net in all_nets.items()}
    return {name: about for name, about in found.items() if about is not None}


def record_epochs(run, target, about, epochs):
    """Record after how many of so many epochs a training diverged; about: as of `diverged`."""
    run.record(f"{target}.epochs", len(about["errors"]), unit="epochs", comparator="info",
               scale=f"of {epochs} epochs", note=f"the training diverged: {about['stopped']}")
