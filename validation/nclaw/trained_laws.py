"""The trained laws of NCLaw's experiments: their settings, and their stored weights.

Each is a file of weights, remade by `python -m validation.training.nclaw NAME`. Of a training that
diverged, a file in place of the weights has its errors and the reason.
"""

import hashlib
import json
from functools import cache
from pathlib import Path
from typing import NamedTuple

from mpm_ref.materials.learned import weights
from mpm_ref.nclaw.gnn import weights as gnn_weights
from mpm_ref.scene.toml import canonical

from ..common.record import write_whole
from ..common.weights_needed import load_weights, require_identity
from .environments import ENVIRONMENTS, environment
from .simulators import GraphNet, simulators

FOLDER = Path(__file__).parent / "weights"
COMMAND = "python -m validation.training.nclaw"
DIVERGED = ".diverged.json"     # in place of weights


class LawNet(NamedTuple):
    """Settings of the training of laws on an environment."""

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
    first: int = 25                 # horizon of the teacher [steps]
    last: int = 200
    idempotence: float = 0.0        # weight of a second return in the loss [m^2]
    start: str = ""                 # name of the weights from which it goes on; "": drawn


# Part of the identity where they are not as by default.
LATER = ("method", "elastic_rate", "plastic_rate", "velocity", "first", "last", "idempotence",
         "start")
TRUE_LAWS = {   # environment -> its law and flow; fluids keep F = J^(1/3) I
    "jelly": ("FixedCorotated", "NoFlow"), "sand": ("Hencky", "DruckerPrager"),
    "plasticine": ("Hencky", "VonMises"), "water": ("Fluid", "FluidProjection")}
PLAIN = {"elastic": "PlainStress", "plastic": "PlainCorrection"}
SEEDS = (1, 2)              # beside 0
SPEED_WEIGHT = 1e-4         # [s^2], ours: an error of 1 m/s counts as one of 0.01 m
LABELED = {"epochs": 30, "elastic_rate": 0.1, "plastic_rate": 0.1}
ADMISSIBLE = {"elastic": "Energetic", "plastic": "Contraction", "method": "admissible",
              "elastic_rate": 0.1, "plastic_rate": 0.01}


def nets():
    """Return {name: `LawNet` or `GraphNet`} of all experiments."""
    return {**{name: LawNet(name) for name in ENVIRONMENTS}, **{f"{name}-{method}": net
                                                                for name in ENVIRONMENTS for method,
                                                                net in compared_nets(name)},
            **simulators(), **{f"{name}-seed-{seed}": LawNet(name, seed=seed)
                               for name in ENVIRONMENTS for seed in SEEDS},
            "plasticine-no-rotation": LawNet("plasticine", **PLAIN, method="no rotation"),
            "water-velocity": LawNet("water", velocity=SPEED_WEIGHT),
            "plasticine-no-undeformed": LawNet("plasticine", method="no undeformed")}


def weights_of(method, name):
    """Return the name in `nets` of a method's first training on an environment."""
    return name if method == "ours" else f"{name}-{method}"


def compared_nets(name):
    """Yield (method, `LawNet`) of the trainings that are compared with ours on an environment."""
    law, flow = TRUE_LAWS[name]
    yield "spline", LawNet(name, "SplineStress", "NoFlow", method="spline")
    yield "spline-released", LawNet(name, "ReleasedSplineStress", "NoFlow", method="spline")
    yield "neural", LawNet(name, "StretchStress", "NoFlow", method="neural")
    yield "neural-released", LawNet(name, "ReleasedStretchStress", "NoFlow", method="neural")
    yield "labeled", LawNet(name, **LABELED, method="labeled")
    yield "sys-id", LawNet(name, law, flow, method="sys-id", elastic_rate=0.1)
    yield "admissible", LawNet(name, **ADMISSIBLE)


@cache
def trained(name):
    """Return the `LearnedLaws` of a name, or its `nclaw.gnn.simulator.Simulator`. Raises
    `Untrained` where they are missing, ValueError where they are damaged, or of another training or
    another scene than `nets` says now.
    """
    net = nets()[name]
    return stored(name, identity(net), (gnn_weights if isinstance(net, GraphNet) else weights).load)


def stored(name, expected, load=weights.load):
    """Return the content of a file of weights; expected: the `identity` that it must have. Raises
    as `trained`.
    """
    path = FOLDER / f"{name}.npz"
    record = diverged_path(path)
    reason = f"its training diverged ({record.name}); to try again: " if record.exists() else ""
    return load_weights(path, expected, load, f"{COMMAND} {name}", reason)


def file_digest(name):
    """Return the sha256 of the file of weights of a name."""
    return hashlib.sha256((FOLDER / f"{name}.npz").read_bytes()).hexdigest()


def identity(net):
    """Return the plain values that identify a training."""
    settings = {name: value for name, value in net._asdict().items()
                if name not in LATER or value != LawNet._field_defaults[name]}
    return {"scene": scene_digest(environment(net.environment)), **settings}


def scene_digest(scene):
    """Return the first 16 digits of a scene's hash."""
    return hashlib.sha256(canonical(scene).encode()).hexdigest()[:16]


def diverged_path(weights_file):
    """Return the path of the record of a diverged training, in place of a file of weights."""
    return weights_file.with_suffix(DIVERGED)


def store_diverged(weights_file, about):
    """Write the plain values of a diverged training, whole or not at all; return their path."""
    path = diverged_path(weights_file)
    write_whole(path, (json.dumps(about, indent=1) + "\n").encode())
    return path


def diverged(name, expected):
    """Return the plain values of a diverged training, with "errors" of its epochs and "stopped", a
    sentence; None where there is no record. expected: the `identity` that it must have. Raises
    ValueError for a file that cannot be read, or of another training or another scene.
    """
    path, command = diverged_path(FOLDER / f"{name}.npz"), f"{COMMAND} {name}"
    if not path.exists():
        return None
    try:
        about = json.loads(path.read_text())
    except ValueError as fault:
        raise ValueError(f"{path.name} is damaged: {fault}; {command}") from None
    require_identity(f"{path.name} is", about, expected, command)
    return about
