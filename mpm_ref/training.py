"""What all trainings share: PyTorch on demand, the device, time taken, and checkpoints.

PyTorch is imported when it is asked for. A training that is cut off goes on from its checkpoint.
"""

from importlib import import_module
from pathlib import Path
from time import perf_counter, process_time
from typing import NamedTuple

DEVICES = "cpu", "cuda"


class Machine(NamedTuple):
    """What a training runs on."""

    threads: int = 1        # of PyTorch
    device: str = "cpu"     # of DEVICES


def part(name, what, instead):
    """The module mpm_ref.NAME, which imports torch.

    Raises ValueError without PyTorch; in words, what: that needs it, instead: that goes without.
    """
    try:
        return import_module(f"mpm_ref.{name}")
    except ModuleNotFoundError as fault:
        if fault.name != "torch":
            raise
        raise ValueError(f"{what} with PyTorch, which is not installed: pip install "
                         '"mpm_ref[learn]", or `make learn` in the repository; '
                         f"{instead}") from None


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


def train_epochs(session, epochs, every, checkpoint=None, on_epoch=None):
    """Return the session, trained up to a number of epochs.

    A session has a `history` with an entry for each epoch, `epoch()`, `save(path)` and
    `load(path)`: it knows how its weights become bytes. checkpoint: a file to go on from, and to
    save to every `every` epochs; on_epoch(history) is called after each epoch. Raises ValueError
    where the folder of the checkpoint is missing.
    """
    path = None if checkpoint is None else Path(checkpoint)
    if path is not None and not path.parent.is_dir():
        raise ValueError(f"{path}: there is no folder {path.parent}; create it or name another one")
    if path is not None and path.exists():
        session.load(path)
    while len(session.history) < epochs:
        session.epoch()
        if path is not None and len(session.history) % every == 0:
            session.save(path)
        if on_epoch is not None:
            on_epoch(session.history)
    return session
