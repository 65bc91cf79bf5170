"""A training from what a scene gives: how its laws begin, and what they are trained on."""

import torch

from ...materials import Fluid, FluidProjection, NoFlow, make_flow, make_law
from ...materials.learned.weights import LearnedLaws
from ..batched_step import world
from . import sysid
from .fit import Diverged, train
from .labeled import labels_of, train_labeled
from .methods import LABELED, SYS_ID, laws_of, trained_of
from .rollout import trajectory_of

OF_FLOWS = "friction_angle", "tau_y", "sigma_y"     # constants that "sys-id" learns

__all__ = ["Diverged", "begun", "stored", "taught", "use_threads", "version"]


def begun(method, seed, kinds, material):
    """`rollout.Laws` before training.

    kinds: records of what both laws answer, of all methods but "sys-id"; material: a scene's record
    of the true laws, of which that takes all but the constants that it learns.
    """
    if method != SYS_ID:
        return laws_of(method, seed, *kinds)
    unit = make_law(material.law, E=1.0, nu=material.nu)
    return sysid.known_laws(unit, material.E, begun_flow(material.flow, unit))


def begun_flow(flow, law):
    """The flow of a scene with its constant at `sysid.START` of its value. A fluid without one has
    F = J^(1/d) R here (NCLAW-eq21).
    """
    if flow.type == "none":
        return FluidProjection() if isinstance(law, Fluid) else NoFlow()
    given = {name: sysid.START * getattr(flow, name) for name in OF_FLOWS
             if getattr(flow, name) is not None}
    if flow.s_min is not None:
        given["s_min"] = flow.s_min
    return make_flow(flow.type, law, 3, **given)


def taught(method, recipe, laws, seen, checkpoint=None, on_epoch=None):
    """The session that trained `laws`, in place, as a method asks for.

    seen: a `Problem` of one body at its start, and the `Observed` of its run; checkpoint and
    on_epoch as for `fit.train`. Raises `Diverged`.
    """
    problem, observed = seen
    where, trajectory = world(problem), trajectory_of(observed)
    if method == LABELED:
        labels = labels_of(trajectory, problem.bodies[0].law, where.dt)
        return train_labeled(recipe, laws, where, labels, checkpoint, on_epoch)
    return train(recipe, laws, where, trajectory, checkpoint, on_epoch)


def stored(laws, about):
    """`LearnedLaws` of laws that were trained."""
    return LearnedLaws(*map(trained_of, laws), about)


def use_threads(n):
    """Let PyTorch use n threads."""
    torch.set_num_threads(n)


def version():
    """PyTorch's."""
    return torch.__version__
