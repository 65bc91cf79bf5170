"""The range of strains in the training of the experiments' laws: from their file of weights, else
from the training run.
"""

from functools import cache

from mpm_ref.nclaw.bodies import body_maker
from mpm_ref.nclaw.train.recipe import Recipe
from mpm_ref.nclaw.train.strains import segment_cuts, training_bounds
from mpm_ref.scene import build

from ..common.scenes import threads_for
from .environments import environment, trajectory
from .trained_laws import nets, trained

LABELED = "labeled"     # the method that runs no segments


@cache
def visited_bounds(name):
    """Return the bounds (see `learned.strain_range`) of the laws of `nets` by name; raises as
    `trained`.
    """
    laws = trained(name)
    return laws.about["seen"] if "seen" in laws.about else bounds(nets()[name], laws)


def bounds(net, laws):
    """Return the bounds of the strains in the training of a `LawNet`'s laws."""
    observed, problem = trajectory(net.environment), build(environment(net.environment))
    steps = len(observed.x) - 1
    recipe = Recipe(epochs=net.epochs, first=net.first, last=net.last)
    cuts = () if net.method == LABELED else segment_cuts(recipe, steps)
    with threads_for(problem.bodies):
        return training_bounds(problem, observed, body_maker(laws), cuts)
