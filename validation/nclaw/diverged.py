"""What is kept of a training that diverged: its errors, and how it ended; a file beside the weights
that it would have made.
"""

import json

from ..common.record import write_whole
from . import trained_laws


def keep(weights, about):
    """Write plain values of a training, whole or not at all; weights: the file that there is not.
    Returns the path.
    """
    path = beside(weights)
    write_whole(path, (json.dumps(about, indent=1) + "\n").encode())
    return path


def beside(weights):
    """The path that belongs to a file of weights."""
    return weights.with_suffix(trained_laws.DIVERGED)


def diverged(name, now):
    """What is known of a training that diverged, by its name and `identity`: plain values, "errors"
    of its epochs and "stopped", a sentence; None where nothing is kept. Raises ValueError for a
    file that cannot be read, or of another training or another scene.
    """
    path = beside(trained_laws.FOLDER / f"{name}.npz")
    if not path.exists():
        return None
    again = f"python -m validation.training.nclaw {name}"
    try:
        about = json.loads(path.read_text())
    except ValueError as fault:
        raise ValueError(f"{path.name} is damaged: {fault}; {again}") from None
    was = {key: about.get(key) for key in now}
    if was != now:
        raise ValueError(f"{path.name} is of {was}, now it is {now}: {again}")
    return about
