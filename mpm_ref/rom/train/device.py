"""Where a training computes: on the processor, or on a graphics processor if PyTorch finds one.

Random numbers are always drawn on the processor, so that a training is shown the same points
everywhere; what is computed of them differs in rounding.
"""

import torch

from ...training import DEVICES


def device_of(name):
    """The `torch.device` of a name in DEVICES. Raises ValueError for others, and for a graphics
    processor that PyTorch does not find.
    """
    if name not in DEVICES:
        raise ValueError(f"device {name!r}: expected one of {', '.join(DEVICES)}")
    if name == "cuda" and not torch.cuda.is_available():
        raise ValueError('device "cuda": PyTorch finds no graphics processor here; expected "cpu", '
                         "or a build of PyTorch with CUDA on a machine that has one")
    return torch.device(name)
