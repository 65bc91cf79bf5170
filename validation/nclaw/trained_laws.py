"""The trained laws of NCLaw's experiments: which there are, and where they stand.

Each is a file of weights, remade by `python -m validation.training.nclaw NAME`.
"""

import hashlib
from functools import cache
from pathlib import Path
from typing import NamedTuple

from mpm_ref.materials.learned import weights
from mpm_ref.nclaw.gnn import weights as of_graphs
from mpm_ref.scene.toml import canonical

from ..common.weights_needed import Untrained
from .environments import ENVIRONMENTS, environment
from .simulators import GraphNet, simulators

FOLDER = Path(__file__).parent / "weights"
DIVERGED = ".diverged.json"     # beside weights that there are not


class Net(NamedTuple):
    """What is trained on an environment, and how."""

    environment: str
    elastic: str = "Stress"         # kind of answer, of `learned.response`
    plastic: str = "Correction"
    epochs: int = 300
    reading: str = "release"        # of `nclaw.train.recipe`
    seed: int = 0
    method: str = "ours"            # of `nclaw.train.methods`
    elastic_rate: float = 1.0
    plastic_rate: float = 0.1
    velocity: float = 0.0           # weight of velocities in the loss [s^2]


# Told where they are not as by default.
LATER = ("method", "elastic_rate", "plastic_rate", "velocity")
KNOWN = {       # environment -> its law and flow; fluids keep F = J^(1/3) I
    "jelly": ("FixedCorotated", "NoFlow"), "sand": ("Hencky", "DruckerPrager"),
    "plasticine": ("Hencky", "VonMises"), "water": ("Fluid", "FluidProjection")}
PLAIN = {"elastic": "PlainStress", "plastic": "PlainCorrection"}
SEEDS = (1, 2)              # beside 0
SPEED_WEIGHT = 1e-4         # [s^2], ours: an error of 1 m/s counts as one of 0.01 m
LABELED = {"epochs": 30, "elastic_rate": 0.1, "plastic_rate": 0.1}
ADMISSIBLE = {"elastic": "Energetic", "plastic": "Contraction", "method": "admissible",
              "elastic_rate": 0.1, "plastic_rate": 0.01}


def nets():
    """{name: `Net` or `GraphNet`} of all experiments."""
    return {
        **{name: Net(name) for name in ENVIRONMENTS},
        **{f"{name}-{method}": net for name in ENVIRONMENTS for method, net in others(name)},
        **simulators(),
        **{f"{name}-seed-{seed}": Net(name, seed=seed) for name in ENVIRONMENTS for seed in SEEDS},
        "plasticine-no-rotation": Net("plasticine", **PLAIN, method="no rotation"),
        "water-velocity": Net("water", velocity=SPEED_WEIGHT),
        "plasticine-no-undeformed": Net("plasticine", method="no undeformed")}


def weights_of(method, name):
    """The name in `nets` of what a method trains on an environment, its first seed and one run."""
    return name if method == "ours" else f"{name}-{method}"


def others(name):
    """(method, `Net`) of what is compared with ours on an environment."""
    law, flow = KNOWN[name]
    yield "spline", Net(name, "SplineStress", "NoFlow", method="spline")
    yield "spline-released", Net(name, "ReleasedSplineStress", "NoFlow", method="spline")
    yield "neural", Net(name, "StretchStress", "NoFlow", method="neural")
    yield "neural-released", Net(name, "ReleasedStretchStress", "NoFlow", method="neural")
    yield "labeled", Net(name, **LABELED, method="labeled")
    yield "sys-id", Net(name, law, flow, method="sys-id", elastic_rate=0.1)
    yield "admissible", Net(name, **ADMISSIBLE)


@cache
def trained(name):
    """`LearnedLaws` by name, or `nclaw.gnn.simulator.Simulator`. Raises `Untrained` where
    they are missing, ValueError where they are damaged, or of another training or another scene
    than `nets` says now.
    """
    net = nets()[name]
    return stored(name, identity(net), (of_graphs if isinstance(net, GraphNet) else weights).load)


def stored(name, now, load=weights.load):
    """What a file of weights holds, by its name; now: the `identity` that it must have. Raises as
    `trained`.
    """
    path, again = FOLDER / f"{name}.npz", f"python -m validation.training.nclaw {name}"
    if not path.exists():
        gone = path.with_suffix(DIVERGED)
        why = f"its training diverged ({gone.name}); to try again: " if gone.exists() else ""
        raise Untrained(f"no weights {path.name}: {why}{again}")
    laws = load(path)
    was = {key: laws.about.get(key) for key in now}
    if was != now:
        raise ValueError(f"weights {path.name} are of {was}, now it is {now}: {again}")
    return laws


def identity(net):
    """What a training is of, plain values."""
    told = {name: value for name, value in net._asdict().items()
            if name not in LATER or value != Net._field_defaults[name]}
    return {"scene": named(environment(net.environment)), **told}


def named(scene):
    """A scene as a few digits of its hash."""
    return hashlib.sha256(canonical(scene).encode()).hexdigest()[:16]
