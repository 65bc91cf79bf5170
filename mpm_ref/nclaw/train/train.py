"""A training by one of the methods that are compared, from a scene's record to stored weights.

    ours            neural laws (NCLAW-alg4)
    spline          splines in principal stretches, no return map
    neural          a network in principal stretches, no return map
    no rotation     ours without R
    no undeformed   ours without the shift to rest, with biases
    labeled         ours, trained by `labeled.train_labeled`
    admissible      an energy and a contraction, which thermodynamics admits
    sys-id          the true laws, see `identified_laws`

All but the last are drawn from a seed, the elastic law first. Spline and neural have two kinds
each, that of the authors' release and a better founded one (`learned.spline`,
`learned.stretch_network`).
"""

import torch

from ...materials import Fluid, FluidProjection, NoFlow, make_flow, make_law
from ...materials.learned.stretch_network import ReleasedStretchStress, StretchStress
from ...materials.learned.weights import LearnedLaws
from ...training import Diverged
from ..batched_step import make_world
from .admissible_laws import ContractionModule, EnergyLawModule
from .fit import train
from .identified_laws import START, identified_laws
from .labeled import labels_of, train_labeled
from .neural_laws import NeuralLawModule, NoFlowModule, PlainLawModule, UnshiftedLawModule
from .observations import trajectory_of
from .principal_laws import ReleasedStretchLawModule, SplineLawModule, StretchLawModule
from .rollout import LawPair

SYS_ID, LABELED = "sys-id", "labeled"
OF_STRETCHES = {StretchStress: StretchLawModule, ReleasedStretchStress: ReleasedStretchLawModule}

IDENTIFIED = "friction_angle", "tau_y", "sigma_y"    # constants of flows that "sys-id" learns

__all__ = ["Diverged", "continued_laws", "drawn_laws", "initial_laws", "learned_laws",
           "train_laws", "use_threads", "version"]


def stretch_law(kind):
    """Return the law of either kind of `stretch_network`."""
    return OF_STRETCHES[type(kind)](kind)


METHODS = {     # method -> elastic and plastic law of a kind
    "ours": (NeuralLawModule, NeuralLawModule),
    LABELED: (NeuralLawModule, NeuralLawModule),
    "spline": (SplineLawModule, NoFlowModule),
    "neural": (stretch_law, NoFlowModule),
    "no rotation": (PlainLawModule, PlainLawModule),
    "no undeformed": (UnshiftedLawModule, UnshiftedLawModule),
    "admissible": (EnergyLawModule, ContractionModule),
}


def drawn_laws(method, seed, elastic, plastic):
    """Return the `LawPair` of a method and its kinds before training, drawn from a seed."""
    torch.manual_seed(seed)
    return LawPair(*(make(kind) for make, kind in zip(METHODS[method], (elastic, plastic),
                                                      strict=True)))


def continued_laws(method, learned):
    """Return the `LawPair` of a method of CONTINUED with the weights of `LearnedLaws`, for "ours"
    in single precision. Raises ValueError for laws of other kinds or layers.
    """
    laws = drawn_laws(method, 0, learned.elastic.kind, learned.plastic.kind)
    for law, own in zip(laws, (learned.elastic, learned.plastic), strict=True):
        require_layers(method, law.weights().layers, own.layers)
        law.resume(own)
        if any(b.any() != c.any() for (_, b), (_, c) in zip(law.weights().layers, own.layers,
                                                            strict=True)):
            raise ValueError(f"laws with biases: expected those of the method {method!r}, without")
    return laws


def require_layers(method, drawn, given):
    """Raise ValueError unless given layers have the shapes of those that are drawn."""
    shapes, expected = ([W.shape for W, _ in layers] for layers in (given, drawn))
    if shapes != expected:
        raise ValueError(f"laws with layers {shapes}: expected those of the method {method!r}, "
                         f"{expected}")


def initial_laws(method, seed, kinds, material):
    """Return the `LawPair` before training.

    kinds: records of the kinds of both laws, of all methods but "sys-id"; material: a scene's
    record of the true laws, of which "sys-id" takes all but the constants that it learns.
    """
    if method != SYS_ID:
        return drawn_laws(method, seed, *kinds)
    unit = make_law(material.law, E=1.0, nu=material.nu)
    return identified_laws(unit, material.E, initial_flow(material.flow, unit))


def initial_flow(flow, law):
    """Return the flow of a scene with its constant at START of its value. A fluid without one has
    F = J^(1/d) R here (NCLAW-eq21).
    """
    if flow.name == "none":
        return FluidProjection() if isinstance(law, Fluid) else NoFlow()
    given = {name: START * getattr(flow, name) for name in IDENTIFIED
             if getattr(flow, name) is not None}
    if flow.s_min is not None:
        given["s_min"] = flow.s_min
    return make_flow(flow.name, law, 3, **given)


def train_laws(method, recipe, laws, run, checkpoint=None, on_epoch=None):
    """Train `laws` in place by a method, and return the session.

    run: a `Problem` of one body at its start, and the `Observed` of its run; checkpoint and
    on_epoch as for `fit.train`. Raises `Diverged`.
    """
    problem, observed = run
    where, trajectory = make_world(problem), trajectory_of(observed)
    if method == LABELED:
        labels = labels_of(trajectory, problem.bodies[0].law, where.dt)
        return train_labeled(recipe, laws, where, labels, checkpoint, on_epoch)
    return train(recipe, laws, where, trajectory, checkpoint, on_epoch)


def learned_laws(laws, about):
    """Return the `LearnedLaws` of laws that were trained."""
    return LearnedLaws(*(law.weights() for law in laws), about)


def use_threads(n):
    """Let PyTorch use n threads."""
    torch.set_num_threads(n)


def version():
    """Return the version of PyTorch."""
    return torch.__version__
