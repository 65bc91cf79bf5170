"""The parts of the package that learn, which alone need PyTorch: imported when asked for."""

from importlib import import_module
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
