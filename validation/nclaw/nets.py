"""The trained laws of NCLaw's experiments: which there are, and where they stand.

Each is a file of weights, remade by `python -m validation.nclaw.train NAME`.
"""

import hashlib
from functools import cache
from pathlib import Path
from typing import NamedTuple

from mpm_ref.nclaw.weights import load
from mpm_ref.scene.text import canonical

from .environments import ENVIRONMENTS, environment

FOLDER = Path(__file__).parent / "weights"


class Net(NamedTuple):
    """What is trained on an environment, and how."""

    environment: str
    elastic: str = "Stress"         # kind of answer, of `nclaw.response`
    plastic: str = "Correction"
    epochs: int = 300
    reading: str = "release"        # of `nclaw.learn.recipe`
    seed: int = 0


def nets():
    """{name: `Net`} of all experiments."""
    return {name: Net(name) for name in ENVIRONMENTS}


@cache
def trained(name):
    """`nclaw.weights.Laws` by name. Raises ValueError where they are missing, damaged, or of
    another training or another scene than `nets` says now.
    """
    path, again = FOLDER / f"{name}.npz", f"python -m validation.nclaw.train {name}"
    if not path.exists():
        raise ValueError(f"no weights {path.name}: {again}")
    laws, now = load(path), identity(nets()[name])
    was = {key: laws.about.get(key) for key in now}
    if was != now:
        raise ValueError(f"weights {path.name} are of {was}, now it is {now}: {again}")
    return laws


def identity(net):
    """What a training is of, plain values."""
    text = canonical(environment(net.environment))
    return {"scene": hashlib.sha256(text.encode()).hexdigest()[:16], **net._asdict()}
